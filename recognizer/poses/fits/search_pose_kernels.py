"""Compiled branch and bound over poses: a witness, or a proof that there is none.

Where one verdict over all rotations stays open, the rotations it left are cut into boxes
``R exp(V v)`` about its pose, along the axes ``V`` of its region, and each is judged by itself: the
smaller a box, the smaller the remainders that its proof has to allow for. Two turns ``exp(v)`` and
``exp(w)`` are at most ``|v - w|`` apart, so a ball of a box's half diagonal holds it.
"""

from __future__ import annotations

import numpy as np

from ...compiling import borrowing, kernel
from ...contacts.reading_kernels import carry, read, worst_on_pieces
from ..motions.motion_kernels import copy_pose, copy_rotation, move
from ..proofs.multiplier_kernels import set_levers
from ..proofs.proof_kernels import locate
from ..proofs.shrink_kernels import box_region, shrink_box, shrink_space
from ..proofs.turn_kernels import note_turns, open_turns, turn_space
from .feasibility_kernels import seek_feasible
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
WIDE = 0.8
"""Half a diagonal (radians) above which a box is cut without a verdict, which would stay open: of
such boxes there are never more than a few hundred."""
FLOOR = 0.02
"""What a weight starts with again in every box."""
WORTHWHILE = 0.3
"""A region is cut instead of the box it came from, if its volume is below this share of it."""


@borrowing
def _volume(region):
    """Of the ellipsoid of rotations, up to a factor: of half the sides of the box around it."""
    m = region[1]
    determinant = (
        m[0, 0] * (m[1, 1] * m[2, 2] - m[1, 2] * m[1, 2])
        - m[0, 1] * (m[0, 1] * m[2, 2] - m[1, 2] * m[0, 2])
        + m[0, 2] * (m[0, 1] * m[1, 2] - m[1, 1] * m[0, 2])
    )
    return np.sqrt(max(determinant, 0.0))


@borrowing
def _copy_weights(count, weights, kept):
    for i in range(count):
        for k in range(2):
            kept[i, k] = weights[i, k]


@borrowing
def _copy_box(count, box, at, chosen, weights, stack):
    """Write a box of the stack to another place of it, with these polygons and weights."""
    turns, shifts, axes, centres, halves, targets, kept, _, _, _ = stack
    copy_pose(turns[box], shifts[box], turns[at], shifts[at])
    copy_rotation(axes[box], axes[at])
    for k in range(3):
        centres[at, k] = centres[box, k]
        halves[at, k] = halves[box, k]
    for i in range(count):
        targets[at, i] = chosen[i]
    _copy_weights(count, weights, kept[at])


@borrowing
def _halve(count, top, height, chosen, weights, stack):
    """Cut a box across its longest side: one half takes its place, the other one the next free."""
    centres, halves = stack[3], stack[4]
    longest = 0
    for k in range(1, 3):
        if halves[top, k] > halves[top, longest]:
            longest = k
    halves[top, longest] *= 0.5
    _copy_box(count, top, height, chosen, weights, stack)
    centres[top, longest] -= halves[top, longest]
    centres[height, longest] += halves[top, longest]


