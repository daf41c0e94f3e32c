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
from numba import njit

from .motion_kernels import cross, move, slope_row, solve, to_object
from .polygon_kernels import CORNER, INSIDE, nearest_in_polygon

EXACT = 1e-9
"""What the largest ``g`` of a witness may be: rounding."""
UNKNOWN_NORMAL = 2.0
"""A chord no two unit vectors exceed: a bound this wide says nothing."""


@njit(cache=True)
def _outer(row, weight, system):
    for a in range(6):
        for b in range(a + 1):
            system[a, b] += weight * row[a] * row[b]


@njit(cache=True)
def assemble_barrier(
    level, x, u, arms, bases, faces, targets, reaches, chords, model, system, gradient
):
    """Value and derivatives of ``-sum log(level - g)`` at one pose and level.

    Args:
        level: the ``s`` of the barrier.
        x: (n, 3) contacts, object frame.
        u: (n, 3) measured normals, object frame.
        arms: (n, 3) lever of each contact: a small rotation w changes x by ``-w x arm``.
        bases: (n, 3) lever of each normal: w changes u by ``base x w``.
        faces: (n,) the face of each contact.
        targets: (n,) the polygon that stands for that face.
        reaches: (n,) bounds on distances, metres.
        chords: (n,) bounds on chords between normals.
        model: see `pose_kernels.test_interpretations`.
        system: (7, 7) lower triangle of the Hessian in motion and level, written in place.
        gradient: (7,) written in place.

    Returns:
        The value, infinity if some ``g`` is not below the level.
    """
    normals, offsets, _, start, corners, _, radius = model
    up = np.empty(6)
    out = np.empty(6)
    slope = np.empty(6)
    turn = np.empty(3)
    nearest = np.empty(3)
    direction = np.empty(3)
    system[:] = 0.0
    gradient[:] = 0.0
    value = 0.0
    for i in range(len(x)):
        m = normals[faces[i]]
        p = targets[i]
        squared, height, region = nearest_in_polygon(
            x[i], m, offsets[faces[i]], corners, start[p], start[p + 1], nearest
        )
        inverse = 1.0 / (reaches[i] * reaches[i])
        room = level - (squared * inverse - 1.0)
        if room <= 0.0:
            return np.inf
        value -= np.log(room)
        hold = 1.0 / room
        bend = 2.0 * inverse * hold
        slope_row(m, arms[i], radius, turn, up)
        _outer(up, bend, system)
        for a in range(6):
            slope[a] = 2.0 * inverse * height * up[a]
        outside = np.sqrt(max(squared - height * height, 0.0))
        if region != INSIDE and outside > 0.0:
            for k in range(3):
                direction[k] = (x[i, k] - height * m[k] - nearest[k]) / outside
            slope_row(direction, arms[i], radius, turn, out)
            _outer(out, bend, system)
            for a in range(6):
                slope[a] += 2.0 * inverse * outside * out[a]
            if region == CORNER:
                cross(m, direction, turn)
                direction[:] = turn
                slope_row(direction, arms[i], radius, turn, out)
                _outer(out, bend, system)
        _outer(slope, hold * hold, system)
        for a in range(6):
            gradient[a] += hold * slope[a]
            system[6, a] -= hold * hold * slope[a]
        gradient[6] -= hold
        system[6, 6] += hold * hold
        if chords[i] >= UNKNOWN_NORMAL:
            continue
        inverse = 1.0 / (chords[i] * chords[i])
        squared = 0.0
        length = 0.0
        for a in range(3):
            direction[a] = u[i, a] - m[a]
            squared += direction[a] * direction[a]
            length += bases[i, a] * bases[i, a]
        room = level - (squared * inverse - 1.0)
        if room <= 0.0:
            return np.inf
        value -= np.log(room)
        hold = 1.0 / room
        # |u + b x w - m|^2 changes by 2 (u - m) . (b x w) = 2 w . ((u - m) x b).
        cross(direction, bases[i], turn)
        bend = 2.0 * inverse * hold / (radius * radius)
        for a in range(3):
            slope[a] = 2.0 * inverse * turn[a] / radius
            gradient[a] += hold * slope[a]
            system[6, a] -= hold * hold * slope[a]
            system[a, a] += bend * length
            for b in range(a + 1):
                system[a, b] += hold * hold * slope[a] * slope[b]
                system[a, b] -= bend * bases[i, a] * bases[i, b]
        gradient[6] -= hold
        system[6, 6] += hold * hold
    return value


