"""Compiled branch and bound over poses: a witness, or a proof that there is none.

Where one verdict over all rotations stays open, the rotations it left are cut into boxes
``R exp(V v)`` about its pose, along the axes ``V`` of its region, and each is judged by itself: the
smaller a box, the smaller the remainders that its proof has to allow for. Two turns ``exp(v)`` and
``exp(w)`` are at most ``|v - w|`` apart, so a ball of a box's half diagonal holds it.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from .feasibility_kernels import seek_feasible
from .motion_kernels import move
from .proof_kernels import locate
from .reading_kernels import carry, read, worst_on_pieces
from .verdict_kernels import BESIDE, EXACT, FEASIBLE, REJECTED, UNDECIDED, judge

STACK = 512
STEPS = 2
"""Steps of a verdict on a box."""
FINEST = 1e-3
"""Half a box (radians) that isn't cut further: its poses are alike beyond any bound."""
SEEK = 16
"""Once in so many boxes the interior-point method has its try, ..."""
NEARLY = 1.2
"""... and where the largest reading, in bounds, is below this, ..."""
FINE = 0.05
"""... and in boxes of half a diagonal (radians) below this: then proofs need better weights than a
few steps of a verdict find. Elsewhere it is slow, and settles little that smaller boxes don't."""
FLOOR = 0.02
"""What a weight starts with again in every box."""
WORTHWHILE = 0.3
"""A region is cut instead of the box it came from, if its volume is below this share of it."""


@njit(cache=True)
def _volume(region):
    """Of the ellipsoid of rotations, up to a factor: of half the sides of the box around it."""
    m = region[1]
    determinant = (
        m[0, 0] * (m[1, 1] * m[2, 2] - m[1, 2] * m[1, 2])
        - m[0, 1] * (m[0, 1] * m[2, 2] - m[1, 2] * m[0, 2])
        + m[0, 2] * (m[0, 1] * m[1, 2] - m[1, 1] * m[0, 2])
    )
    return np.sqrt(max(determinant, 0.0))


@njit(cache=True)
def _box_region(region, axes, centre, half):
    """The box around a region's rotations, about the pose that the region is about."""
    values, vectors = np.linalg.eigh(region[1][:3, :3].copy())
    axes[:] = vectors
    for k in range(3):
        half[k] = np.sqrt(max(values[k], 0.0)) * (1.0 + 1e-9)
        centre[k] = 0.0
        for a in range(3):
            centre[k] += vectors[a, k] * region[2][a]


