"""Compiled quaternions: eigenvectors of the forms that they are sought with, and rotations."""

from __future__ import annotations

import numpy as np

from ...compiling import borrowing


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
