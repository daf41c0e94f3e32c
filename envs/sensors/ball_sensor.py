"""A kinematic ball: moved along each ray to where it first touches something, and no farther."""

from __future__ import annotations

from math import isfinite, sqrt
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ...recognizer import FACE
from ..scene.scene import OBJECT, ProbeScene
from .ball_sweep import CLOSEST_ERROR, GAP, BallSweep
from .ball_touch import BallFelt, kind_of, report
from .noise import SensorNoise
from .touch import ProbeCommand, Touch, check_reach, triad

Floats = NDArray[np.float64]


class BallSensor:
    """Three balls on the rays of a triad; each stops where it first touches object or plane."""

    rays: int = 3
    features: Literal["faces", "all"] = "all"

    def __init__(self, noise: SensorNoise, reach: float, radius: float = 0.002) -> None:
        """A sensor of balls.

        Args:
            noise: bounds on what it reports.
            reach: how far before the point where the rays meet the centres start, metres.
            radius: of the balls, metres.

        Raises:
            ValueError: a radius that isn't above zero, or so large that the balls would start in
                the plane.
        """
        if not radius > 0.0:
            raise ValueError(f"the ball's radius is {radius:g} m; it must be above zero")
        check_reach(reach, radius)
        self.noise = noise
        self.reach = reach
        self.radius = radius

    def own_errors(self, scene: ProbeScene) -> tuple[float, float]:
        """What the simulation itself may be off by: metres, and radians."""
        return ball_errors(scene, self.radius)

    def touch(self, scene: ProbeScene, command: ProbeCommand, rng: np.random.Generator) -> Touch:
        """Send a triad; see `Sensor.touch`.

        Raises:
            ValueError: bounds too tight for the simulation, a ball that starts in the object, or
                an object whose convex parts are not known.
        """
        starts, directions = triad(command.x, command.y, command.yaw, self.reach)
        felt = self.feel(scene, starts, directions)
        errors = self.own_errors(scene)
        self.noise.check_room(*errors, f"a ball of {self.radius:g} m")
        return report(self.noise, rng, starts, directions, felt, self.radius, errors)

    def feel(self, scene: ProbeScene, starts: Floats, directions: Floats) -> list[BallFelt]:
        """What balls feel along rays, without noise.

        Args:
            scene: the scene.
            starts: (r, 3) where their centres start, metres, world frame.
            directions: (r, 3) unit directions.
        """
        sweep = BallSweep(scene, self.radius)
        felt = []
        for start, direction in zip(starts, directions, strict=True):
            met = sweep.first_contact(start, direction)
            position = met.centre_world - self.radius * met.normal_world
            kind = kind_of(scene, position, met.normal_world) if met.outcome == OBJECT else FACE
            free = met.depth if isfinite(met.depth) else -1.0
            felt.append(BallFelt(met.outcome, position, met.normal_world, kind, free))
        return felt


def ball_errors(scene: ProbeScene, radius: float) -> tuple[float, float]:
    """How far off the contact of a ball with the compiled parts may be, metres and radians.

    The surface is off by rounding and by how far the parts stray. A normal is off by how far the
    compiled faces lean; and whatever they do, the nearest places of two convex sets that are within
    d of each other, seen from the distance r, are within 2 sqrt(r d) of each other.
    """
    scene.solidify()
    shift = scene.position_rounding + scene.collision.stray
    position = shift + GAP + CLOSEST_ERROR
    return position, min(scene.part_leaning, 2.0 * sqrt(shift / radius)) + CLOSEST_ERROR / radius
