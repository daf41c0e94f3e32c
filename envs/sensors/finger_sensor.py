"""A finger at work: guarded moves along the rays of a triad, stopped by what they touch."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import RigidTransform

from ..scene.finger import FingerDesign
from ..scene.free_body import displacement
from ..scene.scene import ProbeScene
from .ball_sensor import ball_errors
from .ball_sweep import BallSweep
from .ball_touch import BallFelt, report
from .guarded_move import TRAVEL_SHARE, GuardedMove
from .noise import SensorNoise
from .touch import ProbeCommand, Touch, check_reach, triad

Floats = NDArray[np.float64]

SLOWEST = 1e-4
"""Metres a second."""
STOPPING_TIME = 0.02
"""A tip stops within its radius where it is no faster than the radius in this time, seconds: five
times the time constant of contacts."""


class FingerSensor:
    """A ball tip that is driven along the rays of a triad, one after the other, by dynamics.

    Each ray is a guarded move: at a set speed until the tip touches, or until it is pressed by a
    set force; then it retreats. The way through the air is the same for any step of time and is
    not simulated but for its end. An object that is free to move may be pushed; it comes to rest
    before the next ray.
    """

    rays: int = 3
    features: Literal["faces", "all"] = "all"

    def __init__(
        self,
        noise: SensorNoise,
        reach: float,
        design: FingerDesign | None = None,
        *,
        speed: float = 0.02,
        force_threshold: float | None = None,
    ) -> None:
        """A sensor with a finger.

        Args:
            noise: bounds on what it reports.
            reach: how far before the point where the rays meet the tip starts, metres.
            design: the finger's mechanics.
            speed: of the tip, metres a second.
            force_threshold: the normal force at which a move stops, newtons; None stops it at
                first contact.

        Raises:
            ValueError: a tip so large that it would start in the plane, a speed at which it would
                not stop within its radius, a threshold that the actuators can't reach.
        """
        design = design or FingerDesign()
        check_reach(reach, design.radius)
        fastest = design.radius / STOPPING_TIME
        if not SLOWEST <= speed <= fastest:
            raise ValueError(
                f"speed is {speed:g} m/s; a tip of {design.radius:g} m stops in time from"
                f" {SLOWEST:g} to {fastest:g} m/s"
            )
        most = design.force_limit / 2.0
        if force_threshold is not None and not 0.0 < force_threshold <= most:
            raise ValueError(
                f"force threshold is {force_threshold:g} N; actuators of {design.force_limit:g} N"
                f" an axis allow one above 0 and at most {most:g} N"
            )
        self.noise = noise
        self.reach = reach
        self.design = design
        self.speed = speed
        self.force_threshold = force_threshold

    def own_errors(self, scene: ProbeScene) -> tuple[float, float]:
        """What the finger itself may be off by: metres, and radians.

        At first contact the tip has gone on by up to a step's travel, and the back-projection takes
        it back as if it were on a face: a place on an edge is off by no more than the travel on
        either account, the normal by no more than the tip and its nearest place move, over the
        radius. On a face both are exact. Under a threshold the contact is where the tip slid to,
        and what is reported is the surface under it.
        """
        position, normal = ball_errors(scene, self.design.radius)
        if self.force_threshold is None:
            position += 2.0 * TRAVEL_SHARE * self.design.radius
            normal += 2.0 * TRAVEL_SHARE
        return position, normal

    def touch(self, scene: ProbeScene, command: ProbeCommand, rng: np.random.Generator) -> Touch:
        """Send a triad; see `Sensor.touch`.

        Raises:
            ValueError: bounds too tight for the simulation, a tip that starts in the object, or an
                object whose convex parts are not known.
        """
        starts, directions = triad(command.x, command.y, command.yaw, self.reach)
        felt = self.feel(scene, starts, directions)
        errors = self.own_errors(scene)
        radius = self.design.radius
        self.noise.check_room(*errors, f"a finger with a tip of {radius:g} m")
        return report(self.noise, rng, starts, directions, felt, radius, errors)

    def feel(self, scene: ProbeScene, starts: Floats, directions: Floats) -> list[BallFelt]:
        """What the finger feels along rays, without noise.

        Args:
            scene: the scene; the finger is mounted in it.
            starts: (r, 3) where the tip's centre starts, metres, world frame.
            directions: (r, 3) unit directions.
        """
        scene.mount(self.design)
        sweep = BallSweep(scene, self.design.radius)
        felt: list[BallFelt] = []
        poses: list[tuple[RigidTransform, RigidTransform]] = []
        for start, direction in zip(starts, directions, strict=True):
            before = scene.T_world_object
            move = GuardedMove(scene, sweep, start, direction, self.speed, self.force_threshold)
            felt.append(move.run())
            poses.append((before, scene.T_world_object))
            scene.settle()
        if not scene.free:
            return felt
        model, now = scene.model, scene.T_world_object
        return [
            replace(
                one,
                moved=displacement(model, touched, now),
                moved_in_all=displacement(model, before, now),
            )
            for one, (before, touched) in zip(felt, poses, strict=True)
        ]
