"""Compiled filter of the interpretation tree: can every triangle of contacts be one of its faces'?

Ranges over three faces are computed when they are first asked for and remembered in a hash table:
there are as many triples of faces as a sixth of the cube of their number, most of them never met.
"""

from __future__ import annotations

import numpy as np

from ..compiling import inlined, kernel
from .triple_range_kernels import triple_range


@inlined
def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def _slot(keys, key):
    """Where a key is, or where it would be: open addressing, -1 is free."""
    last = len(keys) - 1
    at = (key * 40503 + (key >> 9)) & last
    while keys[at] != key and keys[at] != -1:
        at = (at + 1) & last
    return at


@kernel
def _roomier(keys, values, most):
    """Twice the room with all that is known in it; or, beyond ``most`` slots, an empty table."""
    if 2 * len(keys) > most:
        return np.full(len(keys), -1, np.int64), np.empty_like(values), 0
    larger = np.full(2 * len(keys), -1, np.int64)
    moved = np.empty((2 * len(keys), 4, 2))
    used = 0
    for k in range(len(keys)):
        if keys[k] >= 0:
            at = _slot(larger, keys[k])
            larger[at] = keys[k]
            moved[at] = values[k]
            used += 1
    return larger, moved, used


@kernel
def measured_triangle(points, reach, out):
    """Ranges of angles and area that three points inside their balls can have.

    Args:
        points: (3, 3) measured, metres.
        reach: (3,) radii, metres.
        out: (4, 2) as of `corner_ranges`; angles may leave [0, pi]. Written in place.
    """
    swing = np.empty(3)
    spread = 0.0
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        d = points[j] - points[i]
        length = np.sqrt(_dot(d, d))
        both = reach[i] + reach[j]
        # Points that may coincide may lie in any direction of each other.
        swing[k] = np.arcsin(both / length) if length > both else np.pi
        # 2 A = p x q + q x r + r x p, each point off by its own bound.
        spread += 0.5 * (reach[k] * length + reach[i] * reach[j])
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        u = points[i] - points[k]
        w = points[j] - points[k]
        across = np.cross(u, w)
        twice = np.sqrt(_dot(across, across))
        angle = np.arctan2(twice, _dot(u, w))
        out[k, 0] = angle - swing[i] - swing[j]
        out[k, 1] = angle + swing[i] + swing[j]
        if k == 0:
            out[3, 0] = 0.5 * twice - spread
            out[3, 1] = 0.5 * twice + spread


@kernel
def filter_triples(
    rows, positions, reach, angles, areas, geometry, dust, most, keys, values, used, terms, keep
):
    """Which interpretations have only triangles that their last contact can be in.

    Args:
        rows: (m, k) a face for each of the first k contacts; triples of earlier ones are known to
            be possible.
        positions: (n, 3) contacts, world, metres.
        reach: (n,) how far off each is, metres.
        angles: whether to look at angles.
        areas: whether to look at areas.
        geometry: corners, start, lifts, axes, inner and outer, as of `triple_range`.
        dust: as of `corner_ranges`.
        most: the most slots of ranges to remember.
        keys: (h,) triples of faces whose ranges are known, -1 for a free slot; h a power of two.
        values: (h, 4, 2) their ranges.
        used: how many slots are taken.
        terms: scratch, as of `corner_ranges`.
        keep: (m,) set to False where a triangle can't be; written in place.

    Returns:
        keys, values and used, with all ranges that were needed.
    """
    corners, start, lifts, axes, inner, outer = geometry
    count = len(start) - 1
    last = rows.shape[1] - 1
    felt = np.empty((4, 2))
    points = np.empty((3, 3))
    radii = np.empty(3)
    for j in range(last):
        for i in range(j):
            points[0], points[1], points[2] = positions[i], positions[j], positions[last]
            radii[0], radii[1], radii[2] = reach[i], reach[j], reach[last]
            measured_triangle(points, radii, felt)
            for m in range(len(rows)):
                if not keep[m]:
                    continue
                a, b, c = rows[m, i], rows[m, j], rows[m, last]
                x, y, z = 0, 1, 2
                if a > b:
                    a, b, x, y = b, a, y, x
                if b > c:
                    b, c, y, z = c, b, z, y
                if a > b:
                    a, b, x, y = b, a, y, x
                key = (np.int64(a) * count + b) * count + c
                at = _slot(keys, key)
                if keys[at] < 0:
                    if 2 * used >= len(keys):
                        keys, values, used = _roomier(keys, values, most)
                        at = _slot(keys, key)
                    keys[at] = key
                    used += 1
                    triple_range(
                        corners,
                        start,
                        lifts,
                        axes,
                        inner,
                        outer,
                        (a, b, c),
                        dust,
                        terms,
                        values[at],
                    )
                known = values[at]
                if areas and (felt[3, 1] < known[3, 0] or felt[3, 0] > known[3, 1]):
                    keep[m] = False
                if angles and (
                    felt[x, 1] < known[0, 0]
                    or felt[x, 0] > known[0, 1]
                    or felt[y, 1] < known[1, 0]
                    or felt[y, 0] > known[1, 1]
                    or felt[z, 1] < known[2, 0]
                    or felt[z, 0] > known[2, 1]
                ):
                    keep[m] = False
    return keys, values, used
