"""The poses of one solid that contacts allow: tree and model test as one compiled search.

Six degrees of freedom (memo, Section 4.2 on). See `search_kernels`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...contacts.contacts import Contacts
from ...models.polyhedron import Polyhedron
from ...tree.limits import SearchLimits
from ...tree.tree import Constraints
from ..fits.pose import Poses, kernel_contacts
from ..surroundings.surroundings import Surroundings, clear
from . import search_kernels
from .branch_kernels import BOXES, COUNTS, CUT, LEAVES_TRIED
from .solid import Bits, SolidEntry, bit_set

EXACT_SYMMETRY = 1e-7
"""How far a symmetry may miss, as a share of the smallest bound on a position, to stand for a part
of the search: what it misses is then below what a witness may miss a bound by."""

FINENESS = 4.0
"""Angle of the finest cells of rotations, in bounds on positions over the solid's radius, ..."""
CELL_ANGLES = (0.04, 0.4)
"""... and its least and largest, radians, ..."""
LEANING_CELL = 0.1
"""... and its least where some normals are known, which hold the lean: cells are for the turn."""
ROUNDING = 1e-12
"""Of a cosine."""
FEWEST_FOR_CELLS = 3
"""Contacts from which on cells are worth their time: two leave nearly all rotations possible."""
MOST_CELLS = 200_000
"""Cells to look at on the way there."""
SHARE_IN_CELLS = 3
"""The part of the boxes for leaves that those in cells may take."""

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Found:
    """What a search found, and how."""

    poses: Poses
    nodes: NDArray[np.int64]
    """(n,) branches seen at each level of the tree."""
    pruned: int
    """Interpretations left by the tree, before the last model test."""
    boxes: int
    """Boxes of rotations looked at for what one verdict left open."""
    complete: bool
    """False if a budget ran out."""


def find_poses(
    entry: SolidEntry,
    contacts: Contacts,
    constraints: Constraints,
    limits: SearchLimits,
    *,
    outliers: int = 0,
    prefixes: NDArray[np.int32] | None = None,
    surroundings: Surroundings,
) -> Found:
    """Every interpretation of contacts with one solid that isn't ruled out, with a pose.

    Args:
        entry: the solid.
        contacts: at least one contact, in the order of the search.
        constraints: which constraints on pairs prune the tree.
        limits: how far the search goes.
        outliers: how many contacts may lie on no feature.
        prefixes: (m, k) all interpretations of the first k contacts, if known.
        surroundings: what else is known.
    """
    settings = (constraints, limits, outliers)
    copies = 1
    if surroundings.support is not None and surroundings.support.resting:
        poses, nodes, counts = _search_standing(entry, contacts, surroundings, *settings, prefixes)
    else:
        smallest = float(contacts.position_error.min())
        permutations, missed = entry.permutations
        symmetric = (
            prefixes is None
            and len(permutations) > 1
            and missed < EXACT_SYMMETRY * smallest
            and outliers == 0
        )
        domains = entry.by_kind[contacts.kinds]
        if symmetric:
            domains[0] &= entry.orbits
        start = np.zeros((1, 0), np.int32) if prefixes is None else prefixes
        poses, nodes, counts = _search(entry, contacts, *settings, start, domains)
        if not surroundings.says_nothing(contacts):
            poses = clear(entry.model, entry.features, poses, contacts, surroundings)
        if symmetric:
            copies = len(permutations)
            poses = _spread_over_symmetries(entry.model, poses, permutations)
    return Found(
        poses, nodes, int(counts[LEAVES_TRIED]) * copies, int(counts[BOXES]), not counts[CUT]
    )


def _search(
    entry: SolidEntry,
    contacts: Contacts,
    constraints: Constraints,
    limits: SearchLimits,
    outliers: int,
    prefixes: NDArray[np.int32],
    domains: Bits,
) -> tuple[Poses, NDArray[np.int64], NDArray[np.int64]]:
    test = entry.test
    finest = _finest(contacts, test.radius)
    # Leaves in cells are dear, and a longer search would decide few more of them.
    pool = test.pool // SHARE_IN_CELLS if finest > 0.0 else test.pool
    faces, turns, shifts, costs, informations, proven, nodes, counts = search_kernels.search_model(
        kernel_contacts(contacts),
        contacts.normal_error,
        test.model,
        entry.features.half_angles,
        test.middles,
        entry.packed,
        prefixes,
        domains,
        outliers,
        constraints.bits,
        float(limits.crowd),
        limits.nodes,
        limits.budget,
        test.boxes,
        pool,
        finest,
        MOST_CELLS,
    )
    return Poses(faces, turns, shifts, costs, informations, proven), nodes, counts


