"""Compiled cover: boxes of poses that together hold all that contacts allow, depth first.

A node is a box of poses with the features that are left to each contact. What is impossible is
dropped: by ranges of pairs, by where the box turns normals, by the room that shifts have, then by
linear programs over the rows of what is assigned. A node that is left is split across a turn, or
one of its contacts is assigned each of its features, until all are (see `leaf_kernels`).
"""

from __future__ import annotations

from ..compiling import borrowing, kernel
from ..tree.mask_kernels import count_bits, pair_readings, take_lowest
from .boxes_kernels import set_ways
from .first_box_kernels import ALL, IMPOSSIBLE, first_boxes
from .leaf_kernels import (
    BY_PIECES,
    CUT,
    CUT_ANY,
    HANDY,
    HEIGHT,
    LEAF,
    NODES,
    longest_side,
    on_pieces,
    settle_leaf,
)
from .leaf_kernels import GONE as NOTHING
from .node_kernels import (
    NONE,
    copy_node,
    count_open,
    narrow_in_box,
    pass_on,
    settle_singles,
    smallest,
    split,
    view,
    widest,
)
from .shrink_kernels import tighten_turns

LOOKS = 4
"""Times that features are dropped in one box."""
FEWEST = 3
"""Contacts from which on linear programs are asked."""
REPEATS = 3
"""Times that a box is tightened and features are dropped in what is left of it, ..."""
NARROWED = 0.9
"""... as long as less than this share of its longest side is left."""
CHARTS, UPRIGHT = 4, 2
"""Boxes of Gibbs vectors that together are all rotations: about none and half a turn each axis;
those that are all rotations about the last axis."""
GONE, BRANCHES, BOXED, ASSIGNED = -2, -1, 0, 1
"""No pose is left of a node; a contact is to be assigned; it has a box; all contacts are assigned
in it."""


@kernel
def begin(contacts, errors, readings, domains, sizes):
    """Set what pairs of contacts show of each other, either way round, and sizes of bit sets."""
    pair_readings(contacts, errors, readings)
    for i in range(len(readings)):
        for j in range(i):
            seen, back = readings[j, i], readings[i, j]
            back[0], back[1], back[4] = seen[0], seen[1], seen[4]
            back[2], back[3] = seen[3], seen[2]
            back[5], back[6], back[7], back[8] = seen[7], seen[8], seen[5], seen[6]
        sizes[i] = 0
        for w in range(domains.shape[1]):
            sizes[i] += count_bits(domains[i, w])


@borrowing
def take_child(top, stack, tables):
    """Assign a branching node's contact its next feature, or none at all, in a node above it.

    Returns:
        Whether there was a next.
    """
    i = stack.branching[top]
    f = take_lowest(stack.domains[top, i])
    if f < 0:
        if not stack.null_left[top]:
            return False
        stack.null_left[top] = False
        f = NONE
    copy_node(top, top + 1, stack)
    stack.fixed[top + 1, i] = f
    stack.targets[top + 1, i] = f
    if f >= 0:
        pass_on(top + 1, i, stack, tables)
    else:
        stack.nulls[top + 1] += 1
    return True


@borrowing
def branch(top, spare, stack, touches):
    """Have the contact with the fewest features be assigned each of them."""
    stack.branching[top] = smallest(top, stack, touches)
    stack.null_left[top] = stack.nulls[top] < spare


@borrowing
def place_boxes(top, problem, stack, work):
    """Give a node without a box those of the rotations that its normals allow.

    Returns:
        How many nodes are in its place then, each with a box; none if no rotation is left, and
        `BRANCHES` if more contacts have to be assigned first.
    """
    _, still = count_open(top, stack)
    turns = first_boxes(stack.fixed[top], problem.shape, problem.touches, work)
    if turns == IMPOSSIBLE:
        return 0
    if still > 0 and turns > problem.aims.turns:
        return BRANCHES
    flat = problem.shape.flat
    boxes = turns + 1
    if turns == ALL:
        boxes = UPRIGHT if flat else CHARTS
    for at in range(boxes):
        if at + 1 < boxes:
            copy_node(top + at, top + at + 1, stack)
        # Of the plane are the first and the last.
        chart = at * (CHARTS - 1) if flat else at
        for a in range(3):
            side = work.sides[at, a]
            if turns == ALL:
                side = 0.0 if flat and a < 2 else 1.0
            stack.lows[top + at, a], stack.highs[top + at, a] = -side, side
            for b in range(3):
                stack.charts[top + at, a, b] = 0.0 if turns == ALL else work.charts[at, a, b]
            if turns == ALL:
                stack.charts[top + at, a, a] = 1.0 if chart in (0, a + 1) else -1.0
        stack.boxed[top + at] = turns > 0
    return boxes


