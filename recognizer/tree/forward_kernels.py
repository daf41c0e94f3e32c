"""Compiled forward checking: what each assignment leaves to the contacts after it.

Sets of features are rows of 64-bit words, see `mask_kernels`.
"""

from __future__ import annotations

import numpy as np

from ..compiling import borrowing
from .cell_kernels import narrow_in_cell
from .mask_kernels import bit_index, narrow

_ONE = np.uint64(1)
_NONE = np.uint64(0)


@borrowing
def take_lowest(members):
    """Take the lowest feature out of a (w,) bit set; -1 if it is empty."""
    for w in range(len(members)):
        bits = members[w]
        if bits != _NONE:
            lowest = bits & (~bits + _ONE)
            members[w] = bits ^ lowest
            return w * 64 + bit_index(lowest)
    return -1


@borrowing
def check_forward(i, face, first, room, pairs, cell, domains, sizes, kept, kept_sizes):
    """Narrow the features left to later contacts by what one contact is on.

    Args:
        i: the contact.
        face: its feature, -1 for none.
        first: the first of the later contacts.
        room: how many of them may be left without a feature; with more, the rest isn't looked at.
        pairs: as in `search_kernels.search_model`: packed tables, half angles, bounds on normals,
            switches; normals (f, 3) of the features; and (n, n, 9) pair readings.
        cell: vectors (n, n, 3) between contacts, see `cell_search_kernels.view_cell`; and its
            angle, radians, below zero if there is no cell.
        domains: (n, w) bit sets of the features left to each contact.
        sizes: (n,) how many.
        kept: (n, w) what is left of them, written in place; it may be the same array.
        kept_sizes: (n,) likewise.

    Returns:
        How many contacts are left without a feature, and how many ways the others have together.
    """
    packed, half_angles, errors, switches, normals, readings = pairs
    between, cell_angle = cell
    n, words = domains.shape
    empty = 0
    completions = 1.0
    for j in range(first, n):
        some = sizes[j]
        if face < 0:
            for w in range(words):
                kept[j, w] = domains[j, w]
        else:
            some = narrow(
                face,
                packed,
                half_angles[face],
                readings[i, j],
                errors[i],
                errors[j],
                switches,
                domains[j],
                kept[j],
            )
            if some and cell_angle >= 0.0:
                some = narrow_in_cell(
                    face,
                    packed,
                    half_angles,
                    normals,
                    between[i, j],
                    readings[i, j, 4],
                    cell_angle,
                    kept[j],
                )
        kept_sizes[j] = some
        if some == 0:
            empty += 1
            if empty > room:
                break
        completions *= max(some, 1)
    return empty, completions
