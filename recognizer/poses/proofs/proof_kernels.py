"""Compiled proof that no pose meets all bounds, from weights on the readings of one pose.

The weighted readings of a least-squares fit are multipliers (Farkas): whatever ``l_k`` are, any
pose within the bounds has ``sum l_k . x_k <= sum support(l_k) + |l_k| bound_k``. With gaps times
weights for ``l_k`` the left side is larger at this pose. Over the poses that `region_kernels`
leaves, it changes by a linear part, which is zero at the best fit, and by a quadratic one, of which
all contacts share a single (3, 3) form; a turn by an angle t scales the two by ``sin t / t`` and
``2 (1 - cos t) / t^2``, neither above 1. If that does not make up the difference, no pose meets the
bounds.
"""

from __future__ import annotations

import numpy as np

from ...compiling import borrowing, kernel
from ...contacts.reading_kernels import ARC, NO_CONE, cone_support
from .multiplier_kernels import assemble, set_levers, set_multipliers, solve_in_ball
from .region_kernels import (
    ball_radius,
    bound_region,
    largest_eigenvalue,
    region_workspace,
    square_root,
)

ROUNDING = 1e-6
"""By how much a proof has to hold, as a share of its sum of bounds: far above rounding."""


@borrowing
def _support(direction, corners, start, stop):
    """The most that any corner of a polygon has along a direction."""
    most = -np.inf
    d0, d1, d2 = direction[0], direction[1], direction[2]
    for c in range(start, stop):
        most = max(most, d0 * corners[c, 0] + d1 * corners[c, 1] + d2 * corners[c, 2])
    return most


@borrowing
def plain_margin(count, faces, targets, x, u, levers, model, contacts, readings, proof):
    """By how much multipliers ask for more than the bounds allow, at the pose alone.

    Args:
        count: how many contacts count.
        faces: (n,) the feature of each contact, -1 for none.
        targets: (n,) the polygon that stands for it.
        x: (n, 3) contacts, object frame.
        u: (n, 3) measured normals, object frame.
        levers: (n, 3) contacts less the pivot.
        model: see `pose.ModelTest`.
        contacts: likewise.
        readings: see `reading_kernels.read`.
        proof: `multiplier_kernels.set_multipliers`; gradient (6,) and form (3, 3) of what they ask
            for over small motions, written in place.

    Returns:
        The margin, and the sum of the bounds in it.
    """
    start, corners, cone_start, cone_normals = model[3], model[4], model[7], model[8]
    _, _, reaches, chords, sines = contacts
    kinds, directions = readings[4], readings[6]
    pulls, twists, slope, form = proof
    slope[:] = 0.0
    form[:] = 0.0
    margin = 0.0
    total = 0.0
    trace = 0.0
    for i in range(count):
        f = faces[i]
        if f < 0:
            continue
        l0, l1, l2 = pulls[i, 0], pulls[i, 1], pulls[i, 2]
        a0, a1, a2 = levers[i, 0], levers[i, 1], levers[i, 2]
        size = np.sqrt(l0 * l0 + l1 * l1 + l2 * l2)
        if size > 0.0:
            p = targets[i]
            margin += l0 * x[i, 0] + l1 * x[i, 1] + l2 * x[i, 2]
            margin -= _support(pulls[i], corners, start[p], start[p + 1]) + size * reaches[i]
            total += size * reaches[i]
            slope[0] -= a1 * l2 - a2 * l1
            slope[1] -= a2 * l0 - a0 * l2
            slope[2] -= a0 * l1 - a1 * l0
            slope[3] -= l0
            slope[4] -= l1
            slope[5] -= l2
            for a in range(3):
                trace += levers[i, a] * pulls[i, a]
                for b in range(3):
                    form[a, b] += levers[i, a] * pulls[i, b]
        if kinds[i] == NO_CONE:
            continue
        l0, l1, l2 = twists[i, 0], twists[i, 1], twists[i, 2]
        size = np.sqrt(l0 * l0 + l1 * l1 + l2 * l2)
        if size == 0.0:
            continue
        u0, u1, u2 = u[i, 0], u[i, 1], u[i, 2]
        along = l0 * u0 + l1 * u1 + l2 * u2
        d0, d1, d2 = directions[i, 0], directions[i, 1], directions[i, 2]
        outwards = l0 * d0 + l1 * d1 + l2 * d2 > 0.0
        if kinds[i] == ARC and (outwards or cone_start[f + 1] - cone_start[f] == 2):
            # Every normal of the cone has nothing, or less, along the axis of the arc.
            margin += along - size * sines[i]
            total += size * sines[i]
        else:
            most = cone_support(twists[i], cone_normals, cone_start[f], cone_start[f + 1])
            margin += along - most - size * chords[i]
            total += size * chords[i]
        slope[0] += l1 * u2 - l2 * u1
        slope[1] += l2 * u0 - l0 * u2
        slope[2] += l0 * u1 - l1 * u0
        for a in range(3):
            trace += u[i, a] * twists[i, a]
            for b in range(3):
                form[b, a] += u[i, b] * twists[i, a]
    for a in range(3):
        for b in range(a):
            mean = 0.5 * (form[a, b] + form[b, a])
            form[a, b] = mean
            form[b, a] = mean
        form[a, a] -= trace
    return margin, total


