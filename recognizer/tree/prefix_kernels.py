"""Compiled beginnings of a search: contacts whose features are known already, one by one."""

from __future__ import annotations

import numpy as np

from ..compiling import borrowing
from .cell_kernels import facing
from .forward_kernels import check_forward
from .room_kernels import enter

_ONE = np.uint64(1)
_NONE = np.uint64(0)


@borrowing
def face_cell(contacts, model, facings, angle, allowed, sizes, near):
    """Drop features that no rotation of a cell turns towards the normals, for every contact.

    Args:
        contacts: see `search_kernels.search_model`.
        model: likewise.
        facings: (n, 3) normals in the cell's own frame.
        angle: of the cell, radians.
        allowed: (n, w) bit sets, narrowed in place.
        sizes: (n,) how many are left, in place.
        near: (3,) work space.
    """
    for j in range(len(allowed)):
        sizes[j] = facing(
            facings[j], contacts[3][j], contacts[4][j], angle, model, allowed[j], near
        )


@borrowing
def known_of(prefixes, known):
    """Reduce (n, w) bit sets of the first contacts, in place, to what (m, k) prefixes say."""
    count, start = prefixes.shape
    for i in range(start):
        for w in range(known.shape[1]):
            known[i, w] = _NONE
    for m in range(count):
        for i in range(start):
            f = prefixes[m, i]
            if f >= 0:
                known[i, f >> 6] |= _ONE << np.uint64(f & 63)


@borrowing
def begin(prefix, pairs, cell, ways, slabs, allowed, allowed_sizes, faces, left, sizes, room):
    """Assign the first contacts, and narrow what they leave to those after them.

    Args:
        prefix: (k,) a feature for each, -1 for none.
        pairs: see `forward_kernels.check_forward`.
        cell: likewise.
        ways: see `room_kernels.view_ways`; only looked at in a cell.
        slabs: see `room_kernels.feature_slabs`.
        allowed: (n, w) bit sets, the features that each contact may be on.
        allowed_sizes: (n,) how many.
        faces: (n,) the features assigned; in place.
        left: (n, w) bit sets left to the contacts after them; in place.
        sizes: (n,) how many, likewise.
        room: (k, 2) of the contacts' middle, in place.

    Returns:
        How many of them are on none; -1 if no pose in the cell has them so.
    """
    start = len(prefix)
    in_cell = cell[1] >= 0.0
    nulls = 0
    for k in range(len(room)):
        room[k, 0], room[k, 1] = -np.inf, np.inf
    for i in range(start):
        f = prefix[i]
        faces[i] = f
        if f < 0:
            nulls += 1
        elif in_cell and (
            allowed[i, f >> 6] & (_ONE << np.uint64(f & 63)) == _NONE
            or not enter(ways[i], slabs[f], room, room)
        ):
            return -1
    for j in range(start, len(left)):
        for w in range(allowed.shape[1]):
            left[j, w] = allowed[j, w]
        sizes[j] = allowed_sizes[j]
    for i in range(start):
        if faces[i] >= 0:
            check_forward(i, faces[i], start, len(left), pairs, cell, left, sizes, left, sizes)
    return nulls
