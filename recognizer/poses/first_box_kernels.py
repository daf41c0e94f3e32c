"""Compiled first box: the rotation that fits the normals best, and how far off any can be.

Davenport's q-method: the sum of ``|Q u - n|^2``, each over its squared bound, is a quadratic form
in the quaternion of ``Q``, so its least is at an eigenvector, and a rotation whose sum is within
what the bounds allow is within an ellipsoid about it.
"""

from __future__ import annotations

import numpy as np

from ..compiling import borrowing
from .motions.align_kernels import ROUNDING, diagonalise, rotation_of


@borrowing
def first_box(fixed, shape, touches, form, vectors, chart, half):
    """The rotation that fits the normals of assigned contacts best, and a box about it.

    Args:
        fixed: (n,) the feature of each contact, below zero for none.
        shape: see `shape.Shape`.
        touches: see `shape.Touches`.
        form: (4, 4) work space.
        vectors: (4, 4) likewise.
        chart: (3, 3) world to object, written in place.
        half: (3,) half sides of a box of Gibbs vectors about it, written in place.

    Returns:
        An angle that no rotation within the bounds exceeds from it, radians; pi if the normals
        don't fix the rotation, -1 if no rotation is within the bounds.
    """
    for a in range(4):
        for b in range(4):
            form[a, b] = 0.0
    budget, total = 0.0, 0.0
    for i in range(len(fixed)):
        f = fixed[i]
        if f < 0:
            continue
        wide = touches.errors[i] + shape.half_angles[f]
        if wide >= np.pi:
            continue
        weight = 0.25 / np.sin(0.5 * wide) ** 2
        total += weight
        budget += 1.0
        n, u = shape.normals[f], touches.normals[i]
        # Of n . Q u, with Q's quaternion (w, v): symmetric in it.
        along = n[0] * u[0] + n[1] * u[1] + n[2] * u[2]
        form[0, 0] += weight * along
        form[0, 1] += weight * (u[1] * n[2] - u[2] * n[1])
        form[0, 2] += weight * (u[2] * n[0] - u[0] * n[2])
        form[0, 3] += weight * (u[0] * n[1] - u[1] * n[0])
        for a in range(3):
            for b in range(a, 3):
                form[1 + a, 1 + b] += weight * (n[a] * u[b] + n[b] * u[a])
            form[1 + a, 1 + a] -= weight * along
    if budget < 2.0:
        return np.pi
    for a in range(4):
        for b in range(a):
            form[a, b] = form[b, a]
    diagonalise(form, vectors)
    best = 0
    for k in range(1, 4):
        if form[k, k] > form[best, best]:
            best = k
    # The sum is 2 total - 2 q^T K q.
    slack = budget - 2.0 * (total - form[best, best]) + ROUNDING
    if slack < 0.0:
        return -1.0
    longest = 0.0
    for k in range(4):
        if k != best:
            # A unit quaternion's part along this one, squared, is at most so much.
            gap = 2.0 * (form[best, best] - form[k, k])
            if gap <= slack:
                return np.pi
            longest = max(longest, slack / gap)
    w, x, y, z = vectors[0, best], vectors[1, best], vectors[2, best], vectors[3, best]
    rotation_of(w, x, y, z, chart)
    for k in range(3):
        half[k] = 0.0
    for k in range(4):
        if k == best:
            continue
        reach = slack / (2.0 * (form[best, best] - form[k, k]))
        # The quaternion of a turn after the best: the vector part of q times its conjugate.
        q0, q1, q2, q3 = vectors[0, k], vectors[1, k], vectors[2, k], vectors[3, k]
        v0 = w * q1 - q0 * x - (q2 * z - q3 * y)
        v1 = w * q2 - q0 * y - (q3 * x - q1 * z)
        v2 = w * q3 - q0 * z - (q1 * y - q2 * x)
        half[0] += reach * v0 * v0
        half[1] += reach * v1 * v1
        half[2] += reach * v2 * v2
    scale = (1.0 + 1e-6) / np.sqrt(1.0 - longest)
    for k in range(3):
        half[k] = scale * np.sqrt(half[k]) + 1e-7
    return min(np.pi, 2.0 * np.arcsin(np.sqrt(longest)) + 1e-6)
