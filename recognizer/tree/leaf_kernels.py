"""Compiled list of the interpretations found, and a hash table of its rows to look them up."""

from __future__ import annotations

import numpy as np

from ..compiling import borrowing, kernel

SPARSE = 4
"""Places of the table for each row that there is room for."""
_START = np.uint64(0xCBF29CE484222325)
_FACTOR = np.uint64(0x100000001B3)
_HALF = np.uint64(32)


@borrowing
def place_of(faces, found_faces, slots):
    """Where an interpretation stands in a table, or the empty place where it would.

    Hashed a feature at a time as FNV-1a does bytes; the next places are tried in turn.

    Args:
        faces: (n,) the feature of each contact, -1 for none.
        found_faces: (m, n) the rows that a table refers to.
        slots: (s,) the row at each place, -1 at an empty one; s a power of two, more than the rows.
    """
    code = _START
    for f in faces:
        code = (code ^ np.uint64(f + 1)) * _FACTOR
    last = len(slots) - 1
    at = np.int64((code ^ (code >> _HALF)) & np.uint64(last))
    while slots[at] >= 0:
        row = slots[at]
        same = True
        for i in range(len(faces)):
            if found_faces[row, i] != faces[i]:
                same = False
                break
        if same:
            break
        at = (at + 1) & last
    return at


@kernel
def table_of(found_faces, found):
    """The table of the first ``found`` rows of those that there is room for, a power of two."""
    slots = np.full(SPARSE * len(found_faces), -1)
    for row in range(found):
        slots[place_of(found_faces[row], found_faces, slots)] = row
    return slots


@kernel
def found_space(most, n):
    """Room for so many interpretations of n contacts.

    Returns:
        (m, n) features; (m, 3, 3) rotations and (m, 3) translations; (m,) misfits; (m, 6, 6)
        informations; (m,) whether the pose is a witness.
    """
    return (
        np.empty((most, n), np.int32),
        np.empty((most, 3, 3)),
        np.empty((most, 3)),
        np.empty(most),
        np.empty((most, 6, 6)),
        np.empty(most, np.bool_),
    )


@kernel
def with_room(found):
    """The same interpretations with room for as many again."""
    most, n = found[0].shape
    larger = found_space(2 * most, n)
    larger[0][:most] = found[0]
    larger[1][:most] = found[1]
    larger[2][:most] = found[2]
    larger[3][:most] = found[3]
    larger[4][:most] = found[4]
    larger[5][:most] = found[5]
    return larger
