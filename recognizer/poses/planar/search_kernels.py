"""Compiled search over the rotations of the plane: poses that meet all bounds, and what is left.

An angle is looked at: either a pose is found there, or a whole arc around it is excluded, with a
proof (see `planar_exchange_kernels`). So it goes on until nothing is left, or a pose in each arc
that is.
"""

from __future__ import annotations

import numpy as np

from ...compiling import kernel
from ...models.planar_kernels import wrap
from .exchange_kernels import EXCLUDED, FOUND, excluded_arc, least_excess, start_exchange
from .motion_kernels import EXACT

NARROWEST = 1e-10
"""Arcs (radians) that aren't halved any more: less than any bound can tell apart."""


@kernel
def allowed_rotations(faces, contacts, outline, arcs):
    """The angles at which every normal is within its bound; returns how many arcs there are.

    Args:
        faces: (n,) the edge of each contact.
        contacts: see `planar_motion_kernels`.
        outline: likewise.
        arcs: (k, 2) first and last angle of each arc, written in place; k at least n + 1.
    """
    _, directions, _, normal_error = contacts
    tightest = 0
    for i in range(1, len(faces)):
        if normal_error[i] < normal_error[tightest]:
            tightest = i
    centre = wrap(directions[tightest] - outline[3][faces[tightest]])
    half = min(normal_error[tightest] * (1.0 + 0.5 * EXACT), np.pi)
    arcs[0, 0], arcs[0, 1] = centre - half, centre + half
    count = 1
    for i in range(len(faces)):
        half = normal_error[i] * (1.0 + 0.5 * EXACT)
        if i == tightest or half >= np.pi:
            continue
        # The nearest of the angles that the normal asks for, and those a whole turn away: an arc
        # is a turn long at most.
        middle = centre + wrap(directions[i] - outline[3][faces[i]] - centre)
        for j in range(count - 1, -1, -1):
            low, high = arcs[j, 0], arcs[j, 1]
            kept = False
            for turns in range(-1, 2):
                first = max(low, middle + 2.0 * np.pi * turns - half)
                last = min(high, middle + 2.0 * np.pi * turns + half)
                if first > last:
                    continue
                at = count if kept else j
                count += kept
                kept = True
                arcs[at, 0], arcs[at, 1] = first, last
            if not kept:
                count -= 1
                arcs[j] = arcs[count]
    return count


@kernel
def _cut(arcs, marks, count, low, high):
    """Take the open arc from low to high out of all arcs; returns how many there are then."""
    for j in range(count - 1, -1, -1):
        first, last = arcs[j, 0], arcs[j, 1]
        if high <= first or low >= last:
            continue
        if low > first and high < last:
            arcs[count, 0], arcs[count, 1] = high, last
            marks[count] = marks[j]
            marks[count, 0] = False
            count += 1
        if low > first:
            arcs[j, 1], marks[j, 1] = low, False
        elif high < last:
            arcs[j, 0], marks[j, 0] = high, False
        else:
            count -= 1
            arcs[j] = arcs[count]
            marks[j] = marks[count]
    return count


@kernel
def _next_arc(arcs, marks, count, resolution):
    """The widest arc still to be looked at, those beside no witness first; -1 if there is none."""
    at, widest = -1, -1.0
    beside, gap = -1, resolution
    for j in range(count):
        width = arcs[j, 1] - arcs[j, 0]
        if marks[j, 0] or marks[j, 1]:
            if width > gap:
                beside, gap = j, width
        elif width > widest and not marks[j, 2]:
            at, widest = j, width
    return at if at >= 0 else beside


@kernel
def search_rotations(faces, contacts, arms, outline, most, resolution, arcs, marks, witnesses):
    """Look for poses over all rotations; what is left of them can't be excluded.

    Args:
        faces: (n,) the edge of each contact.
        contacts: see `planar_motion_kernels`.
        arms: (n, 2) contacts from their mean, world frame.
        outline: see `planar_motion_kernels`.
        most: the most rotations to look at.
        resolution: arcs next to a witness are searched on until they are this narrow, radians; 0
            to stop at the first witness.
        arcs: (n + 1 + most, 2) first and last angles of what is left, written in place.
        marks: (n + 1 + most, 3) whether its first angle and whether its last is a witness's, and
            whether an arc is too narrow to be decided; written in place.
        witnesses: (most, 3) angle and ``y`` of each pose found, written in place.

    Returns:
        How many arcs are left, and how many poses were found.
    """
    reaches = contacts[2]
    basis = np.empty(3, np.int64)
    bounds = np.empty((3, 3))
    weights = np.empty(3)
    y = np.empty(2)
    start_exchange(faces[0], reaches[0], outline, basis, bounds)
    farthest, widest_reach = 0.0, 0.0
    for i in range(len(faces)):
        farthest = max(farthest, np.sqrt(arms[i, 0] ** 2 + arms[i, 1] ** 2))
        widest_reach = max(widest_reach, reaches[i])
    # A pose puts contact 0 on its edge, within a diameter of the centroid.
    extent = farthest + widest_reach + 2.0 * outline[4]
    # Rounding is below the first two parts, that of places far from the world's origin below the
    # second; what was accepted as a witness lies below the third.
    away = np.abs(contacts[0]).max()
    margin = 1e-12 * extent + 1e-15 * away + EXACT * widest_reach
    count = allowed_rotations(faces, contacts, outline, arcs)
    marks[:count] = False
    found = 0
    for look in range(most):
        # Half of the looks are kept for what would otherwise stay undecided.
        at = _next_arc(arcs, marks, count, resolution if 2 * look < most else np.inf)
        if at < 0:
            break
        first, last = arcs[at, 0], arcs[at, 1]
        angle = 0.5 * (first + last)
        outcome = least_excess(
            angle, faces, arms, reaches, outline, margin, basis, bounds, weights, y
        )
        if outcome == EXCLUDED:
            middle, half = excluded_arc(arms, extent, margin, basis, bounds, weights)
            middle = angle + wrap(middle - angle)
            if abs(middle - angle) < half:
                for turns in range(-1, 2):
                    turned = middle + 2.0 * np.pi * turns
                    count = _cut(arcs, marks, count, turned - half, turned + half)
                continue
        if outcome == FOUND:
            witnesses[found, 0], witnesses[found, 1], witnesses[found, 2] = angle, y[0], y[1]
            found += 1
            if resolution == 0.0:
                break
        elif last - first < NARROWEST:
            marks[at, 2] = True
            continue
        arcs[count, 0], arcs[count, 1] = angle, last
        marks[count] = marks[at]
        marks[count, 0] = outcome == FOUND
        arcs[at, 1], marks[at, 1] = angle, outcome == FOUND
        count += 1
    return count, found
