"""Compiled branch and bound over poses: a witness, or a proof that there is none.

Rotations are searched as boxes of quaternions ``q = sqrt(1 - |v|^2) q0 + V v`` about the rotation
``q0`` that fits the normals best, along the principal axes ``V`` of that fit (Davenport's method).
The normals' bounds confine ``v`` to an ellipsoid. A box is dropped when no pose in the ball around
it can meet the bounds, which `ball_kernels.seek_in_ball` proves; otherwise it is halved.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from .ball_kernels import EXCLUDED, seek_in_ball
from .feasibility_kernels import EXACT, UNKNOWN_NORMAL, seek_feasible, worst_excess
from .motion_kernels import move, to_object

REJECTED, FEASIBLE, UNDECIDED = 0, 1, 2
"""No pose meets the bounds; the pose found meets them; neither could be shown in the budget."""

STACK = 512


@njit(cache=True)
def align(faces, contacts, model, values, vectors):
    """Davenport's q-method on the faces' normals and the measured ones.

    Each pair counts by one over its squared chord bound, so the misfit of a feasible rotation is at
    most the number of pairs.

    Args:
        faces: (n,) the face of each contact.
        contacts: positions, normals, position bounds, bounds on chords; world frame.
        model: see `pose_kernels.test_interpretations`.
        values: (4,) eigenvalues in ascending order, written in place.
        vectors: (4, 4) unit quaternions (w, x, y, z) in columns, best last, written in place.

    Returns:
        How far the best rotation's misfit is below what a feasible one may have, negative if no
        rotation meets the bounds on normals; and the spread (radians) of the rotation about its
        vaguest axis that the normals leave.
    """
    _, measured, _, chords = contacts
    normals = model[0]
    b = np.zeros((3, 3))
    budget = 0.0
    total = 0.0
    for i in range(len(faces)):
        if chords[i] >= UNKNOWN_NORMAL:
            continue
        weight = 1.0 / (chords[i] * chords[i])
        total += weight
        budget += 1.0
        for k in range(3):
            for m in range(3):
                b[k, m] += weight * measured[i, k] * normals[faces[i], m]
    k4 = np.empty((4, 4))
    trace = b[0, 0] + b[1, 1] + b[2, 2]
    for k in range(3):
        for m in range(3):
            k4[k + 1, m + 1] = b[k, m] + b[m, k]
        k4[k + 1, k + 1] -= trace
    k4[0, 0] = trace
    k4[0, 1] = k4[1, 0] = b[2, 1] - b[1, 2]
    k4[0, 2] = k4[2, 0] = b[0, 2] - b[2, 0]
    k4[0, 3] = k4[3, 0] = b[1, 0] - b[0, 1]
    found, axes = np.linalg.eigh(k4)
    values[:] = found
    vectors[:] = axes
    # Turning by an angle s about the vaguest axis costs (values[3] - values[2]) sin^2(s / 2).
    spread = 1.0 / np.sqrt(max(0.5 * (found[3] - found[2]), 1e-12))
    # Sum of weight |R m - n|^2 is 2 total - 2 q^T K q.
    return budget - (2.0 * total - 2.0 * found[3]), spread


@njit(cache=True)
def rotation_at(v, vectors, rotation):
    """The rotation of box coordinates ``v`` (3,), written into ``rotation`` (3, 3)."""
    s = np.sqrt(max(0.0, 1.0 - v[0] * v[0] - v[1] * v[1] - v[2] * v[2]))
    q = s * vectors[:, 3] + v[0] * vectors[:, 0] + v[1] * vectors[:, 1] + v[2] * vectors[:, 2]
    q /= np.sqrt((q * q).sum())
    w, x, y, z = q[0], q[1], q[2], q[3]
    rotation[0, 0] = w * w + x * x - y * y - z * z
    rotation[0, 1] = 2.0 * (x * y - w * z)
    rotation[0, 2] = 2.0 * (x * z + w * y)
    rotation[1, 0] = 2.0 * (x * y + w * z)
    rotation[1, 1] = w * w - x * x + y * y - z * z
    rotation[1, 2] = 2.0 * (y * z - w * x)
    rotation[2, 0] = 2.0 * (x * z - w * y)
    rotation[2, 1] = 2.0 * (y * z + w * x)
    rotation[2, 2] = w * w - x * x - y * y + z * z


@njit(cache=True)
def _box_radius(v, half):
    """An angle (radians) that no rotation of a box exceeds, measured from the box's centre.

    Returns -1 for a box without any unit quaternion in it.
    """
    nearest = 0.0
    farthest = 0.0
    centre = 0.0
    spread = 0.0
    for k in range(3):
        nearest += max(abs(v[k]) - half[k], 0.0) ** 2
        farthest += (abs(v[k]) + half[k]) ** 2
        centre += v[k] * v[k]
        spread += half[k] * half[k]
    if nearest > 1.0:
        return -1.0
    # A centre outside the unit ball is drawn onto it by `rotation_at`; count that way too.
    drawn = max(np.sqrt(centre) - 1.0, 0.0)
    s = np.sqrt(max(0.0, 1.0 - centre))
    rise = max(np.sqrt(1.0 - nearest) - s, s - np.sqrt(max(0.0, 1.0 - farthest)))
    chord = np.sqrt(spread + rise * rise) + drawn
    return 4.0 * np.arcsin(min(1.0, 0.5 * chord))


@njit(cache=True)
def middle_translation(faces, points, middles, rotation, translation):
    """The shift that puts the middles of the faces onto the contacts, on average."""
    count = len(faces)
    translation[:] = 0.0
    for i in range(count):
        for k in range(3):
            translation[k] += points[i, k] / count
            for j in range(3):
                translation[k] -= rotation[k, j] * middles[faces[i], j] / count


@njit(cache=True)
def search_poses(
    slack, values, vectors, faces, contacts, model, middles, most, rotation, translation
):
    """Search all poses of an interpretation; a witness goes into rotation and translation.

    Args:
        slack: what `align` returned first, not negative.
        values: (4,) and vectors (4, 4), from `align`.
        faces: (n,) the face of each contact.
        contacts: positions, normals, position bounds, bounds on chords; world frame.
        model: see `pose_kernels.test_interpretations`.
        middles: (f, 3) a point inside each face's hull.
        most: the most boxes to look at.
        rotation: (3, 3) written in place.
        translation: (3,) written in place.

    Returns:
        REJECTED, FEASIBLE or UNDECIDED, and how many boxes were looked at.
    """
    points, measured, reaches, chords = contacts
    normals, first = model[0], model[2]
    count = len(faces)
    centres = np.empty((STACK, 3))
    halves = np.empty((STACK, 3))
    targets = np.empty((STACK, count), np.int64)
    turn = np.empty((3, 3))
    shift = np.empty(3)
    moved_turn = np.empty((3, 3))
    moved_shift = np.empty(3)
    pivot = np.empty(3)
    motion = np.empty(7)
    x = np.empty((count, 3))
    u = np.empty((count, 3))
    v = np.empty(3)
    half = np.empty(3)
    centres[0] = 0.0
    for k in range(3):
        curvature = 2.0 * (values[3] - values[k])
        halves[0, k] = min(1.0, np.sqrt(slack / curvature)) if curvature > slack else 1.0
    targets[0] = faces
    height = 1
    open_boxes = False
    for looked in range(most):
        if height == 0:
            return (UNDECIDED if open_boxes else REJECTED), looked
        height -= 1
        v[:] = centres[height]
        half[:] = halves[height]
        chosen = targets[height].copy()
        radius = _box_radius(v, half)
        if radius < 0.0:
            continue
        # The misfit of the normals over the box, at its least.
        misfit = 0.0
        for k in range(3):
            misfit += 2.0 * (values[3] - values[k]) * max(abs(v[k]) - half[k], 0.0) ** 2
        if misfit > slack + 1e-6:
            continue
        rotation_at(v, vectors, turn)
        middle_translation(faces, points, middles, turn, shift)
        to_object(points, measured, turn, shift, x, u)
        inside = True
        reach = 2.0 * np.sin(0.5 * min(radius, np.pi))
        pivot[:] = 0.0
        for i in range(count):
            gap = 0.0
            for k in range(3):
                gap += (u[i, k] - normals[faces[i], k]) ** 2
                pivot[k] += x[i, k] / count
            if np.sqrt(gap) > chords[i] + reach + 1e-6:
                inside = False
                break
        if not inside:
            continue
        split_faces = False
        where = 0
        if radius < 1.5:
            outcome = seek_in_ball(x, u, pivot, radius, faces, chosen, contacts, model, motion)
            if outcome == EXCLUDED:
                continue
            move(turn, shift, motion, pivot, model[6], moved_turn, moved_shift)
            if seek_feasible(faces, chosen, contacts, model, 60, moved_turn, moved_shift):
                to_object(points, measured, moved_turn, moved_shift, x, u)
                worst, where = worst_excess(x, u, faces, chosen, reaches, chords, model, True)
                if worst <= EXACT:
                    rotation[:] = moved_turn
                    translation[:] = moved_shift
                    return FEASIBLE, looked
                split_faces = True
        if split_faces:
            # Every bound is met on the hulls, but this contact is beside its concave face.
            f = faces[where]
            for p in range(first[f], first[f + 1]):
                if height == STACK:
                    return UNDECIDED, most
                centres[height] = v
                halves[height] = half
                targets[height] = chosen
                targets[height, where] = p
                height += 1
            continue
        if radius < 1e-4:
            rotation[:] = turn
            translation[:] = shift
            open_boxes = True
            continue
        longest = 0
        for k in range(1, 3):
            if half[k] > half[longest]:
                longest = k
        for side in range(2):
            if height == STACK:
                return UNDECIDED, most
            centres[height] = v
            halves[height] = half
            targets[height] = chosen
            halves[height, longest] *= 0.5
            centres[height, longest] += (2 * side - 1) * halves[height, longest]
            height += 1
    return UNDECIDED, most
