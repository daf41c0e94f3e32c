"""Compiled small motions of an object: how they change what was felt, and how to apply them.

Everything happens in the object's frame: a pose ``(R, t)`` turns a contact ``p`` into
``x = R^T (p - t)`` and its normal into ``u = R^T n``. A small motion of the object, a rotation
``w`` and a shift ``s`` about its centroid ``c``, changes them by ``-w x (x - c) - s`` and by
``u x w``. Rotations are scaled by the object's radius, so that all six steps are lengths.
"""

from __future__ import annotations

import numpy as np

from ...compiling import borrowing, inlined


@inlined
def cross(a, b, out):
    """Vector product of (3,) ``a`` and ``b``, into ``out``."""
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]


@borrowing
def perpendicular(x, y, z):
    """A unit vector across another: also across the axis that leans the least on that one."""
    if abs(x) <= abs(y) and abs(x) <= abs(z):
        u0, u1, u2 = 0.0, z, -y
    elif abs(y) <= abs(z):
        u0, u1, u2 = -z, 0.0, x
    else:
        u0, u1, u2 = y, -x, 0.0
    size = np.sqrt(u0 * u0 + u1 * u1 + u2 * u2)
    return u0 / size, u1 / size, u2 / size


@borrowing
def to_object(points, normals, rotation, translation, x, u):
    """Contacts and normals, (n, 3) each, from the world into the object's frame: ``x``, ``u``."""
    for i in range(len(points)):
        for k in range(3):
            x[i, k] = 0.0
            u[i, k] = 0.0
            for m in range(3):
                x[i, k] += rotation[m, k] * (points[i, m] - translation[m])
                u[i, k] += rotation[m, k] * normals[i, m]


@borrowing
def copy_rotation(source, target):
    """Write (3, 3) ``source`` into ``target``."""
    for a in range(3):
        for b in range(3):
            target[a, b] = source[a, b]


@borrowing
def copy_pose(rotation, translation, to_rotation, to_translation):
    """Write a pose, (3, 3) and (3,), into another."""
    copy_rotation(rotation, to_rotation)
    for a in range(3):
        to_translation[a] = translation[a]


@borrowing
def slope_row(direction, arm, radius, turn, row):
    """Change of a length along ``direction`` at the end of ``arm`` with the small motions.

    Written into (6,) ``row``; (3,) ``turn`` is work space.
    """
    cross(arm, direction, turn)
    for k in range(3):
        row[k] = -turn[k] / radius
        row[3 + k] = -direction[k]


@borrowing
def add_row(row, residual, weight, system, gradient):
    """Add a weighted residual with (6,) derivative ``row`` to normal equations."""
    for a in range(6):
        gradient[a] += weight * residual * row[a]
        for b in range(a + 1):
            system[a, b] += weight * row[a] * row[b]


@borrowing
def solve(system, gradient, damping, factor, step):
    """Solve ``(system + damping) step = -gradient`` by Cholesky, in place.

    Args:
        system: (k, k) symmetric, of which the lower triangle is read.
        gradient: (k,) right side.
        damping: added to the diagonal of the six lengths, inverse square metres; a level beyond
            them has no unit, and damping it would make the steps of small objects fall short.
        factor: (k, k) work space.
        step: (k,) written in place.
    """
    size = len(step)
    for a in range(size):
        for b in range(a):
            value = system[a, b]
            for k in range(b):
                value -= factor[a, k] * factor[b, k]
            factor[a, b] = value * factor[b, b]
        value = system[a, a]
        if a < 6:
            value += damping
        for k in range(a):
            value -= factor[a, k] * factor[a, k]
        # Its inverse: multiplying takes a fraction of the time of dividing.
        factor[a, a] = 1.0 / np.sqrt(max(value, 1e-300))
    for a in range(size):
        value = -gradient[a]
        for k in range(a):
            value -= factor[a, k] * step[k]
        step[a] = value * factor[a, a]
    for a in range(size - 1, -1, -1):
        value = step[a]
        for k in range(a + 1, size):
            value -= factor[k, a] * step[k]
        step[a] = value * factor[a, a]


@borrowing
def move(rotation, translation, step, centre, radius, new_rotation, new_translation):
    """Apply a small motion in the object's frame: rotate about its centroid, then shift."""
    wx, wy, wz = step[0] / radius, step[1] / radius, step[2] / radius
    angle = np.sqrt(wx * wx + wy * wy + wz * wz)
    half = 0.5 * angle
    scale = np.sin(half) / angle if angle > 1e-12 else 0.5
    a, b, c, d = np.cos(half), scale * wx, scale * wy, scale * wz
    t00 = a * a + b * b - c * c - d * d
    t01 = 2.0 * (b * c - a * d)
    t02 = 2.0 * (b * d + a * c)
    t10 = 2.0 * (b * c + a * d)
    t11 = a * a - b * b + c * c - d * d
    t12 = 2.0 * (c * d - a * b)
    t20 = 2.0 * (b * d - a * c)
    t21 = 2.0 * (c * d + a * b)
    t22 = a * a - b * b - c * c + d * d
    c0, c1, c2 = centre[0], centre[1], centre[2]
    s0 = c0 + step[3] - (t00 * c0 + t01 * c1 + t02 * c2)
    s1 = c1 + step[4] - (t10 * c0 + t11 * c1 + t12 * c2)
    s2 = c2 + step[5] - (t20 * c0 + t21 * c1 + t22 * c2)
    for i in range(3):
        r0, r1, r2 = rotation[i, 0], rotation[i, 1], rotation[i, 2]
        new_rotation[i, 0] = r0 * t00 + r1 * t10 + r2 * t20
        new_rotation[i, 1] = r0 * t01 + r1 * t11 + r2 * t21
        new_rotation[i, 2] = r0 * t02 + r1 * t12 + r2 * t22
        new_translation[i] = translation[i] + r0 * s0 + r1 * s1 + r2 * s2


@borrowing
def turn_between(one, other, turn):
    """The rotation vector of ``one^T other`` into (3,) ``turn``; returns its length, radians."""
    trace = 0.0
    for k in range(3):
        a, b = (k + 1) % 3, (k + 2) % 3
        turn[k] = 0.0
        for i in range(3):
            turn[k] += 0.5 * (one[i, b] * other[i, a] - one[i, a] * other[i, b])
            trace += one[i, k] * other[i, k]
    sine = np.sqrt(turn[0] ** 2 + turn[1] ** 2 + turn[2] ** 2)
    angle = np.arctan2(sine, 0.5 * (trace - 1.0))
    if sine > 1e-9:
        for k in range(3):
            turn[k] *= angle / sine
    return angle
