"""Compiled fit of a pose by weighted readings, and the multipliers of a proof that they make.

What a weighted least-squares fit leaves over of its readings, times their weights, is in balance:
no small motion of the object lowers the sum. That is what a proof that no pose meets all bounds
needs of its multipliers, see `proof_kernels`.
"""

from __future__ import annotations

import numpy as np

from ...compiling import borrowing
from ...contacts.reading_kernels import ARC, NO_CONE
from ...models.polygon_kernels import EDGE, INSIDE
from ..motions.motion_kernels import solve
from .region_kernels import turn_between


@borrowing
def set_levers(count, faces, x, pivot, levers):
    """The mean of the contacts, and each contact less it."""
    pivot[:] = 0.0
    used = 0
    for i in range(count):
        if faces[i] < 0:
            continue
        used += 1
        for k in range(3):
            pivot[k] += x[i, k]
    for k in range(3):
        pivot[k] /= max(used, 1)
    for i in range(count):
        for k in range(3):
            levers[i, k] = x[i, k] - pivot[k]


@borrowing
def _add(lever, direction, weight, residual, system, gradient):
    """A weighted residual along a direction: a motion changes it by -w . (a x d) - s . d."""
    a0, a1, a2 = lever
    d0, d1, d2 = direction
    row = (a1 * d2 - a2 * d1, a2 * d0 - a0 * d2, a0 * d1 - a1 * d0, d0, d1, d2)
    for a in range(6):
        gradient[a] -= weight * residual * row[a]
        for b in range(a + 1):
            system[a, b] += weight * row[a] * row[b]


@borrowing
def assemble(count, faces, levers, u, normals, contacts, readings, weights, system, gradient):
    """Normal equations of the weighted readings, in place."""
    _, _, reaches, chords, sines = contacts
    gaps, _, heights, regions, kinds, misses, directions = readings
    system[:] = 0.0
    gradient[:] = 0.0
    for i in range(count):
        f = faces[i]
        if f < 0:
            continue
        lever = (levers[i, 0], levers[i, 1], levers[i, 2])
        inverse = 1.0 / reaches[i]
        weight = weights[i, 0] * inverse * inverse
        if regions[i] == INSIDE or regions[i] == EDGE:
            m0, m1, m2 = normals[f, 0], normals[f, 1], normals[f, 2]
            h = heights[i]
            _add(lever, (m0, m1, m2), weight, h, system, gradient)
            if regions[i] == EDGE:
                g0, g1, g2 = gaps[i, 0] - h * m0, gaps[i, 1] - h * m1, gaps[i, 2] - h * m2
                out = np.sqrt(g0 * g0 + g1 * g1 + g2 * g2)
                if out > 0.0:
                    beyond = (g0 / out, g1 / out, g2 / out)
                    _add(lever, beyond, weight, out, system, gradient)
        else:
            _add(lever, (1.0, 0.0, 0.0), weight, gaps[i, 0], system, gradient)
            _add(lever, (0.0, 1.0, 0.0), weight, gaps[i, 1], system, gradient)
            _add(lever, (0.0, 0.0, 1.0), weight, gaps[i, 2], system, gradient)
        kind = kinds[i]
        if kind == NO_CONE:
            continue
        bound = sines[i] if kind == ARC else chords[i]
        weight = weights[i, 1] / (bound * bound)
        miss = misses[i]
        e0, e1, e2 = directions[i, 0], directions[i, 1], directions[i, 2]
        u0, u1, u2 = u[i, 0], u[i, 1], u[i, 2]
        t0, t1, t2 = e1 * u2 - e2 * u1, e2 * u0 - e0 * u2, e0 * u1 - e1 * u0
        gradient[0] += weight * miss * t0
        gradient[1] += weight * miss * t1
        gradient[2] += weight * miss * t2
        if kind == ARC:
            system[0, 0] += weight * t0 * t0
            system[1, 0] += weight * t1 * t0
            system[1, 1] += weight * t1 * t1
            system[2, 0] += weight * t2 * t0
            system[2, 1] += weight * t2 * t1
            system[2, 2] += weight * t2 * t2
        else:
            system[0, 0] += weight * (1.0 - u0 * u0)
            system[1, 0] -= weight * u1 * u0
            system[1, 1] += weight * (1.0 - u1 * u1)
            system[2, 0] -= weight * u2 * u0
            system[2, 1] -= weight * u2 * u1
            system[2, 2] += weight * (1.0 - u2 * u2)


