"""Compiled small motions of an object: how they change what was felt, and how to apply them.

Everything happens in the object's frame: a pose ``(R, t)`` turns a contact ``p`` into
``x = R^T (p - t)`` and its normal into ``u = R^T n``. A small motion of the object, a rotation
``w`` and a shift ``s`` about its centroid ``c``, changes them by ``-w x (x - c) - s`` and by
``u x w``. Rotations are scaled by the object's radius, so that all six steps are lengths.
"""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, inline="always")
def cross(a, b, out):
    """Vector product of (3,) ``a`` and ``b``, into ``out``."""
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]


@njit(cache=True)
def to_object(points, normals, rotation, translation, x, u):
    """Contacts and normals, (n, 3) each, from the world into the object's frame: ``x``, ``u``."""
    for i in range(len(points)):
        for k in range(3):
            x[i, k] = 0.0
            u[i, k] = 0.0
            for m in range(3):
                x[i, k] += rotation[m, k] * (points[i, m] - translation[m])
                u[i, k] += rotation[m, k] * normals[i, m]


@njit(cache=True)
def slope_row(direction, arm, radius, turn, row):
    """Change of a length along ``direction`` at the end of ``arm`` with the small motions.

    Written into (6,) ``row``; (3,) ``turn`` is work space.
    """
    cross(arm, direction, turn)
    for k in range(3):
        row[k] = -turn[k] / radius
        row[3 + k] = -direction[k]


@njit(cache=True)
def add_row(row, residual, weight, system, gradient):
    """Add a weighted residual with (6,) derivative ``row`` to normal equations."""
    for a in range(6):
        gradient[a] += weight * residual * row[a]
        for b in range(a + 1):
            system[a, b] += weight * row[a] * row[b]


@njit(cache=True)
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
        for b in range(a + 1):
            value = system[a, b]
            if a == b and a < 6:
                value += damping
            for k in range(b):
                value -= factor[a, k] * factor[b, k]
            if a == b:
                factor[a, a] = np.sqrt(max(value, 1e-300))
            else:
                factor[a, b] = value / factor[b, b]
    for a in range(size):
        value = -gradient[a]
        for k in range(a):
            value -= factor[a, k] * step[k]
        step[a] = value / factor[a, a]
    for a in range(size - 1, -1, -1):
        value = step[a]
        for k in range(a + 1, size):
            value -= factor[k, a] * step[k]
        step[a] = value / factor[a, a]


@njit(cache=True)
def move(rotation, translation, step, centre, radius, new_rotation, new_translation):
    """Apply a small motion in the object's frame: rotate about its centroid, then shift."""
    wx, wy, wz = step[0] / radius, step[1] / radius, step[2] / radius
    angle = np.sqrt(wx * wx + wy * wy + wz * wz)
    half = 0.5 * angle
    scale = np.sin(half) / angle if angle > 1e-12 else 0.5
    a, b, c, d = np.cos(half), scale * wx, scale * wy, scale * wz
    turn = np.empty((3, 3))
    turn[0, 0] = a * a + b * b - c * c - d * d
    turn[0, 1] = 2.0 * (b * c - a * d)
    turn[0, 2] = 2.0 * (b * d + a * c)
    turn[1, 0] = 2.0 * (b * c + a * d)
    turn[1, 1] = a * a - b * b + c * c - d * d
    turn[1, 2] = 2.0 * (c * d - a * b)
    turn[2, 0] = 2.0 * (b * d - a * c)
    turn[2, 1] = 2.0 * (c * d + a * b)
    turn[2, 2] = a * a - b * b - c * c + d * d
    for i in range(3):
        for j in range(3):
            new_rotation[i, j] = 0.0
            for k in range(3):
                new_rotation[i, j] += rotation[i, k] * turn[k, j]
    for i in range(3):
        new_translation[i] = translation[i]
        for k in range(3):
            shift = centre[k] + step[3 + k]
            for m in range(3):
                shift -= turn[k, m] * centre[m]
            new_translation[i] += rotation[i, k] * shift
