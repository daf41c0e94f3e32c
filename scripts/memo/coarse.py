"""What the memo's own model test would leave: its poses, and how far they put contacts off.

The memo computes a pose by averages, which is off by degrees, and then checks that each contact
lies on its face "to within some error range" (Section 3.2), without a figure. Here that range is as
wide as it has to be for the right interpretation to pass in a share of a row's trials. (The memo
says that it always passed; but with all trials, the one whose pose is worst conditioned decides,
and the range is inches.)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from .groups import DIRECTION_TOLERANCE, SHIFT_TOLERANCES_IN, count_groups, directions_of

if TYPE_CHECKING:
    from ...recognizer import Contacts, Polyhedron

Floats = NDArray[np.float64]


SHARE = 0.9
"""Of trials in which the right interpretation is to pass."""


@dataclass(frozen=True, eq=False)
class MemoPoses:
    """Poses of one trial's interpretations by the memo's method, and what they miss."""

    solved: NDArray[np.bool_]
    """(m,) whether the method has a pose; where it has none, nothing can fail."""
    misses_in: Floats
    """(m,) the largest distance of a contact from its face, inches; 0 without a pose."""
    directions: Floats
    """(m, 3) directions of rotation."""
    translations: Floats
    """(m, 3) metres."""
    right: int
    """The row of the right interpretation."""


@dataclass(frozen=True)
class MemoLeft:
    """What the memo's test leaves of the trials of a row."""

    range_in: float
    """The error range, inches."""
    interpretations: tuple[int, ...]
    """Left in each trial."""
    directions: tuple[int, ...]
    """Distinct directions of rotation in each trial."""
    shifted: tuple[tuple[int, ...], ...]
    """Distinct directions and translations in each trial, for each tolerance on translations."""


def memo_poses(
    model: Polyhedron,
    interpretations: NDArray[np.int32],
    right: NDArray[np.int32],
    contacts: Contacts,
) -> MemoPoses:
    """Poses of interpretations by the memo's method.

    Args:
        model: the object.
        interpretations: (m, n) a face for each contact.
        right: (n,) the right ones.
        contacts: the n contacts.
    """
    from ...envs.probe_env import INCH
    from .pose import memo_pose

    count = len(interpretations)
    rotations, shifts = np.tile(np.eye(3), (count, 1, 1)), np.zeros((count, 3))
    solved = np.zeros(count, bool)
    for row, faces in enumerate(interpretations):
        pose = memo_pose(model, faces, contacts)
        if pose is not None:
            solved[row] = True
            rotations[row], shifts[row] = pose.rotation.as_matrix(), pose.translation
    felt = np.einsum("mji,mnj->mni", rotations, contacts.positions - shifts[:, None])
    distances = np.zeros(interpretations.shape)
    for face in np.unique(interpretations):
        where = interpretations == face
        triangles = model.vertices[model.triangles[model.triangle_faces == face]]
        distances[where] = _distances(felt[where], triangles)
    return MemoPoses(
        solved,
        np.where(solved, distances.max(axis=1) / INCH, 0.0),
        directions_of(rotations),
        shifts,
        int(np.flatnonzero((interpretations == right).all(axis=1))[0]),
    )


def memo_left(trials: Sequence[MemoPoses]) -> MemoLeft:
    """What the memo's test leaves of the trials of a row.

    What has no pose is left, but is no transform; a trial has at least one of these.
    """
    right = [float(trial.misses_in[trial.right]) for trial in trials]
    widest = float(np.quantile(right, SHARE, method="inverted_cdf"))
    counts, directions = [], []
    shifted: list[list[int]] = [[] for _ in SHIFT_TOLERANCES_IN]
    for trial in trials:
        # Best first: a group is of what is like its best.
        order = np.argsort(trial.misses_in, kind="stable")
        kept = order[trial.misses_in[order] <= widest]
        counts.append(len(kept))
        kept = kept[trial.solved[kept]]
        places = trial.translations[kept]
        aligned = (trial.directions[kept], float(np.cos(DIRECTION_TOLERANCE)))
        directions.append(max(count_groups(*aligned), 1))
        for into, tolerance in zip(shifted, SHIFT_TOLERANCES_IN, strict=True):
            into.append(max(count_groups(*aligned, places, tolerance), 1))
    return MemoLeft(widest, tuple(counts), tuple(directions), tuple(map(tuple, shifted)))


def _distances(points: Floats, triangles: Floats) -> Floats:
    """(p,) distances of (p, 3) points from the nearest of (t, 3, 3) triangles, metres."""
    from trimesh.triangles import closest_point

    nearest = np.full(len(points), np.inf)
    for triangle in triangles:
        there = closest_point(np.broadcast_to(triangle, (len(points), 3, 3)), points)
        nearest = np.minimum(nearest, np.linalg.norm(points - there, axis=1))
    return nearest
