"""Compiled cells of rotations: what a contact can lie on if the rotation is known roughly.

Where the normals don't fix the rotation, because they are unknown, pairs of contacts say little.
Within a cell, a ball of rotations, every feature's normal is known in the world up to the
ball's angle, so the component of the vector between two contacts along it prunes as if the normals
had been measured.
"""

from __future__ import annotations

import numpy as np

from ..compiling import borrowing
from ..contacts.reading_kernels import ARC, NO_CONE, UNKNOWN_NORMAL, nearest_in_cone
from .mask_kernels import bit_index

_ONE = np.uint64(1)
_NONE = np.uint64(0)


@borrowing
def facing(normal, chord, sine, angle, model, domain, near):
    """Drop features that no rotation of a cell turns towards a contact's normal.

    Args:
        normal: (3,) measured, turned into the object's frame by the cell's middle.
        chord: bound on it, as a chord.
        sine: the same as a sine.
        angle: the cell's, radians.
        model: see `search_kernels.search_model`.
        domain: (w,) bit set, narrowed in place.
        near: (3,) work space.

    Returns:
        How many features are left.
    """
    cone_start, cone_normals = model[7], model[8]
    count = 0
    for w in range(len(domain)):
        bits = domain[w]
        while bits != _NONE:
            lowest = bits & (~bits + _ONE)
            bits ^= lowest
            if chord < UNKNOWN_NORMAL:
                f = 64 * w + bit_index(lowest)
                kind, miss = nearest_in_cone(
                    normal, cone_normals, cone_start[f], cone_start[f + 1], near
                )
                # A turn moves a unit vector no farther than its chord, and no more than its angle.
                far = miss > chord + 2.0 * np.sin(0.5 * min(angle, np.pi))
                if kind == ARC:
                    far = sine < 1.0 and miss > sine + angle
                if kind != NO_CONE and far:
                    domain[w] ^= lowest
                    continue
            count += 1
    return count


@borrowing
def narrow_in_cell(a, packed, half_angles, normals, between, reach, angle, domain):
    """Drop features of contact j that don't fit contact i on ``a`` in any rotation of a cell.

    Args:
        a: the feature of contact i.
        packed: (f, k, f) see `ranges.pack_tables`.
        half_angles: (f,) of the features' cones; only a fixed normal says something here.
        normals: (f, 3) of the features, object frame.
        between: (3,) contact j less contact i, turned into the object's frame by the cell's middle.
        reach: the sum of both bounds on positions, metres.
        angle: the cell's, radians.
        domain: (w,) bit set, narrowed in place.

    Returns:
        How many features are left.
    """
    d0, d1, d2 = between[0], between[1], between[2]
    length = np.sqrt(d0 * d0 + d1 * d1 + d2 * d2)
    # A turn moves the vector's end by no more than the chord of its arc.
    slack = reach + length * 2.0 * np.sin(0.5 * min(angle, np.pi))
    along = normals[a, 0] * d0 + normals[a, 1] * d1 + normals[a, 2] * d2
    fixed = half_angles[a] == 0.0
    count = 0
    for w in range(len(domain)):
        bits = domain[w]
        while bits != _NONE:
            lowest = bits & (~bits + _ONE)
            bits ^= lowest
            b = 64 * w + bit_index(lowest)
            if fixed and (packed[a, 4, b] > along + slack or packed[a, 5, b] < along - slack):
                domain[w] ^= lowest
                continue
            if half_angles[b] == 0.0:
                back = -(normals[b, 0] * d0 + normals[b, 1] * d1 + normals[b, 2] * d2)
                if packed[a, 6, b] > back + slack or packed[a, 7, b] < back - slack:
                    domain[w] ^= lowest
                    continue
            count += 1
    return count