@borrowing
def motion_allowance(slope, form, angle, ball_angle, reach, region, product, root):
    """By how much motions within a region can lower what multipliers ask for.

    Args:
        slope: (6,) and form (3, 3), see `plain_margin`.
        form: likewise.
        angle: bounds every rotation of the region, radians.
        ball_angle: radius of the ball about the region's offset.
        reach: see `reach_of`.
        region: see `region_kernels.region_workspace`.
        product: (3, 3) work space.
        root: (3, 3) work space.
    """
    spread, inverse, centre, offset = region[0], region[1], region[2], region[4][2]
    # The quadratic part is w^T Q w / 2. Its least over w = L v, |v| <= 1, is that of L^T Q L: the
    # largest of -L^T Q L, negated.
    square_root(spread, root)
    for a in range(3):
        for b in range(3):
            value = 0.0
            for p in range(3):
                for q in range(3):
                    value -= root[p, a] * form[p, q] * root[q, b]
            product[a, b] = value
    bend = 0.5 * max(0.0, largest_eigenvalue(product))
    mean = 0.0
    size = 0.0
    for a in range(6):
        mean += slope[a] * centre[a]
        for b in range(6):
            size += slope[a] * inverse[a, b] * slope[b]
    linear = max(0.0, np.sqrt(max(size, 0.0)) - mean)
    # The ball alone may say more than the ellipsoid around all that is known.
    turn = np.sqrt(slope[0] ** 2 + slope[1] ** 2 + slope[2] ** 2)
    shift = np.sqrt(slope[3] ** 2 + slope[4] ** 2 + slope[5] ** 2)
    mean = slope[0] * offset[0] + slope[1] * offset[1] + slope[2] * offset[2]
    linear = min(linear, max(0.0, turn * ball_angle - mean) + shift * reach)
    # A turn by t scales the linear part by sin t / t.
    return linear + min(angle * angle / 6.0, 2.0) * angle * turn + bend


@kernel
def barrier_workspace():
    """Work space of `feasibility_kernels.seek_feasible`: systems, vectors, and a trial pose."""
    return (
        (np.empty((7, 7)), np.zeros((7, 7))),
        (np.empty(7), np.empty(7), np.empty(7)),
        (np.empty(6), np.empty(6), np.empty(6), np.empty(3), np.empty(3), np.empty(3)),
        (np.empty((3, 3)), np.empty(3)),
    )


@kernel
def workspace(count):
    """Work space of `judge` for a number of contacts."""
    readings = (
        np.empty((count, 3)),
        np.empty(count),
        np.empty(count),
        np.zeros(count, np.int64),
        np.zeros(count, np.int64),
        np.zeros(count),
        np.zeros((count, 3)),
    )
    return (
        readings,
        region_workspace(count),
        (np.empty((3, 3)), np.empty((3, 3))),
        (np.empty((count, 3)), np.empty((count, 3)), np.empty((count, 3)), np.empty((count, 2))),
        (np.empty((6, 6)), np.empty((6, 6))),
        (np.empty(6), np.empty(6), np.empty(3), np.empty(3)),
        (np.empty((3, 3)), np.empty((3, 3))),
        (np.empty((count, 3)), np.empty((count, 3)), np.empty(6), np.empty((3, 3))),
        barrier_workspace(),
    )


