"""Compiled leaves: nodes whose contacts are all assigned, shrunk until their pose set is known.

Linear programs shrink the box (`polytope_kernels`); an empty polytope is a proof that no pose is
left. Otherwise a pose is sought that meets every bound (`witness_kernels`). Where none is found,
the gaps that are left at the end of the search give rows that say more there (cuts), and the
programs are asked again. A box is a leaf if it has a witness and its poses are alike, or known up
to little, or farther apart than alike in any case; else it is cut in two.
"""

from __future__ import annotations

import numpy as np

from ..compiling import borrowing
from .motions.motion_kernels import copy_pose
from .node_kernels import view
from .path_kernels import heed_paths
from .polytope_kernels import tighten
from .seeking_kernels import end_pose, seek_inside, seek_nearby, spreads
from .shrink_kernels import cut_rows, keep_box, note_cuts, rows_of, set_box
from .witness_kernels import CONTACTS, NONE, POLYGONS, WITNESS

NODES, TRIED, HEIGHT, CUT = 0, 1, 2, 3
"""Places of counts: nodes looked at; searches for a witness; how many nodes are on the stack;
whether one was left out for want of room."""
COUNTS = 4
GONE, LEAF, CUT_UP, BY_PIECES, CUT_ANY = 0, 1, 2, 3, 4
"""What becomes of a node: no pose is left; it is a leaf; it is to be cut across a turn, by the
convex pieces of a concave face, or across a turn or a shift."""
ROUNDS = 3
"""Times that a box is tightened before it is told whether its poses are far apart."""
SHRINKS = 0.7
"""A share of the longest side; if less is left, it is tightened again."""
STUCK = 0.9
"""The same, after cuts; if more is left, cutting the box does more."""
HANDY = 0.9
"""Turns (radians) above which linearising leaves out too much for programs to say anything."""
FINE = 0.2
"""Bounds that linearising may leave out of a box that counts as known."""
FINEST = 0.02
"""The same, of a box without a witness that is not cut further: it is left undecided."""
PATIENCE, POOL = 60, 400
"""Boxes that contacts allow, and that are cut for what else is known: of one interpretation, and of
all together."""
LINEAR = 1.0
"""Bounds that linearising may leave out of a box in which a witness is sought by programs, too."""
LOOSE = 0.1
"""Bounds of what is known besides contacts, that a box without a witness may be wide."""


@borrowing
def coarseness(top, stack, touches, work):
    """What linearising leaves out about the middle of a tightened box, at most, in bounds."""
    square = 0.0
    for k in range(3):
        square += (0.5 * (work.high[k] - work.low[k])) ** 2
    worst = 0.0
    for j in range(len(touches.arms)):
        if stack.fixed[top, j] < 0:
            continue
        a = touches.arms[j]
        length = np.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])
        worst = max(worst, 0.5 * square * length / touches.reaches[j])
        if touches.errors[j] < 0.5 * np.pi:
            worst = max(worst, 0.5 * square / touches.errors[j])
    return worst, np.sqrt(square)


@borrowing
def alike(top, angle, stack, aims):
    """Whether all poses of a node's box are alike."""
    shift = 0.0
    for k in range(3):
        shift += (stack.rooms[top, k, 1] - stack.rooms[top, k, 0]) ** 2
    return angle < aims.turn and 0.5 * np.sqrt(shift) < aims.shift


@borrowing
def on_pieces(top, stack, shape):
    """A contact on a concave face that its hull stands for; -1 if there is none."""
    for j in range(stack.fixed.shape[1]):
        f = stack.fixed[top, j]
        if f >= 0 and stack.targets[top, j] == f and shape.first[f + 1] - shape.first[f] > 1:
            return j
    return -1


@borrowing
def emit(top, proven, at, stack, leaves, work):
    """Write a leaf."""
    for j in range(stack.fixed.shape[1]):
        leaves.fixed[at, j] = stack.fixed[top, j]
    for a in range(3):
        for b in range(3):
            leaves.charts[at, a, b] = stack.charts[top, a, b]
            leaves.rotations[at, a, b] = work.rotation[a, b]
        leaves.lows[at, a], leaves.highs[at, a] = stack.lows[top, a], stack.highs[top, a]
        leaves.rooms[at, a, 0], leaves.rooms[at, a, 1] = (
            stack.rooms[top, a, 0],
            stack.rooms[top, a, 1],
        )
        leaves.translations[at, a] = work.translation[a]
    leaves.proven[at] = proven
    if proven:
        # It has a witness.
        n = stack.fixed.shape[1]
        for j in range(n):
            work.latest[j] = stack.fixed[top, j]
        work.latest[n] = PATIENCE