@njit(cache=True)
def worst_excess(x, u, faces, targets, reaches, chords, model, exact):
    """The largest ``g``, and the contact whose distance is worst.

    With ``exact`` a contact whose target is its face's hull is measured against the face itself.
    Other arguments as in `assemble_barrier`.
    """
    normals, offsets, first, start, corners, _, _ = model
    nearest = np.empty(3)
    worst = -1.0
    worst_distance = -np.inf
    where = 0
    for i in range(len(x)):
        f = faces[i]
        low, high = targets[i], targets[i] + 1
        if exact and targets[i] == f:
            low, high = first[f], first[f + 1]
        squared = np.inf
        for k in range(low, high):
            gap, _, _ = nearest_in_polygon(
                x[i], normals[f], offsets[f], corners, start[k], start[k + 1], nearest
            )
            squared = min(squared, gap)
        excess = squared / (reaches[i] * reaches[i]) - 1.0
        if excess > worst_distance:
            worst_distance = excess
            where = i
        worst = max(worst, excess)
        if chords[i] < UNKNOWN_NORMAL:
            squared = 0.0
            for a in range(3):
                squared += (u[i, a] - normals[f, a]) ** 2
            worst = max(worst, squared / (chords[i] * chords[i]) - 1.0)
    return worst, where


@njit(cache=True)
def seek_feasible(faces, targets, contacts, model, most, rotation, translation):
    """Lower the largest ``g`` from a starting pose; returns whether all bounds are met.

    A descent on a problem that rotations make non-convex: not finding a pose proves nothing.

    Args:
        faces: (n,) the face of each contact.
        targets: (n,) the polygon that stands for that face.
        contacts: positions, normals, position bounds, bounds on chords; world frame.
        model: see `pose_kernels.test_interpretations`.
        most: the most Newton steps.
        rotation: (3, 3) object to world, moved in place.
        translation: (3,) likewise, metres.
    """
    points, measured, reaches, chords = contacts
    centre, radius = model[5], model[6]
    count = len(points)
    x = np.empty((count, 3))
    u = np.empty((count, 3))
    system = np.empty((7, 7))
    gradient = np.empty(7)
    factor = np.zeros((7, 7))
    step = np.empty(7)
    part = np.empty(7)
    trial_rotation = np.empty((3, 3))
    trial_translation = np.empty(3)
    to_object(points, measured, rotation, translation, x, u)
    worst, _ = worst_excess(x, u, faces, targets, reaches, chords, model, False)
    if worst <= EXACT:
        return True
    readings = 2.0 * count
    level = worst + 0.5 * (1.0 + worst)
    sharpness = readings / (1.0 + worst)
    value = assemble_barrier(
        level, x, u, x - centre, u, faces, targets, reaches, chords, model, system, gradient
    )
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
        # At the centre for this sharpness the optimum is about readings / sharpness below.
        if decrement < 0.5:
            gap = 2.0 * readings / sharpness
            if gap < 0.02 * level or gap < 0.1 * EXACT:
                return False
            sharpness *= 10.0
            continue
        share = min(1.0, 0.3 * radius / np.sqrt(max(length, 1e-300)))
        moved = False
        trial = np.inf
        for _ in range(30):
            for a in range(7):
                part[a] = share * step[a]
            move(rotation, translation, part, centre, radius, trial_rotation, trial_translation)
            to_object(points, measured, trial_rotation, trial_translation, x, u)
            trial = assemble_barrier(
                level + part[6],
                x,
                u,
                x - centre,
                u,
                faces,
                targets,
                reaches,
                chords,
                model,
                system,
                gradient,
            )
            if trial - value + sharpness * part[6] <= -0.01 * share * decrement:
                moved = True
                break
            share *= 0.5
        if not moved:
            return False
        level += part[6]
        value = trial
        rotation[:] = trial_rotation
        translation[:] = trial_translation
        if level <= EXACT:
            return True
        worst, _ = worst_excess(x, u, faces, targets, reaches, chords, model, False)
        if worst <= EXACT:
            return True
    return False