@njit(cache=True)
def search_poses(count, faces, contacts, model, angle, most, rotation, translation, work, stack):
    """Search all poses of an interpretation, from one that `judge` may have left.

    Args:
        count: how many contacts count.
        faces: (n,) the feature of each contact, -1 for none.
        contacts: see `search_kernels.search_model`.
        model: likewise.
        angle: an angle from the starting rotation that no rotation within the bounds exceeds.
        most: the most boxes to look at.
        rotation: (3, 3) object to world, moved in place: a witness, or the least bad pose met.
        translation: (3,) likewise.
        work: see `verdict_kernels.workspace`.
        stack: see `box_stack`.

    Returns:
        REJECTED, FEASIBLE or UNDECIDED, and how many boxes were looked at.
    """
    first = model[2]
    readings, region = work[0], work[1]
    x, u, _, weights = work[3]
    turns, shifts, axes, centres, halves, targets, kept = stack
    held = np.empty(3)
    ball = np.empty((3, 3))
    turned, shifted = np.empty((3, 3)), np.empty(3)
    best_turn, best_shift = rotation.copy(), translation.copy()
    step = np.zeros(6)
    pivot = np.zeros(3)
    used = 0
    for i in range(count):
        if faces[i] >= 0:
            pivot += contacts[0][i]
            used += 1
    pivot /= max(used, 1)
    turns[0], shifts[0] = rotation, translation
    if angle < 1.5:
        _box_region(region, axes[0], centres[0], halves[0])
    else:
        axes[0], centres[0], halves[0] = np.eye(3), 0.0, min(angle, np.pi)
    targets[0, :count] = faces[:count]
    height = 1
    open_boxes = False
    least = np.inf
    for looked in range(most):
        if height == 0:
            rotation[:], translation[:] = best_turn, best_shift
            return (UNDECIDED if open_boxes else REJECTED), looked
        top = height - 1
        nearest = 0.0
        diagonal = 0.0
        for k in range(3):
            nearest += max(abs(centres[top, k]) - halves[top, k], 0.0) ** 2
            diagonal += halves[top, k] ** 2
        if nearest > np.pi**2:
            height = top
            continue
        diagonal = np.sqrt(diagonal)
        for a in range(3):
            step[a] = 0.0
            for k in range(3):
                step[a] += axes[top, a, k] * centres[top, k]
        # Turn about the contacts' mean, which is where the object is held best.
        for k in range(3):
            held[k] = 0.0
            for a in range(3):
                held[k] += turns[top, a, k] * (pivot[a] - shifts[top, a])
        move(turns[top], shifts[top], step, held, 1.0, rotation, translation)
        box_angle = min(diagonal, np.pi)
        ball[:] = rotation
        chosen = targets[top, :count].copy()
        # Their mean is about 1; none may vanish for good.
        weights[:count] = kept[top, :count] + FLOOR
        outcome, bound, worst, where = judge(
            count,
            faces,
            chosen,
            contacts,
            model,
            ball,
            box_angle,
            STEPS,
            looked > 0,
            rotation,
            translation,
            work,
        )
        if outcome == FEASIBLE:
            return FEASIBLE, looked
        if outcome == REJECTED:
            height = top
            continue
        if worst < least:
            least = worst
            best_turn[:], best_shift[:] = rotation, translation
        small = diagonal < FINEST
        kept[top, :count] = weights[:count]
        if outcome == UNDECIDED and (diagonal < FINE or looked % SEEK == 0 or worst < NEARLY):
            turned[:], shifted[:] = rotation, translation
            outcome = seek_feasible(
                count, faces, chosen, contacts, model, 60, True, ball, bound, turned, shifted, work
            )
            if outcome == REJECTED:
                height = top
                continue
            if outcome == FEASIBLE:
                rotation[:], translation[:] = turned, shifted
                worst, where = worst_on_pieces(
                    count, faces, chosen, work[3][0], model, contacts, readings
                )
                if worst <= 1.0 + EXACT:
                    return FEASIBLE, looked
                outcome = BESIDE
            elif small:
                open_boxes = True
                height = top
                continue
            else:
                # The region is to be about the verdict's pose again.
                carry(count, contacts[0], contacts[1], rotation, translation, x, u)
                read(count, faces, chosen, x, u, model, contacts, readings)
                weights[:count] = kept[top, :count]
                locate(count, faces, chosen, model, contacts, rotation, ball, bound, work)
        if outcome == BESIDE:
            # Every bound is met on the hulls, but this contact is beside its concave face.
            f = faces[where]
            if height + first[f + 1] - first[f] > STACK:
                return UNDECIDED, most
            height = top
            for p in range(first[f], first[f + 1]):
                turns[height], shifts[height] = turns[top], shifts[top]
                axes[height], centres[height] = axes[top], centres[top]
                halves[height] = halves[top]
                targets[height, :count] = chosen
                targets[height, where] = p
                kept[height, :count] = weights[:count]
                height += 1
            continue
        if height == STACK:
            return UNDECIDED, most
        # The region that the verdict left may be smaller than the box.
        if _volume(region) < WORTHWHILE * halves[top, 0] * halves[top, 1] * halves[top, 2]:
            turns[top], shifts[top] = rotation, translation
            _box_region(region, axes[top], centres[top], halves[top])
        longest = 0
        for k in range(1, 3):
            if halves[top, k] > halves[top, longest]:
                longest = k
        halves[top, longest] *= 0.5
        turns[height], shifts[height] = turns[top], shifts[top]
        axes[height], centres[height] = axes[top], centres[top]
        halves[height] = halves[top]
        targets[height, :count] = chosen
        kept[top, :count] = weights[:count]
        kept[height, :count] = weights[:count]
        centres[top, longest] -= halves[top, longest]
        centres[height, longest] += halves[top, longest]
        height += 1
    rotation[:], translation[:] = best_turn, best_shift
    return UNDECIDED, most


@njit(cache=True)
def box_stack(count):
    """A stack of boxes for `search_poses`: poses, axes, centres, half sides, polygons, weights."""
    return (
        np.empty((STACK, 3, 3)),
        np.empty((STACK, 3)),
        np.empty((STACK, 3, 3)),
        np.empty((STACK, 3)),
        np.empty((STACK, 3)),
        np.empty((STACK, count), np.int64),
        np.empty((STACK, count, 2)),
    )
