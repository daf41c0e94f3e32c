"""Compiled reaches of a polytope of small motions: how far it goes, and how far its shadow does.

A polytope is what is left of a box of motions by inequalities. How far it reaches along a direction
is a linear program; how far the shadow on three of the six motions reaches anywhere, several.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from .compiling import borrowing

PIVOTS = 60
"""The most; the bound of a program that needs more is the one it has by then."""
CUTS = 24
"""Planes that are cut off the shadow of a polytope; one that takes more counts as too long."""
MOST_CORNERS = 256
EXACT = 1e-9
"""By how much a vertex may break an inequality, as a share of the box it is sought in."""


@borrowing
def farthest(objective, rows, limits, count, most, space):
    """How far a polytope reaches along a direction, by the dual simplex method.

    The bound is one by weak duality at every step, so that it holds whenever the method stops.

    Args:
        objective: (6,) the direction.
        rows: (m, 6) of the inequalities, of which ``count`` count.
        limits: (m,) likewise.
        count: how many.
        most: no step along an axis is longer, metres.
        space: active rows (6,), the inverse of their matrix (6, 6), multipliers (6,), a vertex
            (6,), a row's multipliers (6,).

    Returns:
        The reach, metres; minus infinity if the polytope is empty.
    """
    active, inverse, multipliers, vertex, shares = space
    # The box's own rows are count + 2 k for -e_k and count + 2 k + 1 for e_k.
    for k in range(6):
        positive = objective[k] >= 0.0
        active[k] = count + 2 * k + (1 if positive else 0)
        for j in range(6):
            inverse[k, j] = 0.0
        inverse[k, k] = 1.0 if positive else -1.0
        multipliers[k] = abs(objective[k])
    bound = 0.0
    for _ in range(PIVOTS):
        bound = 0.0
        for j in range(6):
            limit = most if active[j] >= count else limits[active[j]]
            bound += max(multipliers[j], 0.0) * limit
            for k in range(6):
                if j == 0:
                    vertex[k] = 0.0
                vertex[k] += inverse[k, j] * limit
        entering, worst = -1, EXACT * most
        for r in range(count):
            excess = -limits[r]
            for k in range(6):
                excess += rows[r, k] * vertex[k]
            if excess > worst:
                entering, worst = r, excess
        for k in range(6):
            if abs(vertex[k]) - most > worst:
                entering = count + 2 * k + (1 if vertex[k] > 0.0 else 0)
                worst = abs(vertex[k]) - most
        if entering < 0:
            return bound
        leaving, ratio = -1, np.inf
        for j in range(6):
            shares[j] = 0.0
            for k in range(6):
                if entering >= count:
                    unit = 1.0 if (entering - count) & 1 else -1.0
                    entry = unit if (entering - count) >> 1 == k else 0.0
                else:
                    entry = rows[entering, k]
                shares[j] += entry * inverse[k, j]
            if shares[j] > 1e-9 and multipliers[j] < ratio * shares[j]:
                leaving, ratio = j, multipliers[j] / shares[j]
        if leaving < 0:
            return -np.inf
        for j in range(6):
            multipliers[j] = ratio if j == leaving else multipliers[j] - ratio * shares[j]
        for k in range(6):
            inverse[k, leaving] /= shares[leaving]
        for j in range(6):
            if j != leaving:
                for k in range(6):
                    inverse[k, j] -= shares[j] * inverse[k, leaving]
        active[leaving] = entering
    return bound


@njit(cache=True)
def simplex_space():
    """Work space for `farthest`."""
    return np.empty(6, np.int64), np.empty((6, 6)), np.empty(6), np.empty(6), np.empty(6)


@njit(cache=True)
def box_of(axes, rows, limits, count, most, space):
    """How far a polytope reaches along directions, there and back.

    Args:
        axes: (k, 6) unit directions.
        rows: see `farthest`, as are the others.
        limits: likewise.
        count: likewise.
        most: likewise.
        space: likewise.

    Returns:
        (k, 2) the least and the largest step along each.
    """
    objective = np.empty(6)
    found = np.empty((len(axes), 2))
    for a in range(len(axes)):
        for side in range(2):
            sign = 2.0 * side - 1.0
            for k in range(6):
                objective[k] = sign * axes[a, k]
            found[a, side] = sign * farthest(objective, rows, limits, count, most, space)
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


@njit(cache=True)
def all_within(first, axes, box, allowed, rows, limits, count, most, space):
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
        rows: see `farthest`, as are the others.
        limits: likewise.
        count: likewise.
        most: likewise.
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
        heights[number] = farthest(objective, rows, limits, count, most, space)
        if heights[number] > allowed:
            return False
        number += 1
        height = _cut(planes, heights, number, corners, height)
        if height == len(corners):
            return False
    return False
