"""Compiled search for the cells of rotations in which some interpretation passes all pairs.

Cells are cut finer where they pass, down to an angle at which a contact can't turn far against its
bound. A cell is dropped only if the tree of pairs, grown in it, has no leaf: any pose within the
bounds whose rotation is in the cell would have its interpretation there. A branch of the first
contact that has no leaf in a cell has none in any part of it, so parts don't grow it again.
"""

from __future__ import annotations

import numpy as np

from ..compiling import borrowing, kernel
from .cell_kernels import facing
from .forward_kernels import check_forward, take_lowest
from .room_kernels import DIRECTIONS, enter, view_ways

_ONE = np.uint64(1)
TRIES = 400
"""Branches after which a cell passes without an answer."""


@borrowing
def rotation_of(vector, rotation):
    """The rotation (3, 3) of a rotation vector (3,), in place (Rodrigues)."""
    x, y, z = vector[0], vector[1], vector[2]
    angle = np.sqrt(x * x + y * y + z * z)
    first = np.sin(angle) / angle if angle > 1e-9 else 1.0
    second = (1.0 - np.cos(angle)) / (angle * angle) if angle > 1e-6 else 0.5
    square = angle * angle
    rotation[0, 0] = 1.0 - second * (square - x * x)
    rotation[1, 1] = 1.0 - second * (square - y * y)
    rotation[2, 2] = 1.0 - second * (square - z * z)
    rotation[0, 1], rotation[1, 0] = second * x * y - first * z, second * x * y + first * z
    rotation[0, 2], rotation[2, 0] = second * x * z + first * y, second * x * z - first * y
    rotation[1, 2], rotation[2, 1] = second * y * z - first * x, second * y * z + first * x


@borrowing
def view_cell(rotation, points, normals, between, facings):
    """Vectors between contacts (n, n, 3), i < j, and normals (n, 3) in a cell's own frame."""
    for j in range(len(points)):
        for a in range(3):
            facings[j, a] = 0.0
            for b in range(3):
                facings[j, a] += rotation[b, a] * normals[j, b]
        for i in range(j):
            for a in range(3):
                between[i, j, a] = 0.0
                for b in range(3):
                    between[i, j, a] += rotation[b, a] * (points[j, b] - points[i, b])


@borrowing
def _passes(contacts, model, domains, first, spare, pairs, cell, facings, slabs, space):
    """Whether some interpretation passes all pairs in a cell, or none was excluded in time.

    Features of the first contact whose branches have no leaf are dropped from (w,) ``first``.
    """
    left, sizes, untried, faces, nulls, null_left, near, rooms, ways = space
    n, words = domains.shape
    lost = 0
    for j in range(n):
        for w in range(words):
            left[0, j, w] = domains[j, w] if j > 0 else first[w]
        sizes[0, j] = facing(
            facings[j], contacts[3][j], contacts[4][j], cell[1], model, left[0, j], near
        )
        lost += sizes[0, j] == 0
    if lost > spare:
        return False
    level, tries = 0, 0
    for k in range(len(DIRECTIONS)):
        rooms[0, k, 0], rooms[0, k, 1] = -np.inf, np.inf
    nulls[0] = 0
    null_left[0] = spare > 0
    for w in range(words):
        untried[0, w] = left[0, 0, w]
        first[w] = left[0, 0, w]
    grown = -1
    while level >= 0:
        if level == 0 and grown >= 0:
            first[grown >> 6] &= ~(_ONE << np.uint64(grown & 63))
        face = take_lowest(untried[level])
        if level == 0:
            grown = face
        if face < 0:
            if not null_left[level]:
                level -= 1
                continue
            null_left[level] = False
        faces[level] = face
        depth = level + 1
        nulls[depth] = nulls[level] + (face < 0)
        tries += 1
        if tries > TRIES:
            return True
        if face < 0:
            for k in range(len(DIRECTIONS)):
                rooms[depth, k, 0], rooms[depth, k, 1] = rooms[level, k, 0], rooms[level, k, 1]
        elif not enter(ways[level], slabs[face], rooms[level], rooms[depth]):
            continue
        empty, _ = check_forward(
            level,
            face,
            depth,
            spare - nulls[depth],
            pairs,
            cell,
            left[level],
            sizes[level],
            left[depth],
            sizes[depth],
        )
        if nulls[depth] + empty > spare:
            continue
        if depth == n:
            return True
        level = depth
        null_left[level] = nulls[level] < spare
        for w in range(words):
            untried[level, w] = left[level, level, w]
    return False


