"""Compiled witnesses: a pose that meets every bound, sought from a pose nearby.

Gauss-Newton on what each reading exceeds a share of its bound by. Aiming at a share below one goes
to the inside, so that rounding and a linear picture that is a little off do no harm; where the
bounds leave no inside, the share is raised.
"""

from __future__ import annotations

import numpy as np

from ..compiling import borrowing
from ..contacts.reading_kernels import ARC, NO_CONE, carry, meets_all, read
from .breach_kernels import ANEW, UNBROKEN, breaks_known
from .heeding_kernels import hindering
from .motions.motion_kernels import add_row, copy_pose, move, slope_row, solve

NONE, POLYGONS, CONTACTS, WITNESS = 0, 1, 2, 3
"""What a search for a witness came to."""
SHARES = np.array([0.8, 1.0])
"""Of the bounds, that are aimed at in turn, ..."""
STEPS = 10
"""... with so many steps each."""
SMALL = 1e-9
"""Damping, as a share of the stiffness: along what no reading bears on the pose stays."""
EXACT = 1e-9
"""By how much a witness may exceed a bound, as a share of it: rounding."""
STALLED = 0.999
"""A share of what is exceeded; if more is left after a step, more of them are in vain."""
SHORTEST = 3
"""Times that a step is shortened before it is given up."""
LONGEST = 0.5
"""The longest step, in radii: the linear picture holds for a fraction of a radian only."""


@borrowing
def seek_witness(faces, targets, contacts, model, known, heeding, rotation, translation, space):
    """Move a pose to where it meets every bound, and breaks nothing that is known.

    Args:
        faces: (n,) the feature of each contact, below zero for none.
        targets: (n,) the polygon that stands for it.
        contacts: see `pose.kernel_contacts`.
        model: see `pose.KernelModel`.
        known: see `known.Known`.
        heeding: whether it counts.
        rotation: (3, 3) object to world, moved in place.
        translation: (3,) metres, likewise.
        space: see `work_space.seeking_space`: readings (see `reading_kernels.read`), (n, 3)
            places and normals in the object's frame, and work space.

    Returns:
        `WITNESS`; `CONTACTS`, if it met all bounds on contacts on the way; `POLYGONS`, if it met
        those on the polygons; or `NONE`.
    """
    readings, x, u, system, factor, gradient, step, row, turn, arm, spare = space[:11]
    turned, shifted, places, heeded = space[11:]
    points, measured, _, _, _ = contacts
    count = len(faces)
    found = NONE
    amount = 2.0 * count
    if heeding:
        amount += len(known.corners) + len(known.starts)
    for s in range(len(heeded)):
        heeded[s] = False
    for share in SHARES:
        last, ends, shorter = np.inf, False, 0
        for _ in range(STEPS):
            carry(count, points, measured, rotation, translation, x, u)
            worst = read(count, faces, targets, x, u, model, contacts, readings)
            if worst <= 1.0 + EXACT:
                found = max(found, POLYGONS)
                if meets_all(count, faces, x, u, model, contacts, EXACT, spare):
                    found = CONTACTS
                    if not heeding:
                        return WITNESS
                    broken = breaks_known(
                        faces, known, model, rotation, translation, heeded, places
                    )
                    if broken == UNBROKEN:
                        return WITNESS
                    if broken == ANEW:
                        # More is asked for than before.
                        last = np.inf
                elif worst <= share:
                    break
            cost = exceeding(share, faces, contacts, model, space)
            if heeding:
                cost += hindering(
                    *(share, faces, known, model, rotation, translation, heeded),
                    ((system, gradient, row, turn, arm, spare), places),
                )
            if cost < last:
                ends, shorter = cost > STALLED * last, 0
                last = cost
                copy_pose(rotation, translation, turned, shifted)
                least = 0.0
                for a in range(6):
                    least += SMALL * system[a, a]
                solve(system, gradient, least, factor, step)
                length = 0.0
                for a in range(6):
                    length += step[a] * step[a]
                length = np.sqrt(length)
                # The linear picture holds for a fraction of a radian only.
                scale = min(1.0, LONGEST * model[6] / max(length, 1e-300))
            else:
                # Where other readings exceed at the step's end, less of it is better.
                scale = 0.3
                shorter += 1
                ends = shorter == SHORTEST
            if ends:
                break
            for a in range(6):
                step[a] *= scale
            move(turned, shifted, step, model[5], model[6], rotation, translation)
        if last < np.inf:
            copy_pose(turned, shifted, rotation, translation)
            # A pose that meets all bounds exceeds no share of one by more than the rest of it.
            if ends and last > 4.0 * amount * (1.0 - share) ** 2 + 0.1:
                break
    carry(count, points, measured, rotation, translation, x, u)
    read(count, faces, targets, x, u, model, contacts, readings)
    return found


@borrowing
def exceeding(share, faces, contacts, model, space):
    """Normal equations of what readings exceed a share of their bounds by, in bounds, squared.

    Returns:
        The sum.
    """
    readings, x, u, system, _, gradient, _, row, turn, arm, spare = space[:11]
    _, _, reaches, chords, sines = contacts
    gaps, lengths, _, _, kinds, misses, directions = readings
    centre, radius = model[5], model[6]
    cost = 0.0
    for a in range(6):
        gradient[a] = 0.0
        for b in range(6):
            system[a, b] = 0.0
    for i in range(len(faces)):
        if faces[i] < 0:
            continue
        excess = lengths[i] - share * reaches[i]
        if excess > 0.0:
            for k in range(3):
                arm[k] = x[i, k] - centre[k]
                turn[k] = gaps[i, k] / lengths[i]
            slope_row(turn, arm, radius, spare, row)
            weight = 1.0 / (reaches[i] * reaches[i])
            add_row(row, excess, weight, system, gradient)
            cost += weight * excess * excess
        if kinds[i] == NO_CONE:
            continue
        bound = sines[i] if kinds[i] == ARC else chords[i]
        excess = misses[i] - share * bound
        if excess > 0.0:
            # direction . (u x w) = (direction x u) . w
            e0, e1, e2 = directions[i, 0], directions[i, 1], directions[i, 2]
            row[0] = (e1 * u[i, 2] - e2 * u[i, 1]) / radius
            row[1] = (e2 * u[i, 0] - e0 * u[i, 2]) / radius
            row[2] = (e0 * u[i, 1] - e1 * u[i, 0]) / radius
            row[3] = row[4] = row[5] = 0.0
            weight = 1.0 / (bound * bound)
            add_row(row, excess, weight, system, gradient)
            cost += weight * excess * excess
    return cost
