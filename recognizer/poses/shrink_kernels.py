"""Compiled shrinking of a node's box, by linear programs over the rows of what is assigned.

Beside the rows of contacts there are cuts: where a search for a witness ended, the gaps that are
left give rows that say more there.
"""

from __future__ import annotations

import numpy as np

from ..compiling import borrowing
from ..contacts.reading_kernels import ARC, NO_CONE
from .breach_kernels import stands_on
from .polytope_kernels import tighten
from .rows_kernels import add_row, contact_rows, support_rows

TINY = 1e-12
"""The square of a direction that is none."""
NEAR = 0.9
"""Gaps of less, in bounds, give no cut."""


@borrowing
def set_box(top, stack, work):
    """The box of a node's poses as linear programs have it: turns about its middle, then shifts."""
    for k in range(3):
        work.low[k], work.high[k] = -work.half[k], work.half[k]
        work.low[3 + k], work.high[3 + k] = stack.rooms[top, k, 0], stack.rooms[top, k, 1]


@borrowing
def rows_of(top, stack, problem, work):
    """The rows of all contacts that are assigned, and of the support; returns how many."""
    shape, touches, known = problem.shape, problem.touches, problem.known
    used = 0
    for j in range(len(touches.arms)):
        f = stack.fixed[top, j]
        if f >= 0:
            used = contact_rows(j, f, stack.targets[top, j], shape, touches, work, used)
    if len(known.corners) > 0:
        foot = stands_on(stack.fixed[top], known)
        used = support_rows(foot, known, shape.radius, work, used)
    return used


@borrowing
def cut_rows(used, work):
    """The rows of cuts, behind ``used`` others; returns how many there are then."""
    for c in range(work.cut_count[0]):
        cut = work.cuts[c]
        used = add_row(work.cut_arms[c], cut, cut[3:6], cut[6], work, used)
    return used


@borrowing
def note_cuts(top, problem, stack, work):
    """Cuts from where a search for a witness ended; what finds no room is left out.

    A contact is within its bound of a polygon, so of the polygon's support in any direction; in
    that of its gap this says most. Of a normal outside a cone, the same is so of its sine
    across the nearest normal of the cone: no other one leans farther that way.
    """
    radius, touches, nearest = problem.shape.radius, problem.touches, work.lever
    gaps, lengths, _, _, kinds, misses, directions = work.seeking[0]
    u = work.seeking[2]
    start, corners = problem.model[3], problem.model[4]
    for i in range(len(touches.reaches)):
        f, polygon = stack.fixed[top, i], stack.targets[top, i]
        if f < 0:
            continue
        at = work.cut_count[0]
        if at < len(work.cuts) and lengths[i] > NEAR * touches.reaches[i] * radius:
            cut = work.cuts[at]
            for k in range(3):
                cut[k] = cut[3 + k] = gaps[i, k] / lengths[i]
                work.cut_arms[at, k] = touches.arms[i, k]
            most = -np.inf
            for c in range(start[polygon], start[polygon + 1]):
                along = cut[0] * corners[c, 0] + cut[1] * corners[c, 1] + cut[2] * corners[c, 2]
                most = max(most, along)
            cut[6] = most / radius + touches.reaches[i]
            at += 1
        sine = np.sin(touches.errors[i])
        known = touches.errors[i] < 0.5 * np.pi and kinds[i] != NO_CONE
        if at < len(work.cuts) and known and misses[i] > NEAR * sine:
            cut, square, along = work.cuts[at], 0.0, 0.0
            for k in range(3):
                nearest[k] = u[i, k] - misses[i] * directions[i, k] if kinds[i] != ARC else 0.0
                along += directions[i, k] * nearest[k]
            for k in range(3):
                cut[k], cut[3 + k] = directions[i, k] - along * nearest[k], 0.0
                square += cut[k] * cut[k]
                work.cut_arms[at, k] = touches.normals[i, k]
            for k in range(3):
                cut[k] /= np.sqrt(max(square, TINY))
            cut[6] = sine
            at += square > TINY
        work.cut_count[0] = at


@borrowing
def keep_box(top, stack, work):
    """Write a box that was tightened back to its node, about the middle it is about.

    About another middle a box is larger than it was: turns are kept only where they are fewer.
    """
    before, after, square = 1.0, 1.0, 1.0
    for k in range(3):
        # Turns about no more than one axis have no volume: other axes count nothing.
        if stack.highs[top, k] > stack.lows[top, k]:
            before *= stack.highs[top, k] - stack.lows[top, k]
            after *= 0.5 * (work.high[k] - work.low[k])
        square += (0.5 * (stack.highs[top, k] + stack.lows[top, k])) ** 2
    # A volume of Gibbs vectors counts by this as one of rotations.
    fewer = after < before / (square * square)
    for a in range(3):
        if fewer:
            stack.boxed[top] = True
            for b in range(3):
                stack.charts[top, a, b] = work.middle[a, b]
            stack.lows[top, a], stack.highs[top, a] = 0.5 * work.low[a], 0.5 * work.high[a]
        stack.rooms[top, a, 0] = max(stack.rooms[top, a, 0], work.low[3 + a])
        stack.rooms[top, a, 1] = min(stack.rooms[top, a, 1], work.high[3 + a])


@borrowing
def tighten_turns(top, stack, problem, work):
    """Shrink the turns of a node that was viewed, by what is assigned.

    Returns:
        What is left of its longest side, at most, as a share; below zero if no pose is left.
    """
    set_box(top, stack, work)
    used = rows_of(top, stack, problem, work)
    if used == 0:
        return 1.0
    share = tighten(0, 3, used, work)
    if share >= 0.0:
        keep_box(top, stack, work)
    return share
