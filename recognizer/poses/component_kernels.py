"""Compiled components of a cover: leaves of one interpretation whose boxes overlap.

Of each a pose is reported, the best fit if it is in the component, and how far any pose of the
component can be from it.
"""

from __future__ import annotations

import numpy as np

from ..compiling import borrowing, kernel
from .boxes_kernels import gibbs_between, recentre, shift_of, turn_chart
from .breach_kernels import UNBROKEN, breaks_known
from .fits.finish_kernels import finish, weigh
from .fits.fit_kernels import fit_space
from .motions.motion_kernels import copy_pose

ROUNDING = 1e-6
"""Of angles between rotations that are about the same, or about half a turn apart."""
ALL_ROUND = 2.6
"""An angle (radians) up to which a box's turns from a rotation are surely less than half a turn,
with room for where `gibbs_between` gives up."""
TOUCHING = 1e-9
"""Boxes as near as this overlap: rounding."""


@borrowing
def angle_between(first, second):
    """The angle between two rotations (3, 3), radians."""
    trace = 0.0
    for a in range(3):
        for b in range(3):
            trace += first[a, b] * second[a, b]
    return np.arccos(min(max(0.5 * (trace - 1.0), -1.0), 1.0))


@borrowing
def view_leaves(leaves, middles, halves, angles, turn):
    """The middle of each leaf's box, half its sides and the largest turn in it, in place."""
    for m in range(len(angles)):
        angles[m] = recentre(
            leaves.charts[m], leaves.lows[m], leaves.highs[m], turn, halves[m], middles[m]
        )


@borrowing
def corner_of(leaves, at, corner, turn, rotation, g):
    """The rotation (3, 3), world to object, at a corner of a leaf's box, in place."""
    for k in range(3):
        g[k] = leaves.highs[at, k] if corner >> k & 1 else leaves.lows[at, k]
    turn_chart(g, leaves.charts[at], turn, rotation)


@borrowing
def overlap(one, other, leaves, middles, halves, angles, space):
    """Whether the boxes of two leaves may have a pose in common."""
    turn, rotation, g = space
    for k in range(3):
        low = max(leaves.rooms[one, k, 0], leaves.rooms[other, k, 0])
        if low > min(leaves.rooms[one, k, 1], leaves.rooms[other, k, 1]) + TOUCHING:
            return False
    between = angle_between(middles[one], middles[other])
    if between > angles[one] + angles[other] + ROUNDING:
        return False
    if between + angles[other] > ALL_ROUND:
        return True
    for k in range(3):
        least, most = np.inf, -np.inf
        for corner in range(8):
            corner_of(leaves, other, corner, turn, rotation, g)
            gibbs_between(middles[one], rotation, g)
            least, most = min(least, g[k]), max(most, g[k])
        if 2.0 * least > halves[one, k] + TOUCHING or 2.0 * most < -halves[one, k] - TOUCHING:
            return False
    return True


@borrowing
def within(at, leaves, rotation, shift, g):
    """Whether a pose, world to object, with a shift in radii, is in a leaf's box."""
    for k in range(3):
        if not leaves.rooms[at, k, 0] <= shift[k] <= leaves.rooms[at, k, 1]:
            return False
    if not gibbs_between(leaves.charts[at], rotation, g):
        return False
    inside = True
    for k in range(3):
        inside &= leaves.lows[at, k] <= g[k] <= leaves.highs[at, k]
    return inside


@kernel
def link_leaves(leaves, interpretations, mean, radius):
    """Number the components of a cover.

    A witness may lie beside the box that it was found from: where another box holds it, the two are
    of one component.

    Args:
        leaves: see `cover.Leaves`.
        interpretations: (m,) the interpretation of each leaf, as a number.
        mean: (3,) of the contacts, metres.
        radius: metres.

    Returns:
        (m,) the component of each leaf, numbered as they come, and how many there are.
    """
    count = len(interpretations)
    labels = np.full(count, -1, np.int64)
    middles, halves, angles = np.empty((count, 3, 3)), np.empty((count, 3)), np.empty(count)
    space = (np.empty((3, 3)), np.empty((3, 3)), np.empty(3))
    view_leaves(leaves, middles, halves, angles, space[0])
    inverses, shifts = np.empty((count, 3, 3)), np.empty((count, 3))
    for m in range(count):
        shift_of(leaves.rotations[m], leaves.translations[m], mean, radius, inverses[m], shifts[m])
    found = 0
    waiting = np.empty(count, np.int64)
    for seed in range(count):
        if labels[seed] >= 0:
            continue
        labels[seed] = found
        waiting[0], height = seed, 1
        while height > 0:
            height -= 1
            m = waiting[height]
            for other in range(count):
                if (
                    labels[other] < 0
                    and interpretations[other] == interpretations[m]
                    and (
                        overlap(m, other, leaves, middles, halves, angles, space)
                        or within(m, leaves, inverses[other], shifts[other], space[2])
                        or within(other, leaves, inverses[m], shifts[m], space[2])
                    )
                ):
                    labels[other] = found
                    waiting[height] = other
                    height += 1
        found += 1
    into, names = np.full(found, -1, np.int64), np.full(found, -1, np.int64)
    return labels, _join_undecided(leaves, interpretations, labels, into, names)


