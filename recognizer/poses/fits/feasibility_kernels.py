"""Compiled interior-point method: bring all readings of an interpretation inside their bounds.

With ``q`` the squared distance of a contact from its face, or the squared chord between its normal
and the face's, and ``b`` the bound on it, each reading asks for ``g = q / b^2 - 1 <= 0``. The
largest ``g`` is lowered by an interior-point method (Boyd and Vandenberghe, Convex Optimization,
Section 11.4): minimise ``t s - sum log(s - g)`` over pose and ``s`` for growing ``t``. It sees all
bounds at once, those not yet touched too, so it doesn't creep along a corner between bounds as a
descent on the violated ones would.
"""

from __future__ import annotations

import numpy as np

from ...compiling import borrowing
from ...contacts.reading_kernels import ARC, NO_CONE, carry, read
from ...models.polygon_kernels import CORNER, INSIDE
from ..motions.motion_kernels import copy_pose, cross, move, slope_row, solve
from ..proofs.proof_kernels import disprove
from ..proofs.region_kernels import turn_between
from .verdict_kernels import FEASIBLE, REJECTED, UNDECIDED

EXACT = 1e-9
"""What the largest ``g`` of a witness may be: rounding."""


@borrowing
def _outer(row, weight, system):
    for a in range(6):
        for b in range(a + 1):
            system[a, b] += weight * row[a] * row[b]


@borrowing
def _assemble_barrier(
    level, count, faces, x, u, model, contacts, readings, system, gradient, space
):
    """Value and derivatives of ``-sum log(level - g)`` at one pose and level.

    Args:
        level: the ``s`` of the barrier.
        count: how many contacts count.
        faces: (n,) the feature of each contact, -1 for none.
        x: (n, 3) contacts, object frame.
        u: (n, 3) measured normals, object frame.
        model: see `pose.ModelTest`.
        contacts: likewise.
        readings: see `reading_kernels.read`.
        system: (7, 7) lower triangle of the Hessian in motion and level, written in place.
        gradient: (7,) written in place.
        space: vectors of `proof_kernels.barrier_workspace`.

    Returns:
        The value, infinity if some ``g`` is not below the level.
    """
    normals, centre, radius = model[0], model[5], model[6]
    _, _, reaches, chords, sines = contacts
    gaps, lengths, heights, regions, kinds, misses, directions = readings
    up, out, slope, turn, arm, direction = space
    system[:] = 0.0
    gradient[:] = 0.0
    value = 0.0
    for i in range(count):
        f = faces[i]
        if f < 0:
            continue
        m = normals[f]
        for k in range(3):
            arm[k] = x[i, k] - centre[k]
        squared, height = lengths[i] * lengths[i], heights[i]
        inverse = 1.0 / (reaches[i] * reaches[i])
        room = level - (squared * inverse - 1.0)
        if room <= 0.0:
            return np.inf
        value -= np.log(room)
        hold = 1.0 / room
        bend = 2.0 * inverse * hold
        slope_row(m, arm, radius, turn, up)
        _outer(up, bend, system)
        for a in range(6):
            slope[a] = 2.0 * inverse * height * up[a]
        outside = np.sqrt(max(squared - height * height, 0.0))
        if regions[i] != INSIDE and outside > 0.0:
            for k in range(3):
                direction[k] = (gaps[i, k] - height * m[k]) / outside
            slope_row(direction, arm, radius, turn, out)
            _outer(out, bend, system)
            for a in range(6):
                slope[a] += 2.0 * inverse * outside * out[a]
            if regions[i] == CORNER:
                cross(m, direction, turn)
                for k in range(3):
                    direction[k] = turn[k]
                slope_row(direction, arm, radius, turn, out)
                _outer(out, bend, system)
        _outer(slope, hold * hold, system)
        for a in range(6):
            gradient[a] += hold * slope[a]
            system[6, a] -= hold * hold * slope[a]
        gradient[6] -= hold
        system[6, 6] += hold * hold
        if kinds[i] == NO_CONE:
            continue
        bound = sines[i] if kinds[i] == ARC else chords[i]
        inverse = 1.0 / (bound * bound)
        room = level - (misses[i] * misses[i] * inverse - 1.0)
        if room <= 0.0:
            return np.inf
        value -= np.log(room)
        hold = 1.0 / room
        # A turn w changes u by u x w, and the miss along e by e . (u x w) = w . (e x u).
        cross(directions[i], u[i], turn)
        bend = 2.0 * inverse * hold / (radius * radius)
        for a in range(3):
            slope[a] = 2.0 * inverse * misses[i] * turn[a] / radius
            gradient[a] += hold * slope[a]
            system[6, a] -= hold * hold * slope[a]
            if kinds[i] != ARC:
                system[a, a] += bend
            for b in range(a + 1):
                system[a, b] += hold * hold * slope[a] * slope[b]
                if kinds[i] == ARC:
                    system[a, b] += bend * turn[a] * turn[b]
                else:
                    system[a, b] -= bend * u[i, a] * u[i, b]
        gradient[6] -= hold
        system[6, 6] += hold * hold
    return value


