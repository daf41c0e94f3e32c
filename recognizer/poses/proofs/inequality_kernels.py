"""Compiled inequalities: what bounds on contacts ask of the small motions in a box.

A motion ``z = (v, s)`` is a turn about the contacts' mean and a shift, as in `region_kernels`, but
along the axes of a box and with shifts in radii of the object, so that all six are about radians. A
bound on a place or a normal is linear in it up to a remainder, which the box bounds on the side
that matters: so an inequality holds for every motion of the box that leads to a pose within the
bounds.
"""

from __future__ import annotations

import numpy as np

from ...compiling import borrowing
from ...contacts.reading_kernels import UNKNOWN_NORMAL
from ..motions.motion_kernels import cross, perpendicular

TANGENTS = 8
"""Half-planes about a cone of normals."""
ROUNDING = 1e-9
"""Room for rounding, radians and radii: a million times what a sum of six products loses."""


@borrowing
def least_bend(a, m, box):
    """The least that a turn by some ``w`` of a box adds to ``m . (a - w x a)``.

    By Rodrigues the end of a lever ``a`` goes to ``a - sinc t (w x a) + k w x (w x a)`` with k from
    ``(1 - t^2 / 12) / 2`` to a half, ``t = |w|``. All in the box's axes.

    Args:
        a: (3,) lever.
        m: (3,) direction.
        box: (6,) low, (6,) high, and a bound on the square of its turns.
    """
    low, high, square = box
    along = a[0] * m[0] + a[1] * m[1] + a[2] * m[2]
    total = 0.0
    for k in range(3):
        form = a[k] * m[k] - along
        least, most = low[k], high[k]
        far = max(least * least, most * most)
        near = 0.0 if least <= 0.0 <= most else min(least * least, most * most)
        total += min(form * near, form * far)
        for i in range(k):
            form = a[k] * m[i] + a[i] * m[k]
            one, two = form * least * low[i], form * least * high[i]
            three, four = form * most * low[i], form * most * high[i]
            total += min(min(one, two), min(three, four))
    total *= 0.5 if total < 0.0 else 0.5 * max(0.0, 1.0 - square / 12.0)
    c0, c1, c2 = a[1] * m[2] - a[2] * m[1], a[2] * m[0] - a[0] * m[2], a[0] * m[1] - a[1] * m[0]
    linear = abs(c0) * max(-low[0], high[0]) + abs(c1) * max(-low[1], high[1])
    linear += abs(c2) * max(-low[2], high[2])
    return total - square / 6.0 * linear


@borrowing
def _add(a, m, shifts, room, box, used, table):
    """Ask that a motion adds no more than ``room`` to ``m . a``, unless all of the box does so.

    Args:
        a: (3,) a lever, in radii, or a unit vector; in the box's axes.
        m: (3,) unit direction, likewise.
        shifts: whether shifts move it.
        room: how much.
        box: (6,) low, (6,) high, and a bound on the square of its turns.
        used: how many inequalities there are.
        table: (7, r) of each inequality its row and its limit.

    Returns:
        How many there are then.
    """
    low, high, _ = box
    if used == table.shape[1]:
        return used
    table[0, used] = a[2] * m[1] - a[1] * m[2]
    table[1, used] = a[0] * m[2] - a[2] * m[0]
    table[2, used] = a[1] * m[0] - a[0] * m[1]
    for k in range(3):
        table[3 + k, used] = -m[k] if shifts else 0.0
    most = 0.0
    for k in range(6):
        most += max(table[k, used] * low[k], table[k, used] * high[k])
    if most <= room:
        return used
    room -= least_bend(a, m, box)
    if most <= room:
        return used
    table[6, used] = room + ROUNDING
    return used + 1


@borrowing
def to_axes(axes, vector, scale, out):
    """A vector's components along axes, times a number, into (3,) ``out``."""
    for k in range(3):
        out[k] = scale * (axes[0, k] * vector[0] + axes[1, k] * vector[1] + axes[2, k] * vector[2])