@borrowing
def _join_undecided(leaves, interpretations, labels, into, names):
    """Count components without a witness to one of their interpretation that has one.

    What they may have of poses is then told as open. Arguments as in `link_leaves`; for each
    component, work space of -1.

    Returns:
        How many components are left.
    """
    count = len(labels)
    for m in range(count):
        if leaves.proven[m]:
            into[labels[m]] = labels[m]
    for m in range(count):
        if into[labels[m]] < 0:
            for other in range(count):
                if leaves.proven[other] and interpretations[other] == interpretations[m]:
                    into[labels[m]] = labels[other]
                    break
    left = 0
    for m in range(count):
        k = into[labels[m]] if into[labels[m]] >= 0 else labels[m]
        if names[k] < 0:
            names[k] = left
            left += 1
        labels[m] = names[k]
    return left


@borrowing
def reach_of(at, leaves, seen, inverse, shift, middle, space):
    """How far the poses of a leaf's box are from a pose, at most.

    With the shift read in the object's frame, a point that is ``v`` from the contacts' mean moves
    by no more than the shift changes and the turn moves ``v``.

    Returns:
        The turn, radians, and how far the object's centroid moves, in radii.
    """
    turn, rotation, g = space
    middles, angles = seen
    far, square, arm = 0.0, 0.0, 0.0
    # Seen from the pose the box is the hull of its corners' images, unless some turn in it is half
    # a turn away.
    whole = angle_between(middles[at], inverse) + angles[at] > ALL_ROUND
    for corner in range(0 if whole else 8):
        corner_of(leaves, at, corner, turn, rotation, g)
        gibbs_between(inverse, rotation, g)
        far = max(far, g[0] ** 2 + g[1] ** 2 + g[2] ** 2)
    for k in range(3):
        apart = max(leaves.rooms[at, k, 1] - shift[k], shift[k] - leaves.rooms[at, k, 0])
        square += apart * apart
        arm += (shift[k] - middle[k]) ** 2
    # The chord of a turn with tangent t of its half is 2 t / sqrt(1 + t^2).
    chord = 2.0 if whole else 2.0 * np.sqrt(far / (1.0 + far))
    angle = np.pi if whole else 2.0 * np.arctan(np.sqrt(far))
    return angle, np.sqrt(square) + chord * np.sqrt(arm)


@kernel
def report_components(leaves, labels, found, problem, seeking):
    """A pose of each component, and how far the others are from it.

    Args:
        leaves: see `cover.Leaves`.
        labels: (m,) the component of each.
        found: how many components there are.
        problem: see `cover.Problem`.
        seeking: see `work_space.seeking_space`.

    Returns:
        (k, n) features; (k, 3, 3) rotations and (k, 3) translations, object to world; (k,) misfits;
        (k, 6, 6) informations; (k,) whether the pose is a witness; (k, 2) the largest turn to
        another pose, radians, and the farthest way of the centroid, metres.
    """
    contacts, model, known = problem.contacts, problem.model, problem.known
    mean, radius = problem.touches.mean, problem.shape.radius
    n = leaves.fixed.shape[1]
    faces = np.full((found, n), -1, np.int32)
    rotations, translations = np.zeros((found, 3, 3)), np.zeros((found, 3))
    costs, informations = np.zeros(found), np.zeros((found, 6, 6))
    proven, reaches = np.zeros(found, np.bool_), np.zeros((found, 2))
    work, space = fit_space(n), (np.empty((3, 3)), np.empty((3, 3)), np.empty(3))
    inverse, shift, features = np.empty((3, 3)), np.empty(3), np.empty(n, np.int64)
    chosen = np.full(found, -1, np.int64)
    for m in range(len(labels)):
        k = labels[m]
        if chosen[k] < 0 or (leaves.proven[m] and not leaves.proven[chosen[k]]):
            chosen[k] = m
    for k in range(found):
        at = chosen[k]
        for i in range(n):
            faces[k, i] = max(leaves.fixed[at, i], -1)
            features[i] = faces[k, i]
        proven[k] = leaves.proven[at]
        copy_pose(leaves.rotations[at], leaves.translations[at], rotations[k], translations[k])
        if proven[k]:
            costs[k] = finish(
                n, features, contacts, model, rotations[k], translations[k], work, informations[k]
            )
            shift_of(rotations[k], translations[k], mean, radius, inverse, shift)
            inside = False
            for m in range(len(labels)):
                if labels[m] == k and within(m, leaves, inverse, shift, space[2]):
                    inside = True
                    break
            if inside and (
                not known.anything
                or breaks_known(
                    features, known, model, rotations[k], translations[k], seeking[14], seeking[13]
                )
                == UNBROKEN
            ):
                continue
            # The best fit is in another component, which has it already, or breaks what is known.
            copy_pose(leaves.rotations[at], leaves.translations[at], rotations[k], translations[k])
        costs[k] = weigh(
            n, features, contacts, model, rotations[k], translations[k], work, informations[k]
        )
    count, centre = len(labels), model[5] / radius
    seen = (np.empty((count, 3, 3)), np.empty(count))
    view_leaves(leaves, seen[0], np.empty((count, 3)), seen[1], space[0])
    for m in range(len(labels)):
        k = labels[m]
        shift_of(rotations[k], translations[k], mean, radius, inverse, shift)
        turn, way = reach_of(m, leaves, seen, inverse, shift, centre, space)
        reaches[k, 0] = max(reaches[k, 0], turn)
        reaches[k, 1] = max(reaches[k, 1], way * radius)
    return faces, rotations, translations, costs, informations, proven, reaches
