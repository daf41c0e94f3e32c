"""What is known of an object besides its contacts, and the test of poses against it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...contacts.contacts import APPROACH_ERROR, Contacts
from ...contacts.free_space import FreeSpace
from ...contacts.support import StableFace, SupportPlane, hull_corners
from ...models.features import Features
from ...models.polyhedron import Polyhedron
from ..fits.pose import Poses, kernel_contacts
from ..fits.verdict_kernels import FEASIBLE, REJECTED, UNDECIDED
from .clear_kernels import clear_poses
from .repair import Bounds, repair
from .slot_kernels import CUTS

Floats = NDArray[np.float64]

GRAIN = 0.005
"""The strictness of the test of a path, as a share of its error: a pose is accepted if it leaves
the path so much more room than it must."""

POOL = 20_000
"""Boxes of rotations to look at for all interpretations of one call; about a second."""

PROGRAMS = 200
"""Linear programs to solve for all interpretations of one call; about a second."""


@dataclass(frozen=True, eq=False)
class Surroundings:
    """What is known of an object besides its contacts."""

    free_space: FreeSpace
    support: SupportPlane | None

    @classmethod
    def of(cls, free_space: FreeSpace | None, support: SupportPlane | None) -> Surroundings:
        """Hold what is known, if anything."""
        return cls(free_space or FreeSpace.none(), support)

    def says_nothing(self, contacts: Contacts) -> bool:
        """Whether nothing is known, approaches of contacts included."""
        return not len(self.free_space) and self.support is None and not contacts.approaches.any()


def with_slots(features: Features, centroid: Floats, radius: float) -> tuple:
    """Features as the kernels read them, with slots for cuts: squares, then points."""
    count = len(features)
    hulls = int(features.start[count])
    sizes = np.diff(features.start)
    added = np.array([4] * CUTS + [1] * CUTS)
    start = np.cumsum([0, *sizes[:count], *added, *sizes[count:], *added])
    last = np.tile([0.0, 0.0, 1.0], (2 * CUTS, 1))
    room = np.zeros((int(added.sum()), 3))
    pieces = int(features.first[-1]) + 2 * CUTS
    return (
        np.concatenate([features.normals, last]),
        np.concatenate([features.offsets, np.zeros(2 * CUTS)]),
        np.concatenate([features.first + 2 * CUTS, pieces + 1 + np.arange(2 * CUTS)]),
        start.astype(np.int64),
        np.concatenate([features.corners[:hulls], room, features.corners[hulls:], room]),
        centroid,
        radius,
        np.concatenate([features.cone_start, features.cone_start[-1] + 1 + np.arange(2 * CUTS)]),
        np.concatenate([features.cone_normals, last]),
    )


def clear(
    model: Polyhedron,
    features: Features,
    poses: Poses,
    contacts: Contacts,
    surroundings: Surroundings,
    standing: StableFace | None = None,
) -> Poses:
    """Move poses to where they break nothing that is known; drop those that can't be.

    Args:
        model: the solid.
        features: what of it the interpretations name.
        poses: of its interpretations.
        contacts: what was felt.
        surroundings: what else is known.
        standing: the face of its hull that it stands on, if that is part of what is known.

    Returns:
        The interpretations that some pose satisfies; ``proven`` where it meets every bound.
    """
    if not len(poses):
        return poses
    count = len(features)
    bounds = bounds_of(model, features, contacts, surroundings, standing)
    cleared = replace(
        poses,
        rotations=poses.rotations.copy(),
        translations=poses.translations.copy(),
        costs=poses.costs.copy(),
        informations=poses.informations.copy(),
    )
    half_angles = np.concatenate([features.half_angles, np.zeros(2 * CUTS)])
    verdicts = _clear(cleared, poses.proven, bounds, half_angles, count)
    stuck = poses.proven & (verdicts == UNDECIDED)
    if stuck.any():
        found = _repair(cleared, stuck, bounds)
        # A witness has nothing to clear; this weighs it, and is a second judge of it.
        again = _clear(cleared, found, bounds, half_angles, count)
        verdicts[found & (again == FEASIBLE)] = FEASIBLE
    proven = verdicts == FEASIBLE
    # What a pose was moved by, it may be farther from the others.
    reaches = poses.reaches + _moved(model, poses, cleared)
    return replace(cleared, proven=proven, reaches=reaches).take(verdicts != REJECTED)


def _moved(model: Polyhedron, before: Poses, after: Poses) -> Floats:
    """(m, 2) how far poses were moved: the turn, radians, and the way of the centroid, metres."""
    turns = np.einsum("mab,mab->m", before.rotations, after.rotations)
    ways = (after.rotations - before.rotations) @ model.centroid
    ways += after.translations - before.translations
    return np.column_stack(
        [np.arccos(np.clip((turns - 1.0) / 2.0, -1.0, 1.0)), np.linalg.norm(ways, axis=1)]
    )


def bounds_of(
    model: Polyhedron,
    features: Features,
    contacts: Contacts,
    surroundings: Surroundings,
    standing: StableFace | None = None,
) -> Bounds:
    """All that a pose of a solid has to meet; arguments as in `clear`."""
    free = surroundings.free_space
    bound = float(np.linalg.norm(model.vertices - model.centroid, axis=1).max())
    spare = [np.zeros((CUTS, 3))] * 2 + [np.full(CUTS, value) for value in (1e-12, 2.0, 1.0)]
    rows = zip(kernel_contacts(contacts), spare, strict=True)
    return Bounds(
        contacts=tuple(np.concatenate(row) for row in rows),
        model=with_slots(features, model.centroid, model.diameter / 2.0),
        solid_faces=model.face_count,
        bound=bound,
        paths=(free.starts, free.ends, free.clearance, GRAIN * free.error),
        path_scales=free.error,
        support=_limits(model, surroundings.support, standing),
        support_scale=surroundings.support.error if surroundings.support else 1.0,
        approaches=(
            contacts.approaches,
            np.where(contacts.approach_known, -np.sin(APPROACH_ERROR), -1.0),
        ),
    )


def _clear(
    poses: Poses,
    which: NDArray[np.bool_],
    bounds: Bounds,
    half_angles: Floats,
    features: int,
) -> NDArray[np.int8]:
    """`cut_kernels.clear_poses` for some of the poses, changed in place; verdicts of all."""
    return clear_poses(
        poses.faces,
        which,
        bounds.contacts,
        bounds.model,
        half_angles,
        bounds.solid_faces,
        features,
        bounds.bound,
        bounds.paths,
        bounds.support,
        bounds.approaches,
        POOL,
        poses.rotations,
        poses.translations,
        poses.costs,
        poses.informations,
    )


def _repair(poses: Poses, stuck: NDArray[np.bool_], bounds: Bounds) -> NDArray[np.bool_]:
    """Seek witnesses for some of the poses, changed in place; for which one was found."""
    found = np.zeros(len(poses), bool)
    left = PROGRAMS
    for row in np.flatnonzero(stuck):
        rotation, translation, met, solved = repair(
            poses.faces[row].astype(np.int64),
            poses.rotations[row],
            poses.translations[row],
            bounds,
            left,
        )
        left -= solved
        if met:
            poses.rotations[row], poses.translations[row] = rotation, translation
            found[row] = True
    return found


def _limits(
    model: Polyhedron, support: SupportPlane | None, standing: StableFace | None
) -> tuple[Floats, Floats, Floats, Floats]:
    """Corners, signs and heights as `cut_kernels.clear_pose` reads them, and the way up."""
    if support is None:
        return np.zeros((0, 3)), np.zeros(0), np.zeros(0), np.array([0.0, 0.0, 1.0])
    corners = hull_corners(model)
    low = np.full(len(corners), support.height - support.error)
    if standing is None:
        return corners, np.ones(len(corners)), low, support.up
    return (
        np.concatenate([corners, standing.corners]),
        np.concatenate([np.ones(len(corners)), -np.ones(len(standing.corners))]),
        np.concatenate([low, np.full(len(standing.corners), support.height + support.error)]),
        support.up,
    )
