"""Compiled geometry of boxes of rotations: their middles, and what contacts can be on in them."""

from __future__ import annotations

import numpy as np

from ..compiling import borrowing
from .rows_kernels import extent

SPARE = 1e-9
"""By how much slabs may miss each other, in radii: rounding."""
OPPOSITE = -0.9
"""A trace of rotations about half a turn apart: their Gibbs vector is none."""


@borrowing
def cayley(g, rotation):
    """The rotation (3, 3) of a Gibbs vector, axis times tangent of half the angle, in place."""
    x, y, z = g[0], g[1], g[2]
    scale = 2.0 / (1.0 + x * x + y * y + z * z)
    rotation[0, 0] = 1.0 - scale * (y * y + z * z)
    rotation[1, 1] = 1.0 - scale * (x * x + z * z)
    rotation[2, 2] = 1.0 - scale * (x * x + y * y)
    rotation[0, 1], rotation[1, 0] = scale * (x * y - z), scale * (x * y + z)
    rotation[0, 2], rotation[2, 0] = scale * (x * z + y), scale * (x * z - y)
    rotation[1, 2], rotation[2, 1] = scale * (y * z - x), scale * (y * z + x)


@borrowing
def turn_chart(g, chart, turn, rotation):
    """The rotation (3, 3) that a Gibbs vector from a chart leads to, in place; ``turn`` is work."""
    cayley(g, turn)
    for a in range(3):
        for b in range(3):
            rotation[a, b] = chart[a, 0] * turn[0, b] + chart[a, 1] * turn[1, b]
            rotation[a, b] += chart[a, 2] * turn[2, b]


@borrowing
def shift_of(rotation, translation, mean, radius, inverse, shift):
    """A pose, object to world, as its inverse rotation and the contacts' mean in its frame."""
    for a in range(3):
        shift[a] = 0.0
        for b in range(3):
            inverse[a, b] = rotation[b, a]
            shift[a] += rotation[b, a] * (mean[b] - translation[b]) / radius


@borrowing
def gibbs_between(first, second, g):
    """The Gibbs vector of the turn from one rotation (3, 3) to another; False if it has none."""
    trace = 0.0
    for a in range(3):
        for b in range(3):
            trace += first[a, b] * second[a, b]
    if trace <= OPPOSITE:
        return False
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        g[k] = 0.0
        # first^T second, its parts at (j, i) and (i, j).
        for b in range(3):
            g[k] += first[b, j] * second[b, i] - first[b, i] * second[b, j]
        g[k] /= 1.0 + trace
    return True


@borrowing
def recentre(chart, low, high, turn, half, middle):
    """A box of rotations about its own middle.

    Changing the centre is projective, so the images of the corners bound that of the box:
    ``Cay(g) = Cay(c) Cay(g')`` with ``g' = (g - c + g x c) / (1 + g . c)``.

    Args:
        chart: (3, 3) world to object, of the Gibbs vector zero.
        low: (3,) Gibbs vectors.
        high: (3,) likewise.
        turn: (3, 3) work space.
        half: (3,) half sides of the turns ``w = 2 g'`` about the middle, written in place.
        middle: (3, 3) world to object, written in place.

    Returns:
        The largest of these turns, radians.
    """
    c0, c1, c2 = 0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), 0.5 * (low[2] + high[2])
    turn_chart((c0, c1, c2), chart, turn, middle)
    half[0] = half[1] = half[2] = 0.0
    longest = 0.0
    for corner in range(8):
        g0 = high[0] if corner & 1 else low[0]
        g1 = high[1] if corner & 2 else low[1]
        g2 = high[2] if corner & 4 else low[2]
        scale = 1.0 / (1.0 + g0 * c0 + g1 * c1 + g2 * c2)
        e0 = scale * (g0 - c0 + (g1 * c2 - g2 * c1))
        e1 = scale * (g1 - c1 + (g2 * c0 - g0 * c2))
        e2 = scale * (g2 - c2 + (g0 * c1 - g1 * c0))
        half[0], half[1], half[2] = (
            max(half[0], abs(e0)),
            max(half[1], abs(e1)),
            max(half[2], abs(e2)),
        )
        # Each corner's own length: the image is inside their hull, and length is convex.
        longest = max(longest, e0 * e0 + e1 * e1 + e2 * e2)
    for k in range(3):
        half[k] = 2.0 * half[k] * (1.0 + 1e-12)
    return 2.0 * np.arctan(np.sqrt(longest)) * (1.0 + 1e-12)


@borrowing
def turn_back(rotation, vectors, turned):
    """Turn (n, 3) vectors by the inverse of a rotation, into (n, 3)."""
    for i in range(len(vectors)):
        for k in range(3):
            turned[i, k] = (
                rotation[0, k] * vectors[i, 0]
                + rotation[1, k] * vectors[i, 1]
                + rotation[2, k] * vectors[i, 2]
            )


@borrowing
def turn_all(rotation, vectors, turned):
    """Turn (n, 3) vectors by a rotation, into (n, 3)."""
    for i in range(len(vectors)):
        for k in range(3):
            turned[i, k] = (
                rotation[k, 0] * vectors[i, 0]
                + rotation[k, 1] * vectors[i, 1]
                + rotation[k, 2] * vectors[i, 2]
            )


@borrowing
def set_ways(arms, directions, half, angle, ways):
    """The extent of each arm along each turned direction in a box, (n, d, 2) in place."""
    for i in range(len(arms)):
        for k in range(len(directions)):
            least, most = extent(arms[i], directions[k], half, angle)
            ways[i, k, 0], ways[i, k, 1] = least, most


@borrowing
def facing(normal, error, angle, feature, shape):
    """Whether some turn of no more than an angle brings a normal within its bound of a cone."""
    wide = error + angle + shape.half_angles[feature]
    if wide < np.pi:
        m = shape.normals[feature]
        if m[0] * normal[0] + m[1] * normal[1] + m[2] * normal[2] < np.cos(wide) - SPARE:
            return False
    if shape.half_angles[feature] > 0.0 and error + angle < 0.5 * np.pi:
        sine = np.sin(error + angle) + SPARE
        for k in range(shape.cone_start[feature], shape.cone_start[feature + 1]):
            m = shape.cone_sides[k]
            if m[0] * normal[0] + m[1] * normal[1] + m[2] * normal[2] > sine:
                return False
    return True


@borrowing
def fits_room(way, reach, slab, room, hull):
    """Whether a contact on a feature leaves the shift room, and what; (d, 2) ``hull`` grows by it.

    Args:
        way: (d, 2) extents of the contact's arm.
        reach: bound on its place.
        slab: (d, 2) of the feature.
        room: (d, 2) of the shift.
        hull: (d, 2) of what the contact's features leave, together.
    """
    margin = reach + SPARE
    for k in range(len(room)):
        if (
            slab[k, 0] - way[k, 1] - margin > room[k, 1]
            or slab[k, 1] - way[k, 0] + margin < room[k, 0]
        ):
            return False
    for k in range(len(room)):
        hull[k, 0] = min(hull[k, 0], slab[k, 0] - way[k, 1] - margin)
        hull[k, 1] = max(hull[k, 1], slab[k, 1] - way[k, 0] + margin)
    return True
