"""Compiled nodes of a cover: a box of rotations, room for shifts, features left to each contact.

Nodes lie on a stack, see `cover.Stack`, and are named by their place. Sets of features are rows of
64-bit words.
"""

from __future__ import annotations

import numpy as np

from ..compiling import borrowing
from ..tree.mask_kernels import bit_index, narrow
from .boxes_kernels import facing, fits_room, recentre, turn_all, turn_back

OPEN, NONE = -1, -2
"""Of a contact's feature: not chosen yet; it is on none."""
WORTHWHILE = 0.05
"""A share of the shifts' room; if it loses more, what is left is looked at again."""
LEAST_ARM = 0.1
"""An arm, in radii, by which turns count even where they move no contact: they turn normals."""
ELSEWHERE = 0.05
"""The square of a Gibbs vector from which on the axes about it are others than those about zero."""
UNKNOWN = 1.6
"""A bound on a normal (radians) from which on it says little: half a sphere or more."""
BEHIND = 1e6
"""More features than any contact has."""
_ONE = np.uint64(1)
_EMPTY = np.uint64(0)


@borrowing
def only_bit(domain):
    """The lowest member of a bit set; -1 if it is empty."""
    for w in range(len(domain)):
        if domain[w] != _EMPTY:
            return 64 * w + bit_index(domain[w] & (~domain[w] + _ONE))
    return -1


@borrowing
def pass_on(top, i, stack, tables):
    """Narrow what is left to open contacts by what one contact has been assigned, by pairs."""
    f = stack.fixed[top, i]
    for j in range(stack.fixed.shape[1]):
        if stack.fixed[top, j] != OPEN or j == i or stack.sizes[top, j] == 0:
            continue
        domain = stack.domains[top, j]
        stack.sizes[top, j] = narrow(
            f,
            tables.packed,
            tables.half_angles[f],
            tables.readings[i, j],
            tables.errors[i],
            tables.errors[j],
            tables.switches,
            domain,
            domain,
        )


@borrowing
def settle_singles(top, stack, tables, spare):
    """Assign contacts that have one feature left, and none those that have no feature.

    Returns:
        Whether that can be.
    """
    count = stack.fixed.shape[1]
    again = True
    while again:
        again = False
        for j in range(count):
            if stack.fixed[top, j] != OPEN:
                continue
            if stack.sizes[top, j] == 0:
                if stack.nulls[top] == spare:
                    return False
                stack.nulls[top] += 1
                stack.fixed[top, j] = NONE
                again = True
            elif stack.sizes[top, j] == 1 and stack.nulls[top] == spare:
                stack.fixed[top, j] = only_bit(stack.domains[top, j])
                stack.targets[top, j] = stack.fixed[top, j]
                pass_on(top, j, stack, tables)
                again = True
    return True


@borrowing
def fits(j, f, angle, room, shape, touches, work):
    """Whether a contact can be on a feature in the box that was viewed; if so the hull grows."""
    error, reach = touches.errors[j], touches.reaches[j]
    return (
        facing(work.facings[j], error, angle, f, shape)
        and facing(work.fronts[j], touches.front_errors[j], angle, f, shape)
        and fits_room(work.ways[j], reach, shape.slabs[f], room, work.hull)
    )


@borrowing
def narrow_in_box(top, angle, spare, stack, shape, touches, work):
    """Drop features that no pose of a box has, and shrink the shifts' room by what is left.

    Args:
        top: the node, which was viewed.
        angle: the largest turn about its middle, radians.
        spare: how many contacts may be on none.
        stack: see `cover.Stack`, changed in place.
        shape: see `shape.Shape`.
        touches: see `shape.Touches`.
        work: see `work_space.Work`.

    Returns:
        1 if something changed that a second look could use, 0 if not, -1 if no pose is left.
    """
    room, hull = stack.rooms[top], work.hull
    changed = 0
    for j in range(len(touches.arms)):
        f = stack.fixed[top, j]
        if f == NONE:
            continue
        for k in range(len(room)):
            hull[k, 0], hull[k, 1] = np.inf, -np.inf
        if f >= 0:
            if not fits(j, f, angle, room, shape, touches, work):
                return -1
        else:
            left = 0
            for w in range(stack.domains.shape[2]):
                bits = stack.domains[top, j, w]
                while bits != _EMPTY:
                    lowest = bits & (~bits + _ONE)
                    bits ^= lowest
                    if fits(j, 64 * w + bit_index(lowest), angle, room, shape, touches, work):
                        left += 1
                    else:
                        stack.domains[top, j, w] ^= lowest
                        changed = 1
            stack.sizes[top, j] = left
            # One that may be on none says nothing of the room.
            if left == 0 or stack.nulls[top] < spare:
                continue
        for k in range(len(room)):
            # Rounding can empty a room that touches: it is kept then.
            low, high = max(room[k, 0], hull[k, 0]), min(room[k, 1], hull[k, 1])
            if low <= high:
                lost = (low - room[k, 0]) + (room[k, 1] - high)
                if lost > WORTHWHILE * (room[k, 1] - room[k, 0]):
                    changed = 1
                room[k, 0], room[k, 1] = low, high
    return changed


