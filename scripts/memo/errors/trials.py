"""Trials of the memo's Table V: poses of the right interpretation, and how far off they are."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import RigidTransform, Rotation

from ....envs.probe_env import INCH
from ....envs.sensors.grid import sense_grid
from ....recognizer.tree.tree import prune
from ..plan import Trials
from ..pose import memo_pose
from ..trial import Spec, prepared

Floats = NDArray[np.float64]

METHODS = ("the memo's method", "joint fit")
DIRECTION, ANGLE, WHOLE, TRANSLATION = range(4)
"""Columns of what is measured of a pose."""


@dataclass(frozen=True, eq=False)
class Errors:
    """How far off the poses of some trials are."""

    by_method: Mapping[str, Floats]
    """(t, 4) for each of `METHODS`: see `pose_errors`; rows of NaN where it gives no pose."""
    angles: Floats
    """(t,) by how much the object was truly turned, degrees."""
    lost: int
    """Trials in which the tree or the model test dropped the right interpretation."""

    @classmethod
    def join(cls, parts: Sequence[Errors]) -> Errors:
        """All trials of all parts, at least one."""
        return cls(
            {name: np.concatenate([part.by_method[name] for part in parts]) for name in METHODS},
            np.concatenate([part.angles for part in parts]),
            sum(part.lost for part in parts),
        )


def measure_errors(piece: Trials[Spec]) -> Errors:
    """Sense an object, and compare the poses of the right interpretation with the truth.

    A trial's pose and its shares of the noise depend on its number alone, so that rows of one
    object differ by their bounds and by nothing else.
    """
    thing, noise = prepared(piece.row.object_name), piece.row.noise()
    by_method = {name: np.full((piece.count, 4), np.nan) for name in METHODS}
    angles, lost = np.empty(piece.count), 0
    for row, rng in enumerate(piece.generators()):
        truth = sense_grid(thing.model, rng)
        contacts = truth.noisy(noise, rng)
        angles[row] = math.degrees(truth.T_world_object.rotation.magnitude())
        fitted = thing.test(truth.faces[None], contacts)
        kept = (prune(thing.tables, contacts).faces == truth.faces).all(axis=1).any()
        lost += not (kept and len(fitted))
        poses = {METHODS[0]: memo_pose(thing.model, truth.faces, contacts)}
        if len(fitted):
            turn = Rotation.from_matrix(fitted.rotations[0])
            poses[METHODS[1]] = RigidTransform.from_components(fitted.translations[0], turn)
        for name, pose in poses.items():
            if pose is not None:
                by_method[name][row] = pose_errors(pose, truth.T_world_object)
    return Errors(by_method, angles, lost)


def pose_errors(pose: RigidTransform, truth: RigidTransform) -> Floats:
    """(4,) how far off a pose is: see `DIRECTION` and what follows it.

    Degrees between the directions of rotation, between the angles about them, and of the rotation
    that leads from one pose to the other; inches between the translations of the model's origin.
    (r, θ) and (-r, -θ) are one rotation: of both the one counts whose direction is nearer.
    """
    found, right = pose.rotation.as_rotvec(), truth.rotation.as_rotvec()
    angle, right_angle = np.linalg.norm(found), np.linalg.norm(right)
    # A rotation by nothing has any direction: the best one counts.
    direction = found / angle if angle > 0.0 else right / max(right_angle, 1e-300)
    right_direction = right / right_angle if right_angle > 0.0 else direction
    if direction @ right_direction < 0.0:
        direction, angle = -direction, -angle
    sine = np.linalg.norm(np.cross(direction, right_direction))
    between = math.atan2(float(sine), float(direction @ right_direction))
    turned = abs(math.remainder(float(angle - right_angle), 2.0 * math.pi))
    whole = float((pose.rotation.inv() * truth.rotation).magnitude())
    shift = float(np.linalg.norm(pose.translation - truth.translation)) / INCH
    return np.array([*map(math.degrees, (between, turned, whole)), shift])
