"""A ball on a straight way through the scene, up to what it touches first.

Conservative advancement (Mirtich 1996) part by part. The distance of a convex part from a point
that moves on a line is a convex function of the way; its tangent is below it, so a step to where
the tangent meets the ball's radius never goes too far (Newton's method from one side), and a part
from which the ball moves away is never met. The part that can be met the earliest is looked at
next: where one is touched, no other was before it.
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass
from math import sqrt

import mujoco
import numpy as np
from numpy.typing import NDArray

from ..scene.scene import NOTHING, OBJECT, PLANE, ProbeScene

Floats = NDArray[np.float64]

GAP = 1e-9
"""What is left between ball and part where they count as touching, metres."""
CLOSEST_ERROR = 1e-8
"""How far off MuJoCo's closest points may be, metres; up to 3e-9 were seen from 2 mm away."""
FAR = 1e6
"""Farther than anything, metres."""


@dataclass(frozen=True, eq=False)
class BallContact:
    """Where a ball first touches something."""

    outcome: int
    """OBJECT, PLANE or NOTHING."""
    depth: float
    """How far the ball came, metres; infinity for NOTHING."""
    centre_world: Floats
    """(3,) of the ball, metres."""
    normal_world: Floats
    """(3,) unit vector to there from what it touches; zero for NOTHING."""


class BallSweep:
    """A ball of some radius in a scene, for as long as that isn't compiled anew."""

    def __init__(self, scene: ProbeScene, radius: float) -> None:
        """A ball of ``radius`` metres; the scene gets collision geometry if it has none.

        Raises:
            ValueError: the object has no exact convex parts.
        """
        scene.solidify()
        self._model, self._data = scene.mj_model, scene.mj_data
        self._point, self._parts = scene.point_geom, scene.part_geoms
        self._radius = radius
        self._reaches = scene.part_reaches + radius
        self._place = self._data.geom_xpos[self._point]
        self._ends = np.zeros(6)

    def closest(self, geom: int, centre_world: Floats) -> tuple[float, Floats]:
        """How far a point is from a part, below zero inside, and (3,) the vector to it from there.

        Args:
            geom: the part.
            centre_world: (3,) the point, metres.
        """
        self._place[:] = centre_world
        signed = mujoco.mj_geomDistance(self._model, self._data, self._point, geom, FAR, self._ends)
        away = centre_world - self._ends[3:]
        distance = sqrt(away @ away)
        return (distance if signed > 0.0 else -distance), away

    def first_contact(
        self, start_world: Floats, direction_world: Floats, depth: float = 0.0
    ) -> BallContact:
        """Go along a ray until something is touched.

        Args:
            start_world: (3,) where the ray starts, metres.
            direction_world: (3,) unit vector.
            depth: how far along it the ball is already, metres.

        Raises:
            ValueError: the ball is inside something where it starts.
        """
        waiting = self._earliest(start_world, direction_world, depth)
        centre = np.empty(3)
        while waiting:
            reached, part = heapq.heappop(waiting)
            np.multiply(direction_world, reached, centre)
            centre += start_world
            if part < 0:
                return BallContact(PLANE, reached, centre, np.array((0.0, 0.0, 1.0)))
            distance, away = self.closest(part, centre)
            gap = distance - self._radius
            if gap <= GAP:
                if gap < -GAP and reached == 0.0:
                    raise ValueError(
                        f"a ball of {self._radius:g} m does not start free at"
                        f" {np.round(centre, 6).tolist()}: it is in the object by {-gap:.3g} m"
                    )
                return BallContact(OBJECT, reached, centre, away / distance)
            slope = float(away @ direction_world) / distance
            if slope < 0.0:
                heapq.heappush(waiting, (reached - gap / slope, part))
        end = start_world + depth * direction_world
        return BallContact(NOTHING, np.inf, end, np.zeros(3))

    def _earliest(self, start: Floats, direction: Floats, depth: float) -> list[tuple[float, int]]:
        """When the ball can touch each part's bounding sphere at the earliest, and the plane (-1).

        Depths along the ray, as a heap.
        """
        middles = self._data.geom_xpos[self._parts] - start
        along = middles @ direction
        half = self._reaches**2 - (middles**2).sum(axis=1) + along**2
        waiting = []
        for part, middle, square in zip(self._parts, along.tolist(), half.tolist(), strict=True):
            if square >= 0.0 and middle + square**0.5 >= depth:
                waiting.append((max(middle - square**0.5, depth), part))
        if direction[2] < 0.0:
            plane = float((self._radius - start[2]) / direction[2])
            waiting.append((max(plane, depth), -1))
        heapq.heapify(waiting)
        return waiting
