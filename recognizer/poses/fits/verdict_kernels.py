"""Compiled verdict on an interpretation: a pose within all bounds, or a proof that there is none.

Two sides of one minimax problem. With each reading in units of its bound, a pose that brings the
largest below 1 is a witness. It is sought by weighted least squares, with the weights of large
readings raised from step to step (Lawson's algorithm), and the same weights are tried as
multipliers of a proof, see `proof_kernels`.
"""

from __future__ import annotations

import numpy as np

from ...compiling import borrowing
from ...contacts.reading_kernels import ARC, NO_CONE, carry, read, worst_on_pieces
from ..motions.motion_kernels import copy_pose, copy_rotation, move
from ..proofs.proof_kernels import disprove, locate

REJECTED, FEASIBLE, UNDECIDED, BESIDE = 0, 1, 2, 3
"""No pose meets the bounds; the pose found meets them; neither could be shown; the pose found meets
them on convex hulls, but a contact is beside its concave face."""
SETTLING = 3
"""The most moves to the region's own centre, each a Newton step. Most of what is rejected there is
rejected by then; the rest is left to proofs and boxes sooner."""
EXACT = 1e-9
"""By how much a witness may exceed a bound, as a share of it: rounding."""
LONGEST_TURN = 0.3
"""The longest step of the fit, radians: its linear picture holds no farther."""


@borrowing
def _raise_weights(count, faces, contacts, readings, weights):
    """Lawson: a reading counts by how large it is."""
    _, _, reaches, chords, sines = contacts
    _, lengths, _, _, kinds, misses, _ = readings
    total = 0.0
    for i in range(count):
        if faces[i] < 0:
            continue
        weights[i, 0] *= lengths[i] / reaches[i] + 1e-3
        share = 0.0
        if kinds[i] != NO_CONE:
            share = misses[i] / (sines[i] if kinds[i] == ARC else chords[i])
        weights[i, 1] *= share + 1e-3
        total += weights[i, 0] + weights[i, 1]
    for i in range(count):
        weights[i, 0] *= 2.0 * count / total
        weights[i, 1] *= 2.0 * count / total


@borrowing
def judge(
    count, faces, targets, contacts, model, ball, angle, most, warm, rotation, translation, work
):
    """Judge an interpretation of the first contacts from a starting pose.

    Args:
        count: how many contacts count.
        faces: (n,) the feature of each contact, -1 for none.
        targets: (n,) the polygon that stands for it.
        contacts: see `pose.kernel_contacts`.
        model: likewise.
        ball: (3, 3) a rotation, near the starting one, that none within the bounds is farther from
            than ...
        angle: ... this angle, radians. A smaller ball that comes to light replaces it in place.
        most: the most steps once settled.
        warm: whether the weights in the work space are to be used, and nothing settled: those of
            a verdict on much the same poses.
        rotation: (3, 3) object to world, moved in place.
        translation: (3,) likewise.
        work: see `workspace`.

    Returns:
        The verdict; the angle of the ball; the largest reading in bounds; for `BESIDE` the contact.
    """
    points, measured, reaches, _, _ = contacts
    readings, region, _, rows, _, vectors, frames, _, _ = work
    x, u, _, weights = rows
    _, step, pivot, shifted = vectors
    turned = frames[0]
    centre = region[2]
    settled = SETTLING if warm else 0
    taken = 0
    if not warm:
        weights[:count] = 1.0
    while True:
        carry(count, points, measured, rotation, translation, x, u)
        worst = read(count, faces, targets, x, u, model, contacts, readings)
        if worst <= 1.0 + EXACT:
            exact, where = worst_on_pieces(count, faces, targets, x, model, contacts, readings)
            return (FEASIBLE if exact <= 1.0 + EXACT else BESIDE), angle, exact, where
        if settled < SETTLING:
            # The region's own centre is the best fit by heights and normals: go there.
            bound, about = locate(
                count, faces, targets, model, contacts, rotation, ball, angle, work
            )
            if bound < 0.0:
                return REJECTED, 0.0, worst, 0
            for a in range(6):
                step[a] = centre[a]
            move(rotation, translation, step, pivot, 1.0, turned, shifted)
            copy_pose(turned, shifted, rotation, translation)
            if about < angle:
                angle = about
                copy_rotation(rotation, ball)
            turn = np.sqrt(step[0] ** 2 + step[1] ** 2 + step[2] ** 2)
            shift = np.sqrt(step[3] ** 2 + step[4] ** 2 + step[5] ** 2)
            settled += 1
            if turn * model[6] + shift < 0.2 * reaches[0]:
                settled = SETTLING
            continue
        if taken > 0:
            _raise_weights(count, faces, contacts, readings, weights)
        # At the end in any case: the region returned has to be about the pose returned.
        proved, bound = disprove(
            count, faces, targets, model, contacts, rotation, ball, angle, taken == most, work
        )
        if proved:
            return REJECTED, 0.0, worst, 0
        if bound < angle:
            angle = bound
            copy_rotation(rotation, ball)
        if taken == most:
            return UNDECIDED, angle, worst, 0
        taken += 1
        turn = np.sqrt(step[0] ** 2 + step[1] ** 2 + step[2] ** 2)
        if turn > LONGEST_TURN:
            for a in range(6):
                step[a] *= LONGEST_TURN / turn
        move(rotation, translation, step, pivot, 1.0, turned, shifted)
        copy_pose(turned, shifted, rotation, translation)