@kernel
def passing_cells(
    contacts,
    errors,
    model,
    half_angles,
    packed,
    domains,
    spare,
    switches,
    readings,
    slabs,
    finest,
    most,
):
    """Cells of rotations that together hold those of all poses within the bounds.

    Args:
        contacts: see `search_kernels.search_model`, as are those that follow but ...
        domains: (n, w) bit sets, the features that each contact may be on.
        readings: (n, n, 9) see `mask_kernels.pair_readings`.
        slabs: see `room_kernels.feature_slabs`.
        finest: an angle, radians; cells of less are not cut further.
        most: cells to look at; then what is left is not cut further.

    Returns:
        (c, 3, 3) rotations, object to world; (c,) angles: each rotation of a cell is within it;
        (c, w) the features that the first contact may be on there.
    """
    (n, words), features = domains.shape, packed.shape[2]
    space = (
        np.zeros((n + 1, n, words), np.uint64),
        np.full((n + 1, n), features),
        np.zeros((n, words), np.uint64),
        np.full(n, -1, np.int64),
        np.zeros(n + 1, np.int64),
        np.zeros(n, np.bool_),
        np.empty(3),
        np.empty((n + 1, len(DIRECTIONS), 2)),
        np.empty((n, len(DIRECTIONS), 2)),
    )
    pairs = (packed, half_angles, errors, switches, model[0], readings)
    between, facings, rotation = np.empty((n, n, 3)), np.empty((n, 3)), np.empty((3, 3))
    # Breadth first, so that a budget ends on cells of one size.
    middles, half = np.zeros((1, 3)), np.pi
    firsts = domains[:1].copy()
    looked = 0
    passed = 1
    while True:
        angle = np.sqrt(3.0) * half
        if angle <= finest or looked + 8 * passed > most:
            break
        half *= 0.5
        angle = np.sqrt(3.0) * half + 1e-9
        cut, left_to_first = np.empty((8 * passed, 3)), np.empty((8 * passed, words), np.uint64)
        kept = 0
        for p in range(passed):
            for corner in range(8):
                nearest = 0.0
                for k in range(3):
                    side = half if (corner >> k) & 1 else -half
                    cut[kept, k] = middles[p, k] + side
                    nearest += max(abs(cut[kept, k]) - half, 0.0) ** 2
                # Rotation vectors fill a ball of radius pi.
                if nearest > np.pi**2:
                    continue
                looked += 1
                left_to_first[kept] = firsts[p]
                if angle < np.pi:
                    rotation_of(cut[kept], rotation)
                    view_cell(rotation, contacts[0], contacts[1], between, facings)
                    view_ways(contacts[0], contacts[2], rotation, angle, space[8])
                    cell = (between, angle)
                    if not _passes(
                        contacts,
                        model,
                        domains,
                        left_to_first[kept],
                        spare,
                        pairs,
                        cell,
                        facings,
                        slabs,
                        space,
                    ):
                        continue
                kept += 1
        middles, firsts, passed = cut[:kept].copy(), left_to_first[:kept].copy(), kept
        if passed == 0:
            break
    rotations = np.empty((passed, 3, 3))
    for p in range(passed):
        rotation_of(middles[p], rotations[p])
    return rotations, np.full(passed, min(np.sqrt(3.0) * half + 1e-9, np.pi)), firsts
