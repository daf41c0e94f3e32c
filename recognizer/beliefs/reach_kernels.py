"""Compiled reaches of a polytope of small motions: how far it goes, and how far its shadow does.

A polytope is what is left of a box of motions by inequalities. How far it reaches along a direction
is a linear program; how far the shadow on three of the six motions reaches anywhere, several.
"""

from __future__ import annotations

import numpy as np

from ..compiling import borrowing, kernel
from ..poses.simplex_kernels import farther, forget_vertex

CUTS = 24
"""Planes that are cut off the shadow of a polytope; one that takes more counts as too long."""
MOST_CORNERS = 256


@borrowing
def take_needed(rows, limits, count, low, high, columns):
    """Take over the inequalities that not all of a box meets; returns how many they are.

    Args:
        rows: (m, 6) of the inequalities ``rows @ z <= limits``, of which ``count`` count.
        limits: (m,) likewise.
        count: how many.
        low: (6,) the box.
        high: (6,) likewise.
        columns: see `simplex_kernels.farthest`; written in place.
    """
    left = 0
    for r in range(count):
        most = 0.0
        for k in range(6):
            most += max(rows[r, k] * low[k], rows[r, k] * high[k])
        if most > limits[r]:
            for k in range(6):
                columns[k, left] = rows[r, k]
            columns[6, left] = limits[r]
            left += 1
    return left


@kernel
def box_of(axes, columns, count, low, high, space):
    """How far a polytope reaches along directions, there and back.

    Args:
        axes: (k, 6) unit directions.
        columns: see `simplex_kernels.farthest`, as are the others.
        count: likewise.
        low: likewise.
        high: likewise.
        space: likewise.

    Returns:
        (k, 2) the least and the largest step along each.
    """
    objective = np.empty(6)
    found = np.empty((len(axes), 2))
    forget_vertex(space)
    for a in range(len(axes)):
        for side in range(2):
            sign = 2.0 * side - 1.0
            for k in range(6):
                objective[k] = sign * axes[a, k]
            found[a, side] = sign * farther(objective, columns, count, low, high, space)
    return found


@borrowing
def _cut(planes, heights, number, corners, height):
    """Cut a polyhedron with a plane that was added last; how many corners it has then.

    Corners beyond the plane go; those on it are sought among all pairs of the others.

    Args:
        planes: (p, 3) outward directions, of which ``number`` count.
        heights: (p,) of the planes along these.
        number: how many planes there are, the new one included.
        corners: (c, 3) of which ``height`` count; in place.
        height: how many corners there are.
    """
    new = number - 1
    kept = 0
    for c in range(height):
        along = 0.0
        for k in range(3):
            along += planes[new, k] * corners[c, k]
        if along <= heights[new]:
            for k in range(3):
                corners[kept, k] = corners[c, k]
            kept += 1
    a0, a1, a2 = planes[new, 0], planes[new, 1], planes[new, 2]
    for i in range(new):
        b0, b1, b2 = planes[i, 0], planes[i, 1], planes[i, 2]
        x, y, z = a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0
        for j in range(i):
            c0, c1, c2 = planes[j, 0], planes[j, 1], planes[j, 2]
            volume = x * c0 + y * c1 + z * c2
            if abs(volume) < 1e-9:
                continue
            # Cramer's rule, by vector products of the three planes.
            p0, p1, p2 = b1 * c2 - b2 * c1, b2 * c0 - b0 * c2, b0 * c1 - b1 * c0
            q0, q1, q2 = c1 * a2 - c2 * a1, c2 * a0 - c0 * a2, c0 * a1 - c1 * a0
            u = (heights[new] * p0 + heights[i] * q0 + heights[j] * x) / volume
            v = (heights[new] * p1 + heights[i] * q1 + heights[j] * y) / volume
            w = (heights[new] * p2 + heights[i] * q2 + heights[j] * z) / volume
            inside = True
            for k in range(new):
                if k in (i, j):
                    continue
                over = planes[k, 0] * u + planes[k, 1] * v + planes[k, 2] * w - heights[k]
                if over > 1e-9 * abs(heights[k]):
                    inside = False
                    break
            if inside and kept < len(corners):
                corners[kept, 0], corners[kept, 1], corners[kept, 2] = u, v, w
                kept += 1
    return kept


@kernel
def all_within(first, axes, box, allowed, columns, count, low, high, space):
    """Whether three of the six motions together are nowhere longer in a polytope than is allowed.

    The largest length of a convex set's points is sought from outside: its shadow on the three
    motions is held in a polyhedron, whose farthest corner says where to cut next (H. Tuy's outer
    approximation of a convex maximum). Each cut is a linear program: either it reaches beyond what
    is allowed, or it takes that corner away.

    Args:
        first: 0 for rotations, 3 for shifts.
        axes: (3, 3) orthonormal directions among them.
        box: (3, 2) how far the polytope reaches along these.
        allowed: metres.
        columns: see `simplex_kernels.farthest`, as are the others.
        count: likewise.
        low: likewise.
        high: likewise.
        space: likewise.
    """
    for a in range(3):
        if max(-box[a, 0], box[a, 1]) > allowed:
            return False
    planes, heights = np.empty((6 + CUTS, 3)), np.empty(6 + CUTS)
    corners, objective = np.empty((MOST_CORNERS, 3)), np.zeros(6)
    number = 0
    for a in range(3):
        for side in range(2):
            sign = 2.0 * side - 1.0
            for k in range(3):
                planes[number, k] = sign * axes[a, k]
            heights[number] = sign * box[a, side]
            number += 1
    height = 0
    for corner in range(8):
        for k in range(3):
            corners[height, k] = 0.0
            for a in range(3):
                corners[height, k] += axes[a, k] * box[a, (corner >> a) & 1]
        height += 1
    for _ in range(CUTS):
        longest, where = -1.0, -1
        for c in range(height):
            length = 0.0
            for k in range(3):
                length += corners[c, k] * corners[c, k]
            if length > longest:
                longest, where = length, c
        longest = np.sqrt(max(longest, 0.0))
        if longest <= allowed:
            return True
        for k in range(3):
            planes[number, k] = corners[where, k] / longest
            objective[first + k] = planes[number, k]
        heights[number] = farther(objective, columns, count, low, high, space)
        if heights[number] > allowed:
            return False
        number += 1
        height = _cut(planes, heights, number, corners, height)
        if height == len(corners):
            return False
    return False
