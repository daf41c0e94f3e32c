"""Compiled first guess: the rotation that fits the normals best, and how far off it can be.

Davenport's q-method: the sum of ``|R m - n|^2``, each over its squared bound, is a quadratic form
in the quaternion of R, so its least is at an eigenvector, and a rotation whose sum is within what
the bounds allow is within an ellipsoid about it.
"""

from __future__ import annotations

import numpy as np

from ...compiling import borrowing, kernel
from ...contacts.reading_kernels import UNKNOWN_NORMAL

ROUNDING = 1e-6
"""Misfit of normals, in squared bounds, that is put down to rounding."""


@borrowing
def diagonalise(matrix, vectors):
    """Eigenvectors of a symmetric (k, k) matrix, which ends diagonal, as columns (Jacobi)."""
    count = len(matrix)
    for a in range(count):
        for b in range(count):
            vectors[a, b] = 1.0 if a == b else 0.0
    for _ in range(30):
        off = 0.0
        size = 0.0
        for a in range(count):
            size += abs(matrix[a, a])
            for b in range(a):
                off += abs(matrix[a, b])
        if off <= 1e-14 * (size + off):
            return
        for p in range(count - 1):
            for q in range(p + 1, count):
                if matrix[p, q] == 0.0:
                    continue
                theta = 0.5 * (matrix[q, q] - matrix[p, p]) / matrix[p, q]
                t = 1.0 / (abs(theta) + np.sqrt(theta * theta + 1.0))
                if theta < 0.0:
                    t = -t
                c = 1.0 / np.sqrt(t * t + 1.0)
                s = t * c
                for k in range(count):
                    left, right = matrix[k, p], matrix[k, q]
                    matrix[k, p], matrix[k, q] = c * left - s * right, s * left + c * right
                for k in range(count):
                    left, right = matrix[p, k], matrix[q, k]
                    matrix[p, k], matrix[q, k] = c * left - s * right, s * left + c * right
                for k in range(count):
                    left, right = vectors[k, p], vectors[k, q]
                    vectors[k, p], vectors[k, q] = c * left - s * right, s * left + c * right


@borrowing
def rotation_of(w, x, y, z, rotation):
    """The rotation (3, 3) of a unit quaternion, in place."""
    rotation[0, 0] = w * w + x * x - y * y - z * z
    rotation[0, 1] = 2.0 * (x * y - w * z)
    rotation[0, 2] = 2.0 * (x * z + w * y)
    rotation[1, 0] = 2.0 * (x * y + w * z)
    rotation[1, 1] = w * w - x * x + y * y - z * z
    rotation[1, 2] = 2.0 * (y * z - w * x)
    rotation[2, 0] = 2.0 * (x * z - w * y)
    rotation[2, 1] = 2.0 * (y * z + w * x)
    rotation[2, 2] = w * w - x * x - y * y + z * z


@kernel
def align(count, faces, model, half_angles, contacts, rotation):
    """The rotation that fits the normals best, written in place.

    Args:
        count: how many contacts count.
        faces: (n,) the feature of each contact, -1 for none.
        model: see `pose.ModelTest`.
        half_angles: (f,) how far a feature's normals lean from its middle one, radians.
        contacts: see `pose.kernel_contacts`.
        rotation: (3, 3) object to world, written in place.

    Returns:
        An angle that no rotation within the bounds exceeds from it, radians, pi if the normals
        don't fix the rotation, -1 if no rotation is within the bounds.
    """
    normals = model[0]
    _, measured, _, chords, _ = contacts
    b = np.zeros((3, 3))
    budget = 0.0
    total = 0.0
    for i in range(count):
        f = faces[i]
        if f < 0 or chords[i] >= UNKNOWN_NORMAL:
            continue
        chord = chords[i]
        if half_angles[f] > 0.0:
            wide = 2.0 * np.arcsin(0.5 * chord) + half_angles[f]
            if wide >= np.pi:
                continue
            chord = 2.0 * np.sin(0.5 * wide)
        weight = 1.0 / (chord * chord)
        total += weight
        budget += 1.0
        for k in range(3):
            for m in range(3):
                b[k, m] += weight * measured[i, k] * normals[f, m]
    k4 = np.empty((4, 4))
    vectors = np.empty((4, 4))
    trace = b[0, 0] + b[1, 1] + b[2, 2]
    for k in range(3):
        for m in range(3):
            k4[k + 1, m + 1] = b[k, m] + b[m, k]
        k4[k + 1, k + 1] -= trace
    k4[0, 0] = trace
    k4[0, 1] = k4[1, 0] = b[2, 1] - b[1, 2]
    k4[0, 2] = k4[2, 0] = b[0, 2] - b[2, 0]
    k4[0, 3] = k4[3, 0] = b[1, 0] - b[0, 1]
    diagonalise(k4, vectors)
    best = 0
    for k in range(1, 4):
        if k4[k, k] > k4[best, best]:
            best = k
    second = -np.inf
    for k in range(4):
        if k != best:
            second = max(second, k4[k, k])
    w, x, y, z = vectors[0, best], vectors[1, best], vectors[2, best], vectors[3, best]
    rotation_of(w, x, y, z, rotation)
    # The sum is 2 total - 2 q^T K q, and turning by s about the vaguest axis adds
    # 2 (best - second) sin^2(s / 2) to it.
    slack = budget - 2.0 * (total - k4[best, best]) + ROUNDING
    if slack < 0.0:
        return -1.0
    gap = 2.0 * (k4[best, best] - second)
    if gap <= slack:
        return np.pi
    return min(np.pi, 2.0 * np.arcsin(np.sqrt(slack / gap)) + 1e-6)


@borrowing
def middle_translation(count, faces, points, middles, rotation, translation):
    """The shift that puts the middles of the faces onto the contacts, on average."""
    translation[:] = 0.0
    used = 0
    for i in range(count):
        f = faces[i]
        if f < 0:
            continue
        used += 1
        for k in range(3):
            translation[k] += points[i, k]
            for j in range(3):
                translation[k] -= rotation[k, j] * middles[f, j]
    for k in range(3):
        translation[k] /= max(used, 1)
