"""Compiled first boxes: the rotations that the normals of assigned contacts leave.

Davenport's q-method: the sum of ``|Q u - n|^2``, each over its squared bound, is a quadratic form
in the quaternion of ``Q``, so its least is at an eigenvector, and a rotation whose sum is within
what the bounds allow is in an ellipsoid of quaternions about it. If that is long in one direction
only, the normals leave a turn about an axis; two boxes hold it, about its best and half a turn on.
"""

from __future__ import annotations

import numpy as np

from ..compiling import borrowing
from .motions.quaternion_kernels import diagonalise, rotation_of

WIDE = 0.32
"""Squared sine of half an angle: the normals leave a turn about an axis open if they allow more."""
ROUNDING = 1e-6
"""Misfit of normals, in squared bounds, that is put down to rounding."""
FAR = 1e6
"""A share of the misfit that no slack reaches."""
IMPOSSIBLE, ALL = -1, 3
"""Of turns that are open: no rotation is within the bounds; all are."""


@borrowing
def box_about(best, open_turn, slack, form, vectors, chart, half):
    """A box about a quaternion that holds those whose part along it is not small.

    Args:
        best: the column of the quaternion.
        open_turn: the column of one along which the part may be as large; below zero for none.
        slack: how much more than the least the sum of misfits may be.
        form: (4, 4) diagonal.
        vectors: (4, 4) its eigenvectors, as columns.
        chart: (3, 3) rotation of the quaternion, written in place.
        half: (3,) half sides of a box of Gibbs vectors about it, likewise.
    """
    w, x, y, z = vectors[0, best], vectors[1, best], vectors[2, best], vectors[3, best]
    rotation_of(w, x, y, z, chart)
    top = form[best, best]
    if open_turn >= 0:
        top = max(top, form[open_turn, open_turn])
    longest = 0.0
    for k in range(4):
        if k not in (best, open_turn):
            longest = max(longest, slack / (2.0 * (top - form[k, k])))
    # At least so much of the square is along the quaternion, where nothing is open, or its part is
    # no less than the other one's.
    least = (1.0 - longest) * (0.5 if open_turn >= 0 else 1.0)
    for k in range(3):
        half[k] = 0.0
    turn = (0.0, 0.0, 0.0)
    for k in range(4):
        if k == best:
            continue
        # The vector part of the conjugate of the quaternion times this one.
        q0, q1, q2, q3 = vectors[0, k], vectors[1, k], vectors[2, k], vectors[3, k]
        v0 = w * q1 - q0 * x - (y * q3 - z * q2)
        v1 = w * q2 - q0 * y - (z * q1 - x * q3)
        v2 = w * q3 - q0 * z - (x * q2 - y * q1)
        if k == open_turn:
            turn = (abs(v0), abs(v1), abs(v2))
            continue
        reach = slack / (2.0 * (top - form[k, k]) * least)
        half[0] += reach * v0 * v0
        half[1] += reach * v1 * v1
        half[2] += reach * v2 * v2
    for k in range(3):
        half[k] = (1.0 + 1e-6) * (np.sqrt(half[k]) + turn[k]) + 1e-7


@borrowing
def first_boxes(fixed, shape, touches, work):
    """The rotations that the normals of assigned contacts leave, in one box or two.

    Args:
        fixed: (n,) the feature of each contact, below zero for none.
        shape: see `shape.Shape`.
        touches: see `shape.Touches`.
        work: see `work_space.Work`; ``charts`` and ``sides`` are written in place: rotations,
            world to object, and half sides of boxes of Gibbs vectors about them.

    Returns:
        How many turns are open: none, and one box holds the rotations; one, and two do; `ALL`, and
        none is written; or `IMPOSSIBLE`.
    """
    form, vectors = work.form, work.vectors
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
    if budget == 0.0:
        return ALL
    for a in range(4):
        for b in range(a):
            form[a, b] = form[b, a]
    if shape.flat:
        # Quaternions of turns about z have no other parts.
        for a in (1, 2):
            for b in range(4):
                form[a, b] = form[b, a] = 0.0
            form[a, a] = -FAR * total
    diagonalise(form, vectors)
    best = 0
    for k in range(1, 4):
        if form[k, k] > form[best, best]:
            best = k
    # The sum is 2 total - 2 q^T K q.
    slack = budget - 2.0 * (total - form[best, best]) + ROUNDING
    if slack < 0.0:
        return IMPOSSIBLE
    turns, along = 0, -1
    for k in range(4):
        if k != best and 2.0 * WIDE * (form[best, best] - form[k, k]) < slack:
            turns += 1
            along = k
    if turns > 1:
        return ALL
    box_about(best, along, slack, form, vectors, work.charts[0], work.sides[0])
    if turns == 1:
        box_about(along, best, slack, form, vectors, work.charts[1], work.sides[1])
    if shape.flat:
        for at in range(turns + 1):
            work.sides[at, 0] = work.sides[at, 1] = 0.0
    return turns