def _search_standing(
    entry: SolidEntry,
    contacts: Contacts,
    surroundings: Surroundings,
    constraints: Constraints,
    limits: SearchLimits,
    outliers: int,
    prefixes: NDArray[np.int32] | None,
) -> tuple[Poses, NDArray[np.int64], NDArray[np.int64]]:
    """The search of a solid that stands on a face of its hull: each such face in its turn.

    The support is one more contact, on that face.
    """
    support = surroundings.support
    assert support is not None
    standing = entry.standing
    count, size = len(entry.features), len(standing.features)
    own = entry.by_kind[contacts.kinds]
    domains = np.zeros((len(contacts) + 1, -(-size // 64)), np.uint64)
    domains[1:, : own.shape[1]] = own
    parts: list[Poses] = []
    nodes = np.zeros(len(contacts), np.int64)
    counts = np.zeros(COUNTS, np.int64)
    # One that stands on either of two faces is there twice.
    start = np.zeros((1, 0), np.int32) if prefixes is None else np.unique(prefixes, axis=0)
    plain: Poses | None = None
    for index, face in enumerate(entry.stable_faces):
        touch = support.touch(face, entry.model.diameter, contacts, outliers)
        if touch is None:
            # Bounds so wide that the face's plane, as a contact, says nothing: only the pose does.
            if plain is None:
                plain, some_nodes, some_counts = _search(
                    entry, contacts, constraints, limits, outliers, start, own
                )
                nodes += some_nodes
                counts += some_counts
            parts.append(clear(entry.model, entry.features, plain, contacts, surroundings, face))
            continue
        everything = Contacts.join([touch, contacts])
        domains[0] = bit_set(np.array([count + index]), size)
        # Which face each one stood on isn't kept: any of them.
        foot = np.full((len(start), 1), count + index, np.int32)
        known = np.zeros((1, 0), np.int32) if prefixes is None else np.hstack([foot, start])
        poses, some_nodes, some_counts = _search(
            standing, everything, constraints, limits, outliers, known, domains
        )
        poses = poses.take(poses.faces[:, 0] >= 0)
        poses = clear(entry.model, standing.features, poses, everything, surroundings, face)
        parts.append(replace(poses, faces=np.ascontiguousarray(poses.faces[:, 1:])))
        nodes += some_nodes[1:]
        counts += some_counts
    return Poses.join(parts), nodes, counts


def _vague(contacts: Contacts) -> bool:
    """Whether the known normals leave the rotation open: fewer than two, or maybe all parallel."""
    rows = zip(contacts.normals, contacts.normal_error.tolist(), strict=True)
    known = ((normal, error) for normal, error in rows if error < math.pi / 2.0)
    first, first_error = next(known, (None, 0.0))
    # If none surely leans away from the first, two others are about as parallel. Contacts come in
    # an order that has those that lean most first, so mostly the second says it.
    return first is None or all(
        abs(first @ normal) >= math.cos(min(first_error + error, math.pi / 2.0)) - ROUNDING
        for normal, error in known
    )


def _finest(contacts: Contacts, radius: float) -> float:
    """The angle of cells of rotations worth searching one by one, radians; zero if none are.

    In a finer one the contacts turn by no more than they are off anyway.
    """
    if len(contacts) < FEWEST_FOR_CELLS or not _vague(contacts):
        return 0.0
    smallest = float(contacts.position_error.min())
    least, largest = CELL_ANGLES
    if contacts.normal_error.min() < np.pi / 2.0:
        least = LEANING_CELL
    return float(np.clip(FINENESS * smallest / radius, least, largest))


def _spread_over_symmetries(
    model: Polyhedron, poses: Poses, permutations: NDArray[np.int32]
) -> Poses:
    """Each interpretation as seen from every symmetry of the solid, with its pose."""
    if not len(poses):
        return poses
    count, found = len(permutations), len(poses)
    faces = permutations[:, poses.faces].reshape(count * found, -1)
    faces, rows = np.unique(faces, axis=0, return_index=True)
    which, of = np.divmod(rows, found)
    turns = model.symmetries[which]
    rotations = poses.rotations[of] @ turns.transpose(0, 2, 1)
    centres = poses.translations[of] + poses.rotations[of] @ model.centroid
    # A motion in the object's frame turns along.
    frames = np.zeros((len(of), 6, 6))
    frames[:, :3, :3] = frames[:, 3:, 3:] = turns
    informations = frames @ poses.informations[of] @ frames.transpose(0, 2, 1)
    return Poses(
        np.ascontiguousarray(faces, np.int32),
        rotations,
        centres - rotations @ model.centroid,
        poses.costs[of],
        informations,
        poses.proven[of],
    )
