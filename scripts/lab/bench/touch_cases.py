"""Approaches for the measurement of touch: a ball on its way to a given face, edge or vertex."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull
from scipy.spatial.transform import RigidTransform, Rotation

from ....envs.sensors.touch import triad
from ....recognizer import Polyhedron
from ....recognizer.models.features import convex_edges, convex_vertices
from ..sweep_oracle import EDGE, FACE, VERTEX, SweepOracle, Swept

Floats = NDArray[np.float64]

KINDS: dict[int, str] = {FACE: "face", EDGE: "edge", VERTEX: "vertex"}
STEEPEST = 0.1
"""Least cosine between the way back and the normal: the flattest approach is 84 degrees off it."""
MOST_DRAWS = 2000
"""Of places and orientations for one approach; a feature that none of them reaches is hidden."""
AT_TARGET = 1e-9
"""How near to the place aimed at the oracle has to put the contact, metres."""


@dataclass(frozen=True, eq=False)
class Approach:
    """A ball on a ray of a triad, an object in its way, and what must come of it."""

    T_world_object: RigidTransform
    start_world: Floats
    """(3,) metres."""
    direction_world: Floats
    """(3,) unit vector."""
    swept: Swept
    """Where it touches by plain geometry."""
    feature: int
    """Which face, convex edge or convex vertex."""


def depth_in_hull(model: Polyhedron, point_object: Floats) -> float:
    """How deep a place (3,) is inside a solid's convex hull, metres."""
    planes = _hull_planes(model)
    return -float((planes[:, :3] @ point_object + planes[:, 3]).max())


@cache
def _hull_planes(model: Polyhedron) -> Floats:
    return ConvexHull(model.vertices).equations


class ApproachSampler:
    """Draws approaches to the features of one object."""

    def __init__(self, model: Polyhedron, radius: float, reach: float) -> None:
        """Prepare an object for balls of ``radius`` metres on rays of ``reach`` metres."""
        self.model = model
        self.oracle = SweepOracle(model)
        self.radius, self.reach = radius, reach
        self._edges, self._vertices = convex_edges(model), convex_vertices(model)

    def count(self, kind: int) -> int:
        """How many features of a kind there are."""
        edges, vertices = len(self._edges), len(self._vertices)
        counts: dict[int, int] = {FACE: self.model.face_count, EDGE: edges, VERTEX: vertices}
        return counts[kind]

    def draw(self, kind: int, feature: int, rng: np.random.Generator) -> Approach | None:
        """An approach that meets a feature first; None if none is found.

        Place and normal are drawn evenly over the feature and its normals, and the orientation
        evenly over all that face the ball.
        """
        for _ in range(MOST_DRAWS):
            place, normal = self._aim(kind, feature, rng)
            yaw = rng.uniform(-np.pi / 3.0, np.pi / 3.0)
            x, y = rng.uniform(-0.1, 0.1, 2)
            starts, directions = triad(x, y, yaw, self.reach)
            ray = int(rng.integers(3))
            start, direction = starts[ray], directions[ray]
            rotation = Rotation.random(rng=rng)
            if -rotation.apply(normal) @ direction < STEEPEST:
                continue
            # The centre ends somewhere above the plane, and not so near to it that it is met.
            height = rng.uniform(1.01 * self.radius, 0.5 * start[2])
            centre = start + (start[2] - height) / -direction[2] * direction
            shift = centre - rotation.apply(place + self.radius * normal)
            pose = RigidTransform.from_components(shift, rotation)
            swept = self.oracle.sweep(pose, start, direction, self.radius)
            aimed = np.linalg.norm(swept.position_world - pose.apply(place)) < AT_TARGET
            if swept.kind == kind and aimed:
                return Approach(pose, start, direction, swept, feature)
        return None

    def _aim(self, kind: int, feature: int, rng: np.random.Generator) -> tuple[Floats, Floats]:
        """A place on a feature and one of its normals, object frame."""
        if kind == FACE:
            members = self.model.triangles[self.model.triangle_faces == feature]
            corners = self.model.vertices[members]
            sides = corners[:, 1:] - corners[:, :1]
            areas = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
            triangle = corners[rng.choice(len(corners), p=areas / areas.sum())]
            return rng.dirichlet(np.ones(3)) @ triangle, self.model.normals[feature].copy()
        points, cone = (self._edges if kind == EDGE else self._vertices)[feature]
        normal = rng.dirichlet(np.ones(len(cone))) @ cone
        return rng.dirichlet(np.ones(len(points))) @ points, normal / np.linalg.norm(normal)