@borrowing
def _add_ball(level, turn, angle, radius, system, gradient):
    """The same for a rotation that is to stay in a ball; returns the value."""
    squared = 0.0
    for a in range(3):
        squared += turn[a] * turn[a]
    room = level - (squared / (angle * angle) - 1.0)
    if room <= 0.0:
        return np.inf
    hold = 1.0 / room
    bend = 2.0 / (angle * angle * radius * radius)
    for a in range(3):
        # The rotation vector from the ball's centre to the pose grows with a small motion.
        slope = bend * turn[a] * radius
        gradient[a] += hold * slope
        system[6, a] -= hold * hold * slope
        system[a, a] += hold * bend
        for b in range(a + 1):
            system[a, b] += hold * hold * slope * bend * turn[b] * radius
    gradient[6] -= hold
    system[6, 6] += hold * hold
    return -np.log(room)


@borrowing
def seek_feasible(
    count, faces, targets, contacts, model, most, prove, ball, angle, rotation, translation, work
):
    """Lower the largest ``g`` from a starting pose to a witness, or to a proof that there is none.

    The barrier's multipliers, ``1 / (s - g)``, are weights of a proof, see `proof_kernels`.

    Args:
        count: how many contacts count.
        faces: (n,) the feature of each contact, -1 for none.
        targets: (n,) the polygon that stands for that feature.
        contacts: see `pose.kernel_contacts`.
        model: likewise.
        most: the most Newton steps.
        prove: whether to try for a proof, and to stay in the ball.
        ball: (3, 3) a rotation that none within the bounds is farther from than ...
        angle: ... this angle, radians.
        rotation: (3, 3) object to world, moved in place.
        translation: (3,) likewise, metres.
        work: see `proof_kernels.workspace`.

    Returns:
        FEASIBLE, REJECTED or UNDECIDED (which proves nothing).
    """
    points, measured = contacts[0], contacts[1]
    centre, radius = model[5], model[6]
    readings, rows = work[0], work[3]
    x, u, weights = rows[0], rows[1], rows[3]
    (system, factor), (gradient, step, part), space, trial_pose = work[8]
    trial_rotation, trial_translation = trial_pose
    turn = space[3]
    carry(count, points, measured, rotation, translation, x, u)
    worst = read(count, faces, targets, x, u, model, contacts, readings) ** 2 - 1.0
    if worst <= EXACT:
        return FEASIBLE
    amount = 2.0 * count
    level = worst + 0.5 * (1.0 + worst)
    sharpness = amount / (1.0 + worst)
    value = _assemble_barrier(
        level, count, faces, x, u, model, contacts, readings, system, gradient, space
    )
    if prove:
        # The start may be a little outside.
        angle = max(angle, turn_between(ball, rotation, turn))
        value += _add_ball(level, turn, angle, radius, system, gradient)
    for _ in range(most):
        gradient[6] += sharpness
        solve(system, gradient, 1e-3 / (radius * radius), factor, step)
        decrement = 0.0
        length = 0.0
        for a in range(7):
            decrement -= gradient[a] * step[a]
        for a in range(6):
            length += step[a] * step[a]
        gradient[6] -= sharpness
        # At the centre for this sharpness the optimum is about amount / sharpness below.
        if decrement < 0.5:
            gap = 2.0 * amount / sharpness
            if prove and gap < level:
                # The readings are those of the last trial, which was accepted: this pose.
                for i in range(count):
                    if faces[i] < 0:
                        continue
                    share = readings[1][i] / contacts[2][i]
                    weights[i, 0] = 1.0 / (level - share * share + 1.0)
                    weights[i, 1] = 0.0
                    if readings[4][i] != NO_CONE:
                        bound = contacts[4][i] if readings[4][i] == ARC else contacts[3][i]
                        share = readings[5][i] / bound
                        weights[i, 1] = 1.0 / (level - share * share + 1.0)
                proved, _ = disprove(
                    count, faces, targets, model, contacts, rotation, ball, angle, False, work
                )
                if proved:
                    return REJECTED
            if gap < 0.02 * level or gap < 0.1 * EXACT:
                return UNDECIDED
            sharpness *= 10.0
            continue
        share = min(1.0, 0.3 * radius / np.sqrt(max(length, 1e-300)))
        moved = False
        trial = np.inf
        for _ in range(30):
            for a in range(7):
                part[a] = share * step[a]
            move(rotation, translation, part, centre, radius, trial_rotation, trial_translation)
            carry(count, points, measured, trial_rotation, trial_translation, x, u)
            worst = read(count, faces, targets, x, u, model, contacts, readings) ** 2 - 1.0
            trial = _assemble_barrier(
                *(level + part[6], count, faces, x, u, model, contacts, readings, system, gradient),
                space,
            )
            if prove and trial < np.inf:
                turn_between(ball, trial_rotation, turn)
                trial += _add_ball(level + part[6], turn, angle, radius, system, gradient)
            if trial - value + sharpness * part[6] <= -0.01 * share * decrement:
                moved = True
                break
            share *= 0.5
        if not moved:
            return UNDECIDED
        level += part[6]
        value = trial
        copy_pose(trial_rotation, trial_translation, rotation, translation)
        if level <= EXACT or worst <= EXACT:
            return FEASIBLE
    return UNDECIDED