@borrowing
def view(top, stack, shape, touches, work):
    """See contacts and features from the middle of a node's box; returns its largest turn."""
    angle = recentre(
        stack.charts[top], stack.lows[top], stack.highs[top], work.turn, work.half, work.middle
    )
    turn_all(work.middle, touches.normals, work.facings)
    turn_all(work.middle, touches.fronts, work.fronts)
    turn_back(work.middle, shape.directions, work.directions)
    return angle


@borrowing
def count_open(top, stack):
    """How many contacts are assigned a feature, and how many are open."""
    assigned, still = 0, 0
    for j in range(stack.fixed.shape[1]):
        f = stack.fixed[top, j]
        if f >= 0:
            assigned += 1
        elif f == OPEN:
            still += 1
    return assigned, still


@borrowing
def smallest(top, stack, touches):
    """The open contact with the fewest features; the first of them.

    Of nodes without a box one whose normal is known comes first: it is what leads to a box.
    """
    best, least = -1, np.inf
    for j in range(stack.fixed.shape[1]):
        if stack.fixed[top, j] != OPEN:
            continue
        ways = 1.0 * stack.sizes[top, j]
        if not stack.boxed[top] and touches.errors[j] > UNKNOWN:
            ways *= BEHIND
        if ways < least:
            best, least = j, ways
    return best


@borrowing
def copy_node(source, target, stack):
    """Write a node to another place of the stack."""
    n, words = stack.domains.shape[1], stack.domains.shape[2]
    for a in range(3):
        for b in range(3):
            stack.charts[target, a, b] = stack.charts[source, a, b]
        stack.lows[target, a], stack.highs[target, a] = (
            stack.lows[source, a],
            stack.highs[source, a],
        )
    for k in range(stack.rooms.shape[1]):
        stack.rooms[target, k, 0] = stack.rooms[source, k, 0]
        stack.rooms[target, k, 1] = stack.rooms[source, k, 1]
    for j in range(n):
        for w in range(words):
            stack.domains[target, j, w] = stack.domains[source, j, w]
        stack.sizes[target, j] = stack.sizes[source, j]
        stack.fixed[target, j] = stack.fixed[source, j]
        stack.targets[target, j] = stack.targets[source, j]
    stack.boxed[target] = stack.boxed[source]
    stack.nulls[target] = stack.nulls[source]
    stack.branching[target] = -1


@borrowing
def split(top, axis, stack):
    """Cut a node's box across a turn or, from the fourth axis on, a shift, into two places."""
    stack.boxed[top] = True
    copy_node(top, top + 1, stack)
    if axis >= 3:
        k = axis - 3
        stack.rooms[top, k, 1] = 0.5 * (stack.rooms[top, k, 0] + stack.rooms[top, k, 1])
        stack.rooms[top + 1, k, 0] = stack.rooms[top, k, 1]
        return
    stack.highs[top, axis] = 0.5 * (stack.lows[top, axis] + stack.highs[top, axis])
    stack.lows[top + 1, axis] = stack.highs[top, axis]


@borrowing
def widest(top, stack, touches, work):
    """The axis across which to cut a box, and how far turns about its axes move contacts, in radii.

    It is the one whose turns move them most; of wide boxes, whose own axes are elsewhere, the
    longest.
    """
    best, far = 0, -1.0
    n = len(touches.arms)
    longest, widths = 0, stack.highs[top]
    for k in range(3):
        if widths[k] - stack.lows[top, k] > widths[longest] - stack.lows[top, longest]:
            longest = k
        square = 0.0
        for j in range(n):
            a = touches.arms[j]
            square += a[0] * a[0] + a[1] * a[1] + a[2] * a[2] - a[k] * a[k]
        moved = work.half[k] * np.sqrt(square / n + LEAST_ARM * LEAST_ARM)
        if moved > far:
            best, far = k, moved
    away = 0.0
    for k in range(3):
        away += (0.5 * (stack.highs[top, k] + stack.lows[top, k])) ** 2
    if away > ELSEWHERE:
        best = longest
    return best, far
