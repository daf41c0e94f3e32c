"""What balls report: a triad of them, met with what they met, as contacts and capsules."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import reduce
from math import sin
from operator import or_

import numpy as np
from numpy.typing import NDArray

from ...recognizer import Contacts, FreeSpace
from ...recognizer.contacts.contacts import APPROACH_ERROR
from ..scene.free_body import STILL, Displacement
from ..scene.scene import OBJECT, ProbeScene
from .noise import SensorNoise
from .touch import Touch

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class BallFelt:
    """What a ball felt along one ray, without noise."""

    outcome: int
    """OBJECT, PLANE or NOTHING."""
    position_world: Floats
    """(3,) the contact, metres."""
    normal_world: Floats
    """(3,) the outward unit normal there."""
    kind: int
    """FACE, EDGE or VERTEX of the object; any for the plane."""
    free: float
    """How far the centre went before the ball touched anything, metres; below zero where the way
    is not known to be straight."""
    pressed: float = 0.0
    """How much farther along the ray it was when it felt that, metres."""
    forces: Floats = field(default_factory=lambda: np.zeros((0, 2)))
    """(k, 2) seconds and newtons."""
    deepest: float = 0.0
    """How deep a tip was in anything on the whole move, metres."""
    moved: Displacement = STILL
    """How far the object moved from then to the end of the probe."""
    moved_in_all: Displacement = STILL
    """How far it moved from the start of the ray to the end of the probe."""


def kind_of(scene: ProbeScene, point_world: Floats, normal_world: Floats) -> int:
    """What of the object a ball touches; see `FeatureKinds.kind`, here in the world frame."""
    rotation = scene.T_world_object.rotation.as_matrix()
    point = (point_world - scene.T_world_object.translation) @ rotation
    return scene.kinds.kind(point, normal_world @ rotation)


def report(
    noise: SensorNoise,
    rng: np.random.Generator,
    starts: Floats,
    directions: Floats,
    felt: Sequence[BallFelt],
    radius: float,
    own_errors: tuple[float, float],
) -> Touch:
    """What a probe of balls reports, noise added.

    Args:
        noise: the bounds.
        rng: source of the noise.
        starts: (r, 3) where the centres started, metres.
        directions: (r, 3) unit directions.
        felt: what each felt.
        radius: of the balls, metres.
        own_errors: what the sensor itself may be off by: metres and radians.
    """
    outcomes = np.array([one.outcome for one in felt], np.int8)
    positions, normals = noise.blur(
        rng,
        outcomes,
        np.array([one.position_world for one in felt]),
        np.array([one.normal_world for one in felt]),
        *own_errors,
    )
    hit = outcomes == OBJECT
    # How far the centre came, by what is reported of the contact: a path must not tell more.
    measured = ((positions + radius * normals - starts) * directions).sum(axis=1)
    exact = np.array([one.free for one in felt])
    reached = np.where(hit, measured, np.maximum(exact, 0.0))
    # A centre is off as its contact is, and by what the normal's error does over the radius. The
    # first is the path's error; the second comes off its end.
    lever = 2.0 * radius * sin(noise.normal_error / 2.0)
    pressed = np.array([one.pressed for one in felt])
    ends = np.where(hit, np.maximum(reached - pressed - lever, 0.0), reached)
    straight = exact >= 0.0
    # Both are to hold for the object as it lies when the probe ends.
    since = np.array([(one.moved.distance, one.moved.turn) for one in felt])
    since_start = np.array([one.moved_in_all.distance for one in felt])
    kinds = np.array([one.kind for one in felt], np.int8)
    contacts = Contacts(
        positions[hit],
        normals[hit],
        position_error=noise.position_error + since[hit, 0],
        normal_error=np.minimum(noise.normal_error + since[hit, 1], np.pi),
        approaches=np.where(_facing(felt, directions)[:, None], directions, 0.0)[hit],
        kinds=kinds[hit],
    )
    paths = FreeSpace(
        starts[straight],
        (starts + ends[:, None] * directions)[straight],
        radius=radius,
        error=noise.position_error + since_start[straight],
    )
    forces = tuple(one.forces for one in felt)
    return Touch(
        contacts,
        paths,
        starts,
        starts + reached[:, None] * directions,
        outcomes,
        forces if any(len(force) for force in forces) else (),
        reduce(or_, (one.moved | one.moved_in_all for one in felt)),
        radius,
    )


def _facing(felt: Sequence[BallFelt], directions: Floats) -> NDArray[np.bool_]:
    """Which contacts are known to face where the ball came from, as the object lies now.

    All, but for a tip that slid on, and an object that has turned too far since.
    """
    normals = np.array([one.normal_world for one in felt])
    turned = np.array([one.moved.turn for one in felt])
    return ((normals * directions).sum(axis=1) < 0.0) & (turned <= APPROACH_ERROR)
