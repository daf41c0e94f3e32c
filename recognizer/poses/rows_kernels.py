"""Compiled rows: what a touch asks of the poses in a box, as linear inequalities.

A pose is ``Q``, world to object, and a shift ``s``, so that a point ``p`` (about the contacts'
mean) is at ``Q p + s`` in the object's frame. A box is a middle rotation, and about it the turns
``Cay(w / 2)`` with ``|w_k| <= half_k`` (Cayley's map: twice the Gibbs vector is about a rotation
vector), and shifts within limits. Turns come before the middle, ``Q = Q_mid Cay(w / 2)``, so that
a box is along the axes of the world, where the contacts are. Whatever is asked is of the form
``m . (Q a + s) <= limit``; with ``n``, which is ``m`` turned back by the middle, it is
``n . a + w . (a x n) + r + m . s <= limit``, where ``r`` is what linearising leaves out, and the
row gives up the least that ``r`` can be in the box.
"""

from __future__ import annotations

import numpy as np

from ..compiling import borrowing

ROUNDING = 1e-10
"""Room for rounding, in radii or radians: a hundred thousand times what a sum of six products of
numbers about one loses."""


@borrowing
def remainder(a, m, half):
    """The least and the most that linearising leaves out of ``m . Cay(w / 2) a`` in a box.

    ``Cay(w / 2) a = a + c (w x a + w x (w x a) / 2)`` with ``c = 1 / (1 + |w|^2 / 4)``; what is
    quadratic is ``sum_k w_k^2 (a_k m_k - a . m) + sum_{i < k} w_i w_k (a_i m_k + a_k m_i)``.

    Args:
        a: (3,)
        m: (3,) direction, turned back by the middle rotation.
        half: (3,) half sides of the box.
    """
    h0, h1, h2 = half[0], half[1], half[2]
    p0, p1, p2 = a[0] * m[0], a[1] * m[1], a[2] * m[2]
    along = p0 + p1 + p2
    d0, d1, d2 = (p0 - along) * h0 * h0, (p1 - along) * h1 * h1, (p2 - along) * h2 * h2
    off = abs(a[0] * m[1] + a[1] * m[0]) * h0 * h1
    off += abs(a[0] * m[2] + a[2] * m[0]) * h0 * h2 + abs(a[1] * m[2] + a[2] * m[1]) * h1 * h2
    linear = abs(a[1] * m[2] - a[2] * m[1]) * h0 + abs(a[2] * m[0] - a[0] * m[2]) * h1
    linear += abs(a[0] * m[1] - a[1] * m[0]) * h2
    square = 0.25 * (h0 * h0 + h1 * h1 + h2 * h2)
    linear *= square / (1.0 + square)
    least = min(d0, 0.0) + min(d1, 0.0) + min(d2, 0.0) - off
    most = max(d0, 0.0) + max(d1, 0.0) + max(d2, 0.0) + off
    return 0.5 * least - linear, 0.5 * most + linear


@borrowing
def extent(a, m, half, angle):
    """The least and the most of ``m . Q a`` over the rotations of a box.

    Args:
        a: (3,)
        m: (3,) unit direction, turned back by the middle rotation.
        half: (3,) half sides of the box.
        angle: the largest of its turns, radians.
    """
    along = a[0] * m[0] + a[1] * m[1] + a[2] * m[2]
    if angle < 1.0:
        linear = abs(a[1] * m[2] - a[2] * m[1]) * half[0] + abs(a[2] * m[0] - a[0] * m[2]) * half[1]
        linear += abs(a[0] * m[1] - a[1] * m[0]) * half[2]
        least, most = remainder(a, m, half)
        return along - linear + least, along + linear + most
    length = np.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])
    if angle >= np.pi:
        return -length, length
    cosine = np.cos(angle)
    across = np.sin(angle) * np.sqrt(max(length * length - along * along, 0.0))
    least = -length if along <= -cosine * length else along * cosine - across
    most = length if along >= cosine * length else along * cosine + across
    return least, most