@borrowing
def search_poses(count, faces, contacts, model, angle, most, rotation, translation, work, stack):
    """Search all poses of an interpretation, from one that `judge` may have left.

    Args:
        count: how many contacts count.
        faces: (n,) the feature of each contact, -1 for none.
        contacts: see `pose.kernel_contacts`.
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
    x, u, levers, weights = work[3]
    turns, shifts, axes, centres, halves, targets, kept, space, facing, shrinking = stack
    (ball, turned, best_turn), (shifted, best_shift, held, pivot), step = space
    form = work[2][0]
    chosen = targets[STACK]
    copy_pose(rotation, translation, best_turn, best_shift)
    step[:] = 0.0
    pivot[:] = 0.0
    used = 0
    for i in range(count):
        if faces[i] >= 0:
            used += 1
            for k in range(3):
                pivot[k] += contacts[0][i, k]
    for k in range(3):
        pivot[k] /= max(used, 1)
    copy_pose(rotation, translation, turns[0], shifts[0])
    if angle < 1.5:
        box_region(region, axes[0], centres[0], halves[0], form)
        carry(count, contacts[0], contacts[1], rotation, translation, x, u)
        set_levers(count, faces, x, work[5][2], levers)
        if not shrink_box(
            count,
            faces,
            faces,
            x,
            levers,
            u,
            model,
            contacts,
            region,
            axes[0],
            centres[0],
            halves[0],
            shrinking,
        ):
            return REJECTED, 0
    else:
        for a in range(3):
            for b in range(3):
                axes[0, a, b] = 1.0 if a == b else 0.0
        centres[0], halves[0] = 0.0, min(angle, np.pi)
    for i in range(count):
        targets[0, i] = faces[i]
    note_turns(count, faces, contacts, model, facing)
    height = 1
    looked = 0
    open_boxes = False
    least = np.inf
    while looked < most:
        if height == 0:
            copy_pose(best_turn, best_shift, rotation, translation)
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
        # Each such box is half of one that was looked at or of one of a few wide ones.
        if not open_turns(count, faces, contacts, model, rotation, box_angle, facing):
            height = top
            continue
        for i in range(count):
            chosen[i] = targets[top, i]
        if diagonal > WIDE and looked > 0 and height < STACK:
            _halve(count, top, height, chosen, kept[top], stack)
            height += 1
            continue
        copy_rotation(rotation, ball)
        for i in range(count):
            # Their mean is about 1; none may vanish for good.
            for k in range(2):
                weights[i, k] = kept[top, i, k] + FLOOR
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
        looked += 1
        if outcome == FEASIBLE:
            return FEASIBLE, looked
        if outcome == REJECTED:
            height = top
            continue
        if worst < least:
            least = worst
            copy_pose(rotation, translation, best_turn, best_shift)
        small = diagonal < FINEST
        _copy_weights(count, weights, kept[top])
        if outcome == UNDECIDED and (diagonal < FINE or looked % SEEK == 1 or worst < NEARLY):
            copy_pose(rotation, translation, turned, shifted)
            outcome = seek_feasible(
                count, faces, chosen, contacts, model, 60, True, ball, bound, turned, shifted, work
            )
            if outcome == REJECTED:
                height = top
                continue
            if outcome == FEASIBLE:
                copy_pose(turned, shifted, rotation, translation)
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
                _copy_weights(count, kept[top], weights)
                locate(count, faces, chosen, model, contacts, rotation, ball, bound, work)
        if outcome == BESIDE:
            # Every bound is met on the hulls, but this contact is beside its concave face.
            f = faces[where]
            if height + first[f + 1] - first[f] > STACK:
                return UNDECIDED, most
            # The last first: it may take this box's own place.
            for p in range(first[f + 1] - 1, first[f] - 1, -1):
                at = top + p - first[f]
                _copy_box(count, top, at, chosen, weights, stack)
                targets[at, where] = p
            height = top + first[f + 1] - first[f]
            continue
        if height == STACK:
            return UNDECIDED, most
        # The region that the verdict left may be smaller than the box.
        if _volume(region) < WORTHWHILE * halves[top, 0] * halves[top, 1] * halves[top, 2]:
            copy_pose(rotation, translation, turns[top], shifts[top])
            box_region(region, axes[top], centres[top], halves[top], form)
        _copy_weights(count, weights, kept[top])
        _halve(count, top, height, chosen, weights, stack)
        height += 1
    copy_pose(best_turn, best_shift, rotation, translation)
    return UNDECIDED, most


@kernel
def box_stack(count):
    """A stack of boxes for `search_poses`: poses, axes, centres, half sides, polygons, weights.

    Behind them work space; a last row of polygons is part of it.
    """
    return (
        np.empty((STACK, 3, 3)),
        np.empty((STACK, 3)),
        np.empty((STACK, 3, 3)),
        np.empty((STACK, 3)),
        np.empty((STACK, 3)),
        np.empty((STACK + 1, count), np.int64),
        np.empty((STACK, count, 2)),
        (
            (np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))),
            (np.empty(3), np.empty(3), np.empty(3), np.empty(3)),
            np.empty(6),
        ),
        turn_space(count),
        shrink_space(count),
    )
