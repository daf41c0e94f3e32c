"""Compiled proof: no pose within a ball of rotations brings all readings inside their bounds.

The same interior-point method as in `feasibility_kernels`, on a convex problem that every pose of
the ball solves, so that its optimum is a bound for all of them.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from .feasibility_kernels import EXACT, UNKNOWN_NORMAL, assemble_barrier, worst_excess
from .motion_kernels import solve

CLEARLY_ABOVE = 1e-3
"""The lower bound on the largest ``g`` that excludes a pose set. The truth has ``g <= 0`` in every
reading, so this is margin against rounding alone."""
MOST_STEPS = 80
FOUND, EXCLUDED, OPEN = 1, 0, 2
"""A feasible point was found; none exists; neither could be shown."""


@njit(cache=True)
def seek_in_ball(x, u, pivot, limit, faces, targets, contacts, model, motion):
    """Is there a pose within a rotation of ``limit`` of this one that meets the bounds?

    A rotation by w turns an arm a into ``a - w x a`` up to ``|a| |w|^2 / 2`` (Taylor). With every
    bound widened by that much at ``|w| = limit``, the problem in the linear terms is convex, every
    true pose of the ball solves it, and the gap of its interior-point method is a proof. The shift
    is free.

    Args:
        x: (n, 3) contacts at the ball's centre, object frame.
        u: (n, 3) measured normals there, object frame.
        pivot: (3,) the point to turn about; best the contacts' mean.
        limit: the ball's radius, radians.
        faces: (n,) the face of each contact.
        targets: (n,) the polygon that stands for that face.
        contacts: positions, normals, position bounds, bounds on chords; world frame.
        model: see `pose_kernels.test_interpretations`.
        motion: (7,) the solution's small motion about ``pivot``, written in place.

    Returns:
        FOUND: the widened bounds are met by ``motion``; EXCLUDED: they can't be met, so the ball
        holds no pose; OPEN: not settled.
    """
    _, _, reaches, chords = contacts
    radius = model[6]
    count = len(x)
    arms = np.empty((count, 3))
    wide = np.empty(count)
    loose = np.empty(count)
    for i in range(count):
        length = 0.0
        for k in range(3):
            arms[i, k] = x[i, k] - pivot[k]
            length += arms[i, k] * arms[i, k]
        wide[i] = reaches[i] + 0.5 * limit * limit * np.sqrt(length)
        loose[i] = min(chords[i] + 0.5 * limit * limit, UNKNOWN_NORMAL)
    moved_x = x.copy()
    moved_u = u.copy()
    system = np.empty((7, 7))
    gradient = np.empty(7)
    factor = np.zeros((7, 7))
    step = np.empty(7)
    trial = np.empty(7)
    turn = np.empty(3)
    motion[:] = 0.0
    worst, _ = worst_excess(x, u, faces, targets, wide, loose, model, False)
    if worst <= EXACT:
        return FOUND
    readings = 2.0 * count + 1.0
    level = worst + 0.5 * (1.0 + worst)
    sharpness = readings / (1.0 + worst)
    widest = limit * radius
    value = np.inf
    motion[6] = level
    trial[:] = motion
    share = 1.0
    decrement = 0.0
    for _ in range(MOST_STEPS):
        # Evaluate at the trial point; on the first round that is the start itself.
        for i in range(count):
            for k in range(3):
                turn[k] = trial[k] / radius
            w0, w1, w2 = turn[0], turn[1], turn[2]
            a0, a1, a2 = arms[i, 0], arms[i, 1], arms[i, 2]
            moved_x[i, 0] = x[i, 0] - (w1 * a2 - w2 * a1) - trial[3]
            moved_x[i, 1] = x[i, 1] - (w2 * a0 - w0 * a2) - trial[4]
            moved_x[i, 2] = x[i, 2] - (w0 * a1 - w1 * a0) - trial[5]
            b0, b1, b2 = u[i, 0], u[i, 1], u[i, 2]
            moved_u[i, 0] = b0 + b1 * w2 - b2 * w1
            moved_u[i, 1] = b1 + b2 * w0 - b0 * w2
            moved_u[i, 2] = b2 + b0 * w1 - b1 * w0
        reached = assemble_barrier(
            trial[6],
            moved_x,
            moved_u,
            arms,
            u,
            faces,
            targets,
            wide,
            loose,
            model,
            system,
            gradient,
        )
        turned = trial[0] * trial[0] + trial[1] * trial[1] + trial[2] * trial[2]
        room = trial[6] - (turned / (widest * widest) - 1.0)
        if room <= 0.0:
            reached = np.inf
        if reached < np.inf:
            reached -= np.log(room)
        change = reached - value + sharpness * (trial[6] - motion[6])
        if value < np.inf and not change <= -0.01 * share * decrement:
            share *= 0.5
            if share < 1e-9:
                return OPEN
            for a in range(7):
                trial[a] = motion[a] + share * step[a]
            continue
        value = reached
        motion[:] = trial
        if motion[6] <= EXACT:
            return FOUND
        worst, _ = worst_excess(moved_x, moved_u, faces, targets, wide, loose, model, False)
        if worst <= EXACT and turned <= widest * widest:
            return FOUND
        hold = 1.0 / room
        bend = 2.0 / (widest * widest)
        for a in range(3):
            slope = bend * motion[a]
            gradient[a] += hold * slope
            system[6, a] -= hold * hold * slope
            system[a, a] += hold * bend
            for b in range(a + 1):
                system[a, b] += hold * hold * slope * bend * motion[b]
        gradient[6] -= hold
        system[6, 6] += hold * hold
        while True:
            gradient[6] += sharpness
            solve(system, gradient, 1e-9 / (radius * radius), factor, step)
            decrement = 0.0
            for a in range(7):
                decrement -= gradient[a] * step[a]
            gradient[6] -= sharpness
            if decrement >= 0.25:
                break
            # At the centre for this sharpness the optimum is at most readings / sharpness below;
            # twice that covers being only near the centre.
            gap = 2.0 * readings / sharpness
            if motion[6] - gap > CLEARLY_ABOVE:
                return EXCLUDED
            if gap < 0.1 * CLEARLY_ABOVE:
                return OPEN
            sharpness *= 10.0
        share = 1.0
        for a in range(7):
            trial[a] = motion[a] + step[a]
    return OPEN