@borrowing
def slack_left(angle, problem, work):
    """How far poses of a tightened box move the solid, at most, in the least of the bounds."""
    known, square = problem.known, 0.0
    least = known.slack if len(known.corners) > 0 else np.inf
    for s in range(len(known.scales)):
        least = min(least, known.scales[s])
    for k in range(3, 6):
        square += (0.5 * (work.high[k] - work.low[k])) ** 2
    return (angle + np.sqrt(square)) * problem.shape.radius / least


@borrowing
def is_worth_it(top, stack, work):
    """Whether to go on looking for a witness of an interpretation, or a proof that it has none.

    Not if it has one: what else may be left of it is told as open. Nor if it took too long.
    """
    n, same = stack.fixed.shape[1], True
    for j in range(n):
        same &= work.latest[j] == stack.fixed[top, j]
        work.latest[j] = stack.fixed[top, j]
    if not same:
        work.latest[n] = 0
    work.latest[n] += 1
    work.latest[n + 1] += 1
    return work.latest[n] < PATIENCE and work.latest[n + 1] < POOL


@borrowing
def longest_side(work):
    """The longest side of a tightened box, turns counted at a radius."""
    best = 0
    for k in range(1, 6):
        if work.high[k] - work.low[k] > work.high[best] - work.low[best]:
            best = k
    return best


@borrowing
def settle_leaf(top, at, problem, stack, leaves, counts, work):
    """What becomes of a node whose contacts are all assigned.

    Args:
        top: the node.
        at: where a leaf is written.
        problem: see `cover.Problem`.
        stack: see `cover.Stack`.
        leaves: see `cover.Leaves`.
        counts: see `NODES`.
        work: see `work_space.Work`.

    Returns:
        `GONE`, `LEAF`, `CUT_UP`, `BY_PIECES` or `CUT_ANY`.
    """
    shape, touches, aims = problem.shape, problem.touches, problem.aims
    work.cut_count[0] = 0
    found, tries, coarse, angle = NONE, 0, np.inf, np.pi
    for turn in range(2 * ROUNDS):
        view(top, stack, shape, touches, work)
        set_box(top, stack, work)
        used = cut_rows(rows_of(top, stack, problem, work), work)
        share = tighten(0, 6, used, work)
        if share < 0.0:
            return GONE
        keep_box(top, stack, work)
        coarse, angle = coarseness(top, stack, touches, work)
        handy = angle < HANDY or coarse < 1.0
        if found != WITNESS and handy and len(problem.known.starts) > 0:
            for k in range(6):
                work.objective[k] = 0.5 * (work.low[k] + work.high[k]) if k >= 3 else 0.0
            end_pose(work.objective, shape, work)
            if not heed_paths(problem, work):
                return GONE
        if found != WITNESS and (found != CONTACTS or share > STUCK):
            counts[TRIED] += 1
            found = seek_inside(top, handy, problem, stack, work)
            if found < CONTACTS and coarse < LINEAR:
                found = max(found, seek_nearby(top, handy, problem, stack, work))
        if found == WITNESS:
            if coarse > FINE and not alike(top, angle, stack, aims):
                if handy and share < SHRINKS and turn < ROUNDS:
                    continue
                if not spreads(top, problem, stack, work):
                    return CUT_UP
            copy_pose(work.best, work.shift, work.rotation, work.translation)
            emit(top, True, at, stack, leaves, work)
            return LEAF
        if found == POLYGONS and on_pieces(top, stack, shape) >= 0:
            return BY_PIECES
        if not handy:
            return CUT_UP
        tries += 1
        if tries > 1 and share > STUCK and (coarse > FINEST or found == CONTACTS):
            break
        note_cuts(top, problem, stack, work)
    if found == CONTACTS and problem.known.anything:
        if slack_left(angle, problem, work) > LOOSE and is_worth_it(top, stack, work):
            return CUT_ANY
        emit(top, False, at, stack, leaves, work)
        return LEAF
    if coarse >= FINEST:
        return CUT_UP
    if on_pieces(top, stack, shape) >= 0:
        return BY_PIECES
    emit(top, False, at, stack, leaves, work)
    return LEAF