@borrowing
def _edge_normal(corners, first, last, c, normal, out):
    """The outward direction, in the plane of a polygon, across its edge from corner ``c``."""
    after = c + 1 if c + 1 < last else first
    s0 = corners[after, 0] - corners[c, 0]
    s1 = corners[after, 1] - corners[c, 1]
    s2 = corners[after, 2] - corners[c, 2]
    out[0] = s1 * normal[2] - s2 * normal[1]
    out[1] = s2 * normal[0] - s0 * normal[2]
    out[2] = s0 * normal[1] - s1 * normal[0]
    length = np.sqrt(out[0] ** 2 + out[1] ** 2 + out[2] ** 2)
    for k in range(3):
        out[k] /= length


@borrowing
def _lean(u, m, cosine, lean, across):
    """Two unit directions across a normal, the first where another unit vector leans from it."""
    length = 0.0
    for k in range(3):
        lean[k] = u[k] - cosine * m[k]
        length += lean[k] ** 2
    if length < 1e-12:
        lean[0], lean[1], lean[2] = perpendicular(m[0], m[1], m[2])
        length = 1.0
    for k in range(3):
        lean[k] /= np.sqrt(length)
    cross(m, lean, across)


@borrowing
def add_contact(contact, f, polygon, model, bounds, axes, box, used, table, space):
    """What the bounds on one contact ask of the motions in a box, if it is on a feature.

    Its place is within its bound of the polygon, so of the polygon's support along any direction:
    that of the plane, there and back, and those across the edges; of an edge or a point, the
    coordinate axes. Its normal is within a chord of the face's, so within half-planes about it.
    What cones of more than one normal ask is left out.

    Args:
        contact: its place (3,), metres, its lever (3,) and its measured normal (3,), object frame.
        f: the feature.
        polygon: the polygon that stands for it.
        model: see `pose.ModelTest`.
        bounds: on the distance, metres, on the chord and on the sine (see there).
        axes: (3, 3) columns, right-handed, object frame.
        box: (6,) low, (6,) high, and a bound on the square of its turns.
        used: how many inequalities there are.
        table: (7, r) of each inequality its row and its limit, written in place; what finds no
            room is left out.
        space: five (3,) vectors.

    Returns:
        How many there are then.
    """
    normals, start, corners, radius, cone_start = model[0], model[3], model[4], model[6], model[7]
    x, arm, u = contact
    reach, chord, sine = bounds
    lever, direction, side, lean, across = space
    m = normals[f]
    first, last = start[polygon], start[polygon + 1]
    flat = last - first > 2
    to_axes(axes, arm, 1.0 / radius, lever)
    for number in range(last - first + 2 if flat else 6):
        for k in range(3):
            side[k] = 0.0
        if not flat:
            side[number >> 1] = 1.0 if number & 1 else -1.0
        elif number < 2:
            for k in range(3):
                side[k] = m[k] if number == 1 else -m[k]
        else:
            _edge_normal(corners, first, last, first + number - 2, m, side)
        most = -np.inf
        for c in range(first, last):
            along = side[0] * corners[c, 0] + side[1] * corners[c, 1] + side[2] * corners[c, 2]
            most = max(most, along)
        room = most + reach - (side[0] * x[0] + side[1] * x[1] + side[2] * x[2])
        to_axes(axes, side, 1.0, direction)
        used = _add(lever, direction, True, room / radius, box, used, table)
    if chord >= UNKNOWN_NORMAL or cone_start[f + 1] - cone_start[f] > 1:
        return used
    to_axes(axes, u, 1.0, lever)
    to_axes(axes, m, -1.0, direction)
    cosine = m[0] * u[0] + m[1] * u[1] + m[2] * u[2]
    # |u - m|^2 = 2 - 2 u . m
    used = _add(lever, direction, False, cosine - 1.0 + 0.5 * chord * chord, box, used, table)
    if sine >= 1.0:
        return used
    for k in range(3):
        direction[k] = -direction[k]
    _lean(lever, direction, cosine, lean, across)
    for tangent in range(TANGENTS):
        angle = 2.0 * np.pi * tangent / TANGENTS
        along = 0.0
        for k in range(3):
            side[k] = np.cos(angle) * lean[k] + np.sin(angle) * across[k]
            along += side[k] * lever[k]
        used = _add(lever, side, False, sine - along, box, used, table)
    return used