@borrowing
def solve_in_ball(system, gradient, factor, step, rotation, ball, angle, radius, offset):
    """The weighted fit's step, held to the ball: beyond it no reading can be met."""
    # As little as keeps the system regular where no contact bears on a freedom.
    least = 1e-12 * (system[3, 3] + system[4, 4] + system[5, 5])
    for a in range(3):
        system[a, a] += least * radius * radius
        system[3 + a, 3 + a] += least
    solve(system, gradient, 0.0, factor, step)
    hold = 1e-3 * (system[0, 0] + system[1, 1] + system[2, 2])
    off = turn_between(rotation, ball, offset)
    for _ in range(10):
        far = 0.0
        for a in range(3):
            far += (step[a] - offset[a]) ** 2
        if far <= 1.1 * angle * angle or off > 1.5:
            break
        for a in range(3):
            system[a, a] += hold
            gradient[a] -= hold * offset[a]
        solve(system, gradient, 0.0, factor, step)
        hold *= 4.0


@borrowing
def set_multipliers(
    count, faces, levers, u, normals, contacts, readings, weights, step, multipliers
):
    """The weighted readings as the fit's step would leave them: in balance to rounding.

    Args:
        count: how many contacts count.
        faces: (n,) the feature of each contact, -1 for none.
        levers: (n, 3) contacts less the pivot, object frame.
        u: (n, 3) measured normals, object frame.
        normals: (f, 3) normals of the features' planes.
        contacts: see `pose.kernel_contacts`.
        readings: see `reading_kernels.read`.
        weights: (n, 2) of positions and normals.
        step: (6,) the weighted fit's.
        multipliers: (n, 3) of positions and (n, 3) of normals, written in place.
    """
    _, _, reaches, chords, sines = contacts
    gaps, _, heights, regions, kinds, misses, directions = readings
    pulls, twists = multipliers
    w0, w1, w2 = step[0], step[1], step[2]
    for i in range(count):
        f = faces[i]
        pulls[i] = 0.0
        twists[i] = 0.0
        if f < 0:
            continue
        weight = weights[i, 0] / (reaches[i] * reaches[i])
        a0, a1, a2 = levers[i, 0], levers[i, 1], levers[i, 2]
        s0 = w1 * a2 - w2 * a1 + step[3]
        s1 = w2 * a0 - w0 * a2 + step[4]
        s2 = w0 * a1 - w1 * a0 + step[5]
        if regions[i] == INSIDE or regions[i] == EDGE:
            m0, m1, m2 = normals[f, 0], normals[f, 1], normals[f, 2]
            h = heights[i]
            left = weight * (h - (m0 * s0 + m1 * s1 + m2 * s2))
            pulls[i, 0], pulls[i, 1], pulls[i, 2] = left * m0, left * m1, left * m2
            if regions[i] == EDGE:
                g0, g1, g2 = gaps[i, 0] - h * m0, gaps[i, 1] - h * m1, gaps[i, 2] - h * m2
                out = np.sqrt(g0 * g0 + g1 * g1 + g2 * g2)
                if out > 0.0:
                    g0, g1, g2 = g0 / out, g1 / out, g2 / out
                    left = weight * (out - (g0 * s0 + g1 * s1 + g2 * s2))
                    pulls[i, 0] += left * g0
                    pulls[i, 1] += left * g1
                    pulls[i, 2] += left * g2
        else:
            pulls[i, 0] = weight * (gaps[i, 0] - s0)
            pulls[i, 1] = weight * (gaps[i, 1] - s1)
            pulls[i, 2] = weight * (gaps[i, 2] - s2)
        kind = kinds[i]
        if kind == NO_CONE:
            continue
        bound = sines[i] if kind == ARC else chords[i]
        weight = weights[i, 1] / (bound * bound)
        e0, e1, e2 = directions[i, 0], directions[i, 1], directions[i, 2]
        u0, u1, u2 = u[i, 0], u[i, 1], u[i, 2]
        t0, t1, t2 = u1 * w2 - u2 * w1, u2 * w0 - u0 * w2, u0 * w1 - u1 * w0
        if kind == ARC:
            left = weight * (misses[i] + e0 * t0 + e1 * t1 + e2 * t2)
            twists[i, 0], twists[i, 1], twists[i, 2] = left * e0, left * e1, left * e2
        else:
            twists[i, 0] = weight * (misses[i] * e0 + t0)
            twists[i, 1] = weight * (misses[i] * e1 + t1)
            twists[i, 2] = weight * (misses[i] * e2 + t2)
