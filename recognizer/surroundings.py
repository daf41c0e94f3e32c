"""What is known of an object besides its contacts, and the test of poses against it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .contacts import APPROACH_ERROR, Contacts
from .cut_kernels import clear_poses
from .features import Features
from .free_space import FreeSpace
from .polyhedron import Polyhedron
from .pose import Poses, kernel_contacts
from .slot_kernels import CUTS
from .support import StableFace, SupportPlane, hull_corners
from .verdict_kernels import FEASIBLE, REJECTED

Floats = NDArray[np.float64]

GRAIN = 0.05
"""The strictness of the test of a path, as a share of its error: a pose is accepted if it leaves
the path so much more room than it must."""

POOL = 20_000
"""Boxes of rotations to look at for all interpretations of one call; about a second."""


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
        return (
            not len(self.free_space) and self.support is None and not contacts.approach_known.any()
        )


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
    free = surroundings.free_space
    bound = float(np.linalg.norm(model.vertices - model.centroid, axis=1).max())
    spare = [np.zeros((CUTS, 3))] * 2 + [np.full(CUTS, value) for value in (1e-12, 2.0, 1.0)]
    rows = zip(kernel_contacts(contacts), spare, strict=True)
    rotations, translations = poses.rotations.copy(), poses.translations.copy()
    costs, informations = poses.costs.copy(), poses.informations.copy()
    verdicts = clear_poses(
        poses.faces,
        poses.proven,
        tuple(np.concatenate(row) for row in rows),
        with_slots(features, model.centroid, model.diameter / 2.0),
        np.concatenate([features.half_angles, np.zeros(2 * CUTS)]),
        model.face_count,
        count,
        bound,
        (free.starts, free.ends, free.clearance, GRAIN * free.error),
        _limits(model, surroundings.support, standing),
        (contacts.approaches, np.where(contacts.approach_known, -np.sin(APPROACH_ERROR), -1.0)),
        POOL,
        rotations,
        translations,
        costs,
        informations,
    )
    kept = verdicts != REJECTED
    proven = verdicts == FEASIBLE
    return Poses(poses.faces, rotations, translations, costs, informations, proven).take(kept)


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
