"""Compiled places of contacts that are bounded on both sides, as rows of a linear system.

A place is that of a contact along a direction. A small motion ``z = (w, s)`` lowers it by
``w . (a x d) + s . d``, up to the remainder that a turn adds (see `region_kernels`).
"""

from __future__ import annotations

import numpy as np

from ...compiling import borrowing, kernel, vectorised
from ...models.polygon_kernels import INSIDE


@kernel
def place_table(count):
    """Room for so many places.

    Returns:
        (m, 6) how motions lower each; (10, m) of each the first three of these, its direction, its
        lever, and the lever along the direction; (6, m) its value, its bound, its weight, its bound
        widened by the remainder, and where it is beyond an edge, the excess and its least possible
        value, else zeros.
    """
    return np.empty((count, 6)), np.empty((10, count)), np.empty((6, count))


@borrowing
def _add_row(lever, direction, value, limit, at, table):
    """Note a place along a direction."""
    rows, columns, numbers = table
    a0, a1, a2 = lever[0], lever[1], lever[2]
    d0, d1, d2 = direction
    rows[at, 0] = a1 * d2 - a2 * d1
    rows[at, 1] = a2 * d0 - a0 * d2
    rows[at, 2] = a0 * d1 - a1 * d0
    rows[at, 3], rows[at, 4], rows[at, 5] = d0, d1, d2
    for k in range(6):
        columns[k, at] = rows[at, k]
    columns[6, at], columns[7, at], columns[8, at] = a0, a1, a2
    columns[9, at] = a0 * d0 + a1 * d1 + a2 * d2
    numbers[0, at] = value
    numbers[1, at] = limit
    numbers[2, at] = 1.0
    numbers[4, at] = 0.0
    numbers[5, at] = 0.0


@borrowing
def note_places(count, faces, targets, x, levers, model, reaches, readings, table):
    """Note the places of an interpretation; returns how many.

    The height over the face's plane, whatever of the face is nearest; and, for a contact that lies
    outside it, the place along the gap, which the face bounds ahead and behind.

    Args:
        count: how many contacts count.
        faces: (n,) the feature of each, -1 for none.
        targets: (n,) the polygon that stands for it.
        x: (n, 3) contacts, object frame, metres.
        levers: (n, 3) contacts less the pivot.
        model: see `pose.ModelTest`.
        reaches: (n,) bounds on distances, metres.
        readings: see `reading_kernels.read`.
        table: see `place_table`; written in place.
    """
    normals, start, corners = model[0], model[3], model[4]
    gaps, _, heights, regions, _, _, _ = readings
    used = 0
    for i in range(count):
        f = faces[i]
        if f < 0:
            continue
        m = (normals[f, 0], normals[f, 1], normals[f, 2])
        _add_row(levers[i], m, heights[i], reaches[i], used, table)
        used += 1
        if regions[i] == INSIDE:
            continue
        d0 = gaps[i, 0] - heights[i] * normals[f, 0]
        d1 = gaps[i, 1] - heights[i] * normals[f, 1]
        d2 = gaps[i, 2] - heights[i] * normals[f, 2]
        out = np.sqrt(d0 * d0 + d1 * d1 + d2 * d2)
        if out < 0.5 * reaches[i]:
            continue
        d0, d1, d2 = d0 / out, d1 / out, d2 / out
        most = d0 * (x[i, 0] - gaps[i, 0])
        most += d1 * (x[i, 1] - gaps[i, 1])
        most += d2 * (x[i, 2] - gaps[i, 2])
        least = most
        for c in range(start[targets[i]], start[targets[i] + 1]):
            along = d0 * corners[c, 0] + d1 * corners[c, 1] + d2 * corners[c, 2]
            least = min(least, along)
        half = 0.5 * (most - least)
        _add_row(levers[i], (d0, d1, d2), half + out, half + reaches[i], used, table)
        table[2][4, used] = out - reaches[i]
        table[2][5, used] = -2.0 * (half + reaches[i])
        used += 1
    return used


