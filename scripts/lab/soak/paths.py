"""Whether anything went through the object: reported ways against plain geometry.

A way is sound where it ends no farther along its ray than the first place at which a point, or a
ball of the tip's size, touches the true mesh, by what the sensor's bounds allow and no more. Where
that is comes from `SweepOracle`, from the recogniser's ray caster, which the simulation doesn't use
but for narrow triangles, and in the plane from a few lines here. Of range sensors, whose readings
are many, the promise of their free space is looked at: no place of a way is deeper inside than its
error.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import sin
from typing import Any

import numpy as np
from numpy.typing import NDArray
from oracles.geometry import signed_distances
from scipy.spatial.transform import RigidTransform

from ....envs.planar.planar_env import PlanarProbeEnv
from ....envs.probe_env import ProbeEnv
from ....envs.scene.scene import OBJECT, ProbeScene
from ....envs.sensors.ball_sensor import BallSensor
from ....envs.sensors.ball_touch import BallFelt
from ....envs.sensors.finger_sensor import FingerSensor
from ....envs.sensors.ray_sensor import RaySensor
from ....envs.truth import Truth
from ....recognizer import Polygon, Polyhedron
from ....recognizer.models.rays import cast_rays
from ..sweep_oracle import SweepOracle

Floats = NDArray[np.float64]

ROUNDING = 1e-9
"""Of numbers as large as a way is long, in metres: ways are of some tens of metres at most."""
SAMPLES = 33
"""Places looked at on what of a way is inside an object."""


class WatchedFinger(FingerSensor):
    """A finger that remembers how deep its tip ever was in anything."""

    deepest: float = 0.0
    """Metres."""

    @classmethod
    def like(cls, finger: FingerSensor) -> WatchedFinger:
        """One that touches as another finger does."""
        return cls(
            finger.noise,
            finger.reach,
            finger.design,
            speed=finger.speed,
            force_threshold=finger.force_threshold,
        )

    def feel(self, scene: ProbeScene, starts: Floats, directions: Floats) -> list[BallFelt]:
        """What a finger feels along rays; see `FingerSensor.feel`."""
        felt = super().feel(scene, starts, directions)
        self.deepest = max([self.deepest, *(one.deepest for one in felt)])
        return felt


@dataclass(frozen=True)
class Way:
    """One reported way, judged."""

    beyond: float
    """How far it ends beyond the first touch, or is inside, metres; below zero short of it."""
    allowed: float
    """How much of that the bounds allow, metres."""

    @property
    def sound(self) -> bool:
        """Whether it went through nothing."""
        return self.beyond <= self.allowed


def judge_last_probe(
    env: ProbeEnv | PlanarProbeEnv, action: Floats, info: dict[str, Any]
) -> list[Way]:
    """The ways of the probe that an environment has just sent.

    Args:
        env: the environment; its object lies as it did when it was touched.
        action: (3,), in the plane (2,): what the probe was sent by.
        info: what the environment returned.
    """
    inside = np.clip(np.asarray(action, np.float64), -1.0, 1.0)
    if isinstance(env, PlanarProbeEnv):
        return [_judge_planar(env, inside, Truth.of(env.library, info))]
    truth = Truth.of(env.library, info)
    if isinstance(env.sensors[0], RaySensor | BallSensor | FingerSensor):
        return _judge_triad(env, inside, truth)
    return _judge_lines(env, truth)


def _judge_triad(env: ProbeEnv, inside: Floats, truth: Truth[Polyhedron]) -> list[Way]:
    model, pose = truth.model, truth.T_world_object
    touch, sensor = env.touches[-1], env.sensors[0]
    meeting = np.append(inside[:2] * env.half_width, 0.0)
    radius = _radius(env)
    noise = sensor.noise
    # A centre is off as its contact is, and by what the normal's error does over the radius.
    off = noise.position_error + 2.0 * radius * sin(noise.normal_error / 2.0) + ROUNDING
    ways = []
    for start, end, outcome in zip(
        touch.starts_world, touch.ends_world, touch.outcomes, strict=True
    ):
        direction = (meeting - start) / np.linalg.norm(meeting - start)
        reached = float((end - start) @ direction)
        allowed = off if outcome == OBJECT else ROUNDING
        first = _first_touch(model, pose, start, direction, radius)
        if reached - first > allowed:
            # One that only grazes the object may have passed it by, as exact as the simulation is.
            graze = _own_error(env, model, radius)
            first = _grazing(model, pose, start, direction, radius, graze)
        ways.append(Way(reached - first, allowed))
    return ways


def _radius(env: ProbeEnv) -> float:
    if isinstance(env.sensors[0], FingerSensor):
        return env.sensors[0].design.radius
    return env.sensors[0].radius if isinstance(env.sensors[0], BallSensor) else 0.0


def _own_error(env: ProbeEnv, model: Polyhedron, radius: float) -> float:
    """How far off the simulated surface may be, metres; for a tip, half the bound at the most."""
    # Single precision, see `scene.MESH_ROUNDING`, and parts that stray; no bound may be less.
    return min(1e-6 * model.diameter + radius / 200.0, env.sensors[0].noise.position_error)


def _first_touch(
    model: Polyhedron, pose: RigidTransform, start: Floats, direction: Floats, radius: float
) -> float:
    """How far a point or a ball comes until it touches the true mesh, metres or infinity."""
    if radius > 0.0:
        return _oracle(model).sweep(pose, start, direction, radius).depth
    return float(cast_rays(model, pose, start[None], direction[None]).distances[0])


def _grazing(
    model: Polyhedron,
    pose: RigidTransform,
    start: Floats,
    direction: Floats,
    radius: float,
    by: float,
) -> float:
    """The same for a ball smaller by so much, or of points the most of a ring so wide."""
    if radius > 0.0:
        return _first_touch(model, pose, start, direction, radius - by)
    across = np.linalg.svd(direction[None])[2][1:]
    around = np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False)
    ring = start + by * (np.column_stack([np.cos(around), np.sin(around)]) @ across)
    return float(cast_rays(model, pose, ring, np.tile(direction, (len(ring), 1))).distances.max())


@lru_cache(maxsize=64)
def _oracle(model: Polyhedron) -> SweepOracle:
    return SweepOracle(model)


def _judge_lines(env: ProbeEnv, truth: Truth[Polyhedron]) -> list[Way]:
    """Of each swept line how deep it is inside the object at the most."""
    paths, model, pose = env.touches[-1].free_space, truth.model, truth.T_world_object
    spans = np.linalg.norm(paths.ends - paths.starts, axis=1)
    rows = np.flatnonzero(spans > 0.0)
    directions = (paths.ends[rows] - paths.starts[rows]) / spans[rows, None]
    hits = cast_rays(model, pose, np.ascontiguousarray(paths.starts[rows]), directions)
    ways = []
    for row, direction, first in zip(rows, directions, hits.distances, strict=True):
        allowed = float(paths.error[row]) + ROUNDING
        beyond = float(spans[row] - first)
        # What is inside is never deeper than it is long.
        if beyond > allowed:
            depths = np.linspace(first, spans[row], SAMPLES)[:, None]
            places = paths.starts[row] + depths * direction
            beyond = -float(signed_distances(model, pose.inv().apply(places)).min())
        ways.append(Way(beyond, allowed))
    return ways


def _judge_planar(env: PlanarProbeEnv, inside: Floats, truth: Truth[Polygon]) -> Way:
    touch = env.touches[-1]
    bearing = np.pi * inside[0]
    direction = np.array([np.cos(bearing), np.sin(bearing)])
    reached = float((touch.end_world - touch.start_world) @ direction)
    first = _first_crossing(truth.model, truth.T_world_object, touch.start_world, direction)
    hit = touch.outcome == OBJECT
    allowed = float(touch.contacts.position_error[0]) if hit else 0.0
    return Way(reached - first, allowed + ROUNDING)


def _first_crossing(
    outline: Polygon, pose: RigidTransform, start: Floats, direction: Floats
) -> float:
    """How far a point comes in the plane until it meets an outline, metres or infinity.

    An edge is met where its ends are on two sides of the way; one that is only touched at a corner,
    to a millionth of a millimetre, counts as passed by.
    """
    rotation = pose.rotation.as_matrix()[:2, :2]
    left = np.array([-direction[1], direction[0]])
    corners = outline.corners @ rotation.T + pose.translation[:2] - start
    beside, along = corners @ left, corners @ direction
    next_beside, next_along = np.roll(beside, -1), np.roll(along, -1)
    met = np.minimum(beside, next_beside) < -ROUNDING
    met &= np.maximum(beside, next_beside) > ROUNDING
    shares = beside[met] / (beside[met] - next_beside[met])
    crossings = along[met] + shares * (next_along[met] - along[met])
    return float(crossings[crossings >= 0.0].min(initial=np.inf))