@borrowing
def add_row(a, m, along, limit, work, used):
    """Ask that ``m . Q a + along . s`` is at most ``limit``.

    Left out if the box (``middle``, ``half``, ``low``, ``high`` of `work_space.Work`) implies it.

    Returns:
        How many rows there are then.
    """
    low, high, columns, q = work.low, work.high, work.columns, work.middle
    n0 = q[0, 0] * m[0] + q[1, 0] * m[1] + q[2, 0] * m[2]
    n1 = q[0, 1] * m[0] + q[1, 1] * m[1] + q[2, 1] * m[2]
    n2 = q[0, 2] * m[0] + q[1, 2] * m[1] + q[2, 2] * m[2]
    c0, c1, c2 = a[1] * n2 - a[2] * n1, a[2] * n0 - a[0] * n2, a[0] * n1 - a[1] * n0
    here = a[0] * n0 + a[1] * n1 + a[2] * n2
    most = max(c0 * low[0], c0 * high[0]) + max(c1 * low[1], c1 * high[1])
    most += max(c2 * low[2], c2 * high[2])
    for k in range(3):
        # Shifts may have no limits yet.
        if along[k] != 0.0:
            most += max(along[k] * low[3 + k], along[k] * high[3 + k])
    room = limit - here + ROUNDING
    if most <= room or used == columns.shape[1]:
        return used
    least, _ = remainder(a, (n0, n1, n2), work.half)
    room -= least
    if most <= room:
        return used
    columns[0, used], columns[1, used], columns[2, used] = c0, c1, c2
    for k in range(3):
        columns[3 + k, used] = along[k]
    columns[6, used] = room
    return used + 1


@borrowing
def contact_rows(i, feature, polygon, shape, touches, work, used):
    """What one contact on a feature asks of the poses in a box.

    Its place is within its bound of the polygon, so of each half-space that holds the polygon. Its
    normal is within its bound of the feature's cone: of a face's normal, and so are its parts
    across it; of an edge's or a vertex's cone, which is within its half angle of its middle.

    Args:
        i: the contact.
        feature: what it is on.
        polygon: the polygon that stands for it.
        shape: see `shape.Shape`.
        touches: see `shape.Touches`.
        work: see `work_space.Work`: the box, and ``columns``, written in place.
        used: how many rows there are.

    Returns:
        How many there are then; what finds no room is left out.
    """
    arm, normal = touches.arms[i], touches.normals[i]
    reach, error = touches.reaches[i], touches.errors[i]
    for side in range(shape.side_start[polygon], shape.side_start[polygon + 1]):
        m = shape.sides[side]
        used = add_row(arm, m, m, shape.limits[side] + reach, work, used)
    # The other way round, so that all rows are bounds from above.
    back = work.lever
    for k in range(3):
        back[k] = -shape.normals[feature, k]
    wide = error + shape.half_angles[feature]
    if wide < np.pi:
        used = add_row(normal, back, work.still, -np.cos(wide), work, used)
    wide = touches.front_errors[i] + shape.half_angles[feature]
    if wide < np.pi:
        used = add_row(touches.fronts[i], back, work.still, -np.cos(wide), work, used)
    if error < 0.5 * np.pi:
        sine = np.sin(error)
        for k in range(shape.cone_start[feature], shape.cone_start[feature + 1]):
            used = add_row(normal, shape.cone_sides[k], work.still, sine, work, used)
    return used


@borrowing
def support_rows(foot, known, radius, work, used):
    """What a support asks of the poses in a box: that corners are above or below a height.

    About the contacts' mean the height of a corner ``v`` is ``Q up . (v - s)``. What that has of
    both a turn and a shift is no more than the chord of the one times the length of the other.

    Args:
        foot: the face that the object stands on, -1 if that isn't known.
        known: see `known.Known`.
        radius: metres.
        work: see `work_space.Work`: the box, and ``columns``, written in place.
        used: how many rows there are.

    Returns:
        How many there are then.
    """
    up, q, lever, slope = known.up, work.middle, work.lever, work.slope
    square, apart, base, here = 0.0, 0.0, 0.0, 0.0
    for k in range(3):
        square += work.half[k] * work.half[k]
        apart += (0.5 * (work.high[3 + k] - work.low[3 + k])) ** 2
        base += up[k] * work.mean[k]
        here += (
            (q[k, 0] * up[0] + q[k, 1] * up[1] + q[k, 2] * up[2])
            * 0.5
            * (work.high[3 + k] + work.low[3 + k])
        )
    bend = np.sqrt(square / (1.0 + 0.25 * square) * apart)
    if not bend < np.inf:
        return used
    count = len(known.corners)
    first, last = (known.foot_start[foot], known.foot_start[foot + 1]) if foot >= 0 else (0, 0)
    for v in range(count + last - first):
        corner = known.corners[v] if v < count else known.feet[first + v - count]
        sign = known.signs[v] if v < count else -1.0
        limit = known.limits[v] if v < count else known.ceiling
        for k in range(3):
            middle = 0.5 * (work.high[3 + k] + work.low[3 + k])
            lever[k] = -sign * (corner[k] / radius - middle)
            slope[k] = sign * (q[k, 0] * up[0] + q[k, 1] * up[1] + q[k, 2] * up[2])
        limit = -sign * (limit - base) / radius + sign * here + bend
        used = add_row(up, lever, slope, limit, work, used)
    return used