@vectorised
def widen_places(used, table, root, angle):
    """Widen each bound by the remainder of a region's turns: see `region_kernels.remainder`.

    Args:
        used: how many places there are.
        table: see `place_table`.
        root: (3, 3) lower L; the region's ``w`` are ``L v`` with ``|v| <= 1``.
        angle: bounds |w|, radians.
    """
    _, columns, numbers = table
    l00, l10, l11 = root[0, 0], root[1, 0], root[1, 1]
    l20, l21, l22 = root[2, 0], root[2, 1], root[2, 2]
    g00, g11, g22 = l00 * l00 + l10 * l10 + l20 * l20, l11 * l11 + l21 * l21, l22 * l22
    g01, g02, g12 = l10 * l11 + l20 * l21, l20 * l22, l21 * l22
    third = angle * angle / 6.0
    for r in range(used):
        d0, d1, d2 = columns[3, r], columns[4, r], columns[5, r]
        a0, a1, a2 = columns[6, r], columns[7, r], columns[8, r]
        p0, p1, p2 = l00 * a0 + l10 * a1 + l20 * a2, l11 * a1 + l21 * a2, l22 * a2
        q0, q1, q2 = l00 * d0 + l10 * d1 + l20 * d2, l11 * d1 + l21 * d2, l22 * d2
        c0, c1, c2 = columns[0, r], columns[1, r], columns[2, r]
        t0, t1, t2 = l00 * c0 + l10 * c1 + l20 * c2, l11 * c1 + l21 * c2, l22 * c2
        along = columns[9, r]
        f00, f11, f22 = p0 * q0 - along * g00, p1 * q1 - along * g11, p2 * q2 - along * g22
        f01 = 0.5 * (p0 * q1 + p1 * q0) - along * g01
        f02 = 0.5 * (p0 * q2 + p2 * q0) - along * g02
        f12 = 0.5 * (p1 * q2 + p2 * q1) - along * g12
        squares = f00 * f00 + f11 * f11 + f22 * f22
        bent = np.sqrt(squares + 2.0 * (f01 * f01 + f02 * f02 + f12 * f12))
        linear = np.sqrt(t0 * t0 + t1 * t1 + t2 * t2)
        numbers[3, r] = numbers[1, r] + 0.5 * bent + third * linear


@borrowing
def add_places(used, table, system, slope):
    """Add the weighted squares of the places, in their widened bounds, to a form over motions.

    Args:
        used: how many places there are.
        table: see `place_table`.
        system: (6, 6) of the form, added to in place.
        slope: (6,) likewise.

    Returns:
        What the squares may have together beyond what they have at the pose itself.
    """
    rows, _, numbers = table
    allowed = 0.0
    for r in range(used):
        weight, wide = numbers[2, r], numbers[3, r]
        value = numbers[0, r] / wide
        # In a bound widened by its remainder, a place adds at most its weight.
        allowed += weight * (1.0 - value * value)
        share = weight / (wide * wide)
        pull = weight * value / wide
        r0, r1, r2 = rows[r, 0], rows[r, 1], rows[r, 2]
        r3, r4, r5 = rows[r, 3], rows[r, 4], rows[r, 5]
        slope[0] -= pull * r0
        slope[1] -= pull * r1
        slope[2] -= pull * r2
        slope[3] -= pull * r3
        slope[4] -= pull * r4
        slope[5] -= pull * r5
        # Whole rows: the compiler takes them several numbers at a time.
        for a in range(6):
            part = share * rows[r, a]
            system[a, 0] += part * r0
            system[a, 1] += part * r1
            system[a, 2] += part * r2
            system[a, 3] += part * r3
            system[a, 4] += part * r4
            system[a, 5] += part * r5
    return allowed


@borrowing
def narrow_places(used, table, centre, inverse):
    """Bound places beyond an edge from behind too, by how far the region lets them come back.

    Returns:
        Whether every one can come back inside at all.
    """
    rows, _, numbers = table
    for r in range(used):
        if numbers[5, r] == 0.0:
            continue
        mean = 0.0
        square = 0.0
        for a in range(6):
            mean += rows[r, a] * centre[a]
            for b in range(6):
                square += rows[r, a] * inverse[a, b] * rows[r, b]
        rest = numbers[3, r] - numbers[1, r]
        least = numbers[4, r] - mean - np.sqrt(max(square, 0.0)) - rest
        if least > 0.0:
            return False
        if least > numbers[5, r]:
            numbers[5, r] = min(least, -1e-12)
            numbers[0, r] = numbers[4, r] - 0.5 * numbers[5, r]
            numbers[1, r] = -0.5 * numbers[5, r]
    return True


@vectorised
def raise_places(used, table, middle):
    """Count each place by how large the fit of a round leaves it.

    Args:
        used: how many places there are.
        table: see `place_table`.
        middle: (6,) the fit's motion.
    """
    _, columns, numbers = table
    w0, w1, w2, s0, s1, s2 = middle[0], middle[1], middle[2], middle[3], middle[4], middle[5]
    for r in range(used):
        value = numbers[0, r] - columns[0, r] * w0 - columns[1, r] * w1 - columns[2, r] * w2
        value -= columns[3, r] * s0 + columns[4, r] * s1 + columns[5, r] * s2
        numbers[2, r] *= min(abs(value) / numbers[3, r], 10.0) + 0.05
