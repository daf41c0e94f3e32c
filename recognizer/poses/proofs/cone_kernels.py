"""Compiled cones of measured normals, as terms of a quadratic form over small turns.

A turn ``w`` of the object takes a measured normal ``u``, in its frame, to ``u'``, which is within
a chord of the face's normal ``m``: ``|u' - m|^2 = 2 - 2 m . u'``. That form in ``w`` holds up to
``1 - cos t >= t^2 (1 - t^2 / 12) / 2``, its slope up to ``sin t / t >= 1 - t^2 / 6``.
"""

from __future__ import annotations

import numpy as np

from ...compiling import borrowing, kernel, vectorised
from ...contacts.reading_kernels import RAY

TERMS = 12
"""What is added of a cone: slope (3), form (6, lower triangle), what its square may grow by, its
square, nothing."""


@kernel
def cone_table(count):
    """Room for so many cones: terms, misses and normals in chords, weights, sums of terms."""
    return np.empty((count, TERMS)), np.empty((6, count)), np.empty(count), np.empty(TERMS)


@borrowing
def note_cones(count, faces, u, normals, contacts, readings, table):
    """Note the cones of an interpretation, with weights of one; returns how many.

    Args:
        count: how many contacts count.
        faces: (n,) the feature of each, -1 for none.
        u: (n, 3) measured normals, object frame.
        normals: (f, 3) normals of the features' planes.
        contacts: see `pose.kernel_contacts`.
        readings: see `reading_kernels.read`.
        table: see `cone_table`; written in place.
    """
    terms, columns, weights, _ = table
    chords = contacts[3]
    kinds, misses = readings[4], readings[5]
    used = 0
    for i in range(count):
        f = faces[i]
        if f < 0 or kinds[i] != RAY:
            continue
        inverse = 1.0 / chords[i]
        share = misses[i] * inverse
        square = inverse * inverse
        m0, m1, m2 = normals[f, 0], normals[f, 1], normals[f, 2]
        u0, u1, u2 = u[i, 0], u[i, 1], u[i, 2]
        along = u0 * m0 + u1 * m1 + u2 * m2
        terms[used, 0] = square * (u1 * m2 - u2 * m1)
        terms[used, 1] = square * (u2 * m0 - u0 * m2)
        terms[used, 2] = square * (u0 * m1 - u1 * m0)
        terms[used, 3] = square * (along - u0 * m0)
        terms[used, 4] = -0.5 * square * (u1 * m0 + u0 * m1)
        terms[used, 5] = square * (along - u1 * m1)
        terms[used, 6] = -0.5 * square * (u2 * m0 + u0 * m2)
        terms[used, 7] = -0.5 * square * (u2 * m1 + u1 * m2)
        terms[used, 8] = square * (along - u2 * m2)
        terms[used, 9] = 1.0 - share * share
        terms[used, 10] = share * share
        terms[used, 11] = 0.0
        columns[0, used], columns[3, used] = inverse * (u0 - m0), inverse * u0
        columns[1, used], columns[4, used] = inverse * (u1 - m1), inverse * u1
        columns[2, used], columns[5, used] = inverse * (u2 - m2), inverse * u2
        weights[used] = 1.0
        used += 1
    return used


@borrowing
def add_cones(used, table, angle, system, slope):
    """Add the weighted squares of the cones' misses, in chords, to a form over motions.

    Args:
        used: how many cones there are.
        table: see `cone_table`.
        angle: bounds every turn, radians.
        system: (6, 6) of the form, the lower triangle added to in place.
        slope: (6,) likewise.

    Returns:
        What the squares may have together beyond what they have at the pose itself.
    """
    terms, _, weights, sums = table
    for k in range(TERMS):
        sums[k] = 0.0
    for r in range(used):
        weight = weights[r]
        for k in range(TERMS):
            sums[k] += weight * terms[r, k]
    square = angle * angle
    bend = max(0.0, 1.0 - square / 12.0)
    at = 3
    for a in range(3):
        slope[a] += sums[a]
        for b in range(a + 1):
            system[a, b] += bend * sums[at]
            at += 1
    steepness = np.sqrt(sums[0] * sums[0] + sums[1] * sums[1] + sums[2] * sums[2])
    return sums[9] + square / 3.0 * steepness * angle + square * square / 24.0 * sums[10]


@vectorised
def raise_cones(used, table, middle):
    """Count each cone by how large the fit of a round leaves its miss.

    Args:
        used: how many cones there are.
        table: see `cone_table`.
        middle: (6,) the fit's motion.
    """
    _, columns, weights, _ = table
    w0, w1, w2 = middle[0], middle[1], middle[2]
    for r in range(used):
        u0, u1, u2 = columns[3, r], columns[4, r], columns[5, r]
        e0 = columns[0, r] + u1 * w2 - u2 * w1
        e1 = columns[1, r] + u2 * w0 - u0 * w2
        e2 = columns[2, r] + u0 * w1 - u1 * w0
        weights[r] *= min(np.sqrt(e0 * e0 + e1 * e1 + e2 * e2), 10.0) + 0.05