@borrowing
def narrow_node(top, problem, stack, work):
    """Drop what a node's box doesn't allow, and shrink the box by what is assigned.

    Returns:
        `GONE`; `ASSIGNED`; or `BOXED`, if features are left to choose.
    """
    shape, touches, aims = problem.shape, problem.touches, problem.aims
    for _ in range(REPEATS):
        angle = view(top, stack, shape, touches, work)
        set_ways(touches.arms, work.directions, work.half, angle, work.ways)
        for _look in range(LOOKS):
            changed = narrow_in_box(top, angle, aims.spare, stack, shape, touches, work)
            if changed < 0 or not settle_singles(top, stack, problem.tables, aims.spare):
                return GONE
            if changed == 0:
                break
        assigned, still = count_open(top, stack)
        if still == 0:
            return ASSIGNED
        if assigned < FEWEST or angle > HANDY:
            break
        share = tighten_turns(top, stack, problem, work)
        if share < 0.0:
            return GONE
        if share > NARROWED:
            break
    return BOXED


@borrowing
def cut_by_pieces(top, stack, shape):
    """Have each convex piece of a concave face stand for it; returns how many nodes there are."""
    j = on_pieces(top, stack, shape)
    f = stack.fixed[top, j]
    pieces = shape.first[f + 1] - shape.first[f]
    if top + pieces > len(stack.boxed):
        return 0
    for p in range(pieces):
        if p + 1 < pieces:
            copy_node(top + p, top + p + 1, stack)
        stack.targets[top + p, j] = shape.first[f] + p
    return pieces


@borrowing
def step(top, found, problem, stack, leaves, counts, work):
    """Look at a node.

    Returns:
        How many nodes are in its place then, it included: none if it is done with; and whether a
        leaf was written.
    """
    aims = problem.aims
    if not settle_singles(top, stack, problem.tables, aims.spare):
        return 0, False
    if not stack.boxed[top]:
        boxes = place_boxes(top, problem, stack, work)
        if boxes == BRANCHES:
            branch(top, aims.spare, stack, problem.touches)
            return 1, False
        if boxes != 1:
            return boxes, False
    outcome = narrow_node(top, problem, stack, work)
    if outcome == GONE:
        return 0, False
    if outcome == ASSIGNED:
        leaf = settle_leaf(top, found, problem, stack, leaves, counts, work)
        if leaf == BY_PIECES:
            pieces = cut_by_pieces(top, stack, problem.shape)
            if pieces == 0:
                counts[CUT] = 1
            return pieces, False
        if leaf in (NOTHING, LEAF):
            return 0, leaf == LEAF
        if leaf == CUT_ANY:
            split(top, longest_side(work), stack)
            return 2, False
    view(top, stack, problem.shape, problem.touches, work)
    axis, far = widest(top, stack, problem.touches, work)
    if outcome != ASSIGNED and far <= aims.coarse:
        branch(top, aims.spare, stack, problem.touches)
        return 1, False
    split(top, axis, stack)
    return 2, False


@borrowing
def advance(problem, stack, leaves, counts, work, steps):
    """Go on with a search.

    Args:
        problem: see `cover.Problem`.
        stack: see `cover.Stack`.
        leaves: see `cover.Leaves`; the first rows are written.
        counts: see `leaf_kernels.NODES`; the nodes that are left are `HEIGHT`.
        work: see `work_space.Work`.
        steps: the most nodes to look at.

    Returns:
        How many leaves were written; the search is at its end if no node is left.
    """
    found, height = 0, counts[HEIGHT]
    while height > 0 and steps > 0 and found < len(leaves.proven):
        top = height - 1
        if height + CHARTS > len(stack.boxed):
            # Deeper than any search goes that halves boxes down to rounding.
            counts[CUT] = 1
            height = top
            continue
        if stack.branching[top] >= 0:
            if not take_child(top, stack, problem.tables):
                height = top
                continue
            top = height
        counts[NODES] += 1
        steps -= 1
        nodes, written = step(top, found, problem, stack, leaves, counts, work)
        height = top + nodes
        found += written
    counts[HEIGHT] = height
    return found