@borrowing
def reach_of(model, contacts, pivot):
    """A shift of the contacts' mean that no pose within the bounds exceeds, metres.

    At such a pose each contact is on the object, up to its bound. What cuts add (see `cut_kernels`)
    is no farther from the centroid than a contact and what was inside the object are apart, and
    neither is a place of the support plane.
    """
    away = 0.0
    for k in range(3):
        away += (pivot[k] - model[5][k]) ** 2
    most = 0.0
    for reach in contacts[2]:
        most = max(most, reach)
    return 8.0 * model[6] + 5.0 * most + np.sqrt(away)


@borrowing
def locate(count, faces, targets, model, contacts, rotation, ball, angle, work):
    """`region_kernels.bound_region` at a pose that has been read."""
    x, u, levers, _ = work[3]
    pivot = work[5][2]
    set_levers(count, faces, x, pivot, levers)
    bound, about = bound_region(
        count,
        faces,
        targets,
        x,
        levers,
        u,
        model,
        contacts,
        work[0],
        reach_of(model, contacts, pivot),
        rotation,
        ball,
        angle,
        work[1],
    )
    if bound >= 0.0 and _out_of_cone(count, faces, contacts, work[0], bound):
        return -1.0, 0.0
    return bound, about


@borrowing
def _out_of_cone(count, faces, contacts, readings, angle):
    """Whether some normal misses its cone by more than a turn by an angle can make good."""
    chords, sines = contacts[3], contacts[4]
    kinds, misses = readings[4], readings[5]
    # No turn moves a unit vector farther than its chord, 2 sin(angle / 2), or its angle.
    chord = 2.0 * np.sin(0.5 * min(angle, np.pi)) + ROUNDING
    for i in range(count):
        if faces[i] < 0 or kinds[i] == NO_CONE:
            continue
        if kinds[i] == ARC:
            if sines[i] < 1.0 and misses[i] > sines[i] + angle + ROUNDING:
                return True
        elif misses[i] > chords[i] + chord:
            return True
    return False


@borrowing
def disprove(count, faces, targets, model, contacts, rotation, ball, angle, always, work):
    """Try to prove, by the weights in the work space, that no pose meets all bounds.

    Args:
        count: how many contacts count.
        faces: (n,) the feature of each contact, -1 for none.
        targets: (n,) the polygon that stands for it.
        model: see `pose.ModelTest`.
        contacts: likewise.
        rotation: (3, 3) object to world, of the pose that has been read.
        ball: (3, 3) a rotation that none within the bounds is farther from than ...
        angle: ... this angle, radians.
        always: renew the region even if the multipliers can't prove anything.
        work: see `workspace`; the weighted fit's step is written in place.

    Returns:
        Whether it is proved; an angle that bounds every rotation within the bounds, from this pose,
        if the region was renewed, else pi.
    """
    readings, region, forms, rows, systems, vectors, _, proof, _ = work
    x, u, levers, weights = rows
    system, factor = systems
    gradient, step, pivot = vectors[0], vectors[1], vectors[2]
    pulls, twists, slope, form = proof
    offset = region[4][2]
    normals = model[0]
    set_levers(count, faces, x, pivot, levers)
    assemble(count, faces, levers, u, normals, contacts, readings, weights, system, gradient)
    solve_in_ball(system, gradient, factor, step, rotation, ball, angle, model[6], offset)
    set_multipliers(
        count, faces, levers, u, normals, contacts, readings, weights, step, (pulls, twists)
    )
    margin, total = plain_margin(
        count, faces, targets, x, u, levers, model, contacts, readings, proof
    )
    margin -= ROUNDING * total
    if margin <= 0.0 and not always:
        return False, np.pi
    bound, _ = locate(count, faces, targets, model, contacts, rotation, ball, angle, work)
    if bound < 0.0:
        return True, 0.0
    if margin <= 0.0:
        return False, bound
    off = np.sqrt(offset[0] ** 2 + offset[1] ** 2 + offset[2] ** 2)
    longest = min(np.pi, off + angle)
    margin -= motion_allowance(
        slope,
        form,
        bound,
        ball_radius(angle, longest),
        reach_of(model, contacts, pivot),
        region,
        forms[0],
        forms[1],
    )
    return margin > 0.0, bound
