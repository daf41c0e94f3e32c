"""Compiled searches for a witness of a node: from inside its polytope, or beside another one."""

from __future__ import annotations

import numpy as np

from ..compiling import borrowing
from .boxes_kernels import gibbs_between, shift_of, turn_chart
from .motions.motion_kernels import copy_pose
from .node_kernels import view
from .polytope_kernels import tighten
from .shrink_kernels import cut_rows, note_cuts, rows_of
from .witness_kernels import CONTACTS, WITNESS, seek_witness

NEARBY = 1e-6
"""Radians, and radii: a box may be a point."""
PROGRAMS = 6
"""Times that a box is linearised anew about where a search ended."""


@borrowing
def end_pose(z, shape, work):
    """The pose, object to world, of a turn about the box's middle and a shift, (6,) together."""
    q = work.other
    turn_chart((0.5 * z[0], 0.5 * z[1], 0.5 * z[2]), work.middle, work.turn, q)
    for a in range(3):
        work.translation[a] = work.mean[a]
        for b in range(3):
            work.rotation[a, b] = q[b, a]
            work.translation[a] -= shape.radius * q[b, a] * z[3 + b]


@borrowing
def seek_from(z, heeding, top, problem, stack, work):
    """A witness of a node, sought from a turn about the box's middle and a shift, (6,) together.

    It breaks nothing else that is known, if that is heeded.

    Returns:
        See `witness_kernels.seek_witness`.
    """
    end_pose(z, problem.shape, work)
    return seek_witness(
        stack.fixed[top],
        stack.targets[top],
        problem.contacts,
        problem.model,
        problem.known,
        heeding and problem.known.anything,
        work.rotation,
        work.translation,
        work.seeking,
    )


@borrowing
def coordinates(rotation, translation, radius, work, z):
    """A pose, object to world, as a turn about the box's middle and a shift, (6,) in place.

    Returns:
        Whether it has them: not half a turn away.
    """
    shift_of(rotation, translation, work.mean, radius, work.turn, z[3:])
    known = gibbs_between(work.middle, work.turn, z)
    for a in range(3):
        z[a] *= 2.0
    return known


@borrowing
def spreads(top, problem, stack, work):
    """Whether a pose within the bounds on contacts is farther from the witness than alike.

    What else is known is not asked here: a box is then told as wider than it is. The pose is sought
    from twice as far, along each axis along which the box is so wide.
    """
    shape, aims = problem.shape, problem.aims
    z, least = work.objective, 1.0 + 2.0 * np.cos(aims.turn)
    for k in range(6):
        step = 2.0 * (aims.turn if k < 3 else aims.shift)
        if work.high[k] - work.low[k] < step:
            continue
        for side in (-1.0, 1.0):
            coordinates(work.best, work.shift, shape.radius, work, z)
            z[k] += side * step
            if seek_from(z, False, top, problem, stack, work) != WITNESS:
                continue
            trace, square = 0.0, 0.0
            for a in range(3):
                moved = 0.0
                for b in range(3):
                    trace += work.best[a, b] * work.rotation[a, b]
                    moved += work.rotation[b, a] * (work.mean[b] - work.translation[b])
                    moved -= work.best[b, a] * (work.mean[b] - work.shift[b])
                square += moved * moved
            if trace < least or np.sqrt(square) > aims.shift * shape.radius:
                return True
    return False


@borrowing
def seek_inside(top, near, problem, stack, work):
    """A witness from inside the polytope, which its box's middle need not be.

    Args:
        top: the node.
        near: whether one far outside the box is another's witness. It isn't in a box so wide that
            its poses are told as a family, whichever they are.
        problem: see `cover.Problem`.
        stack: see `cover.Stack`.
        work: see `work_space.Work`.

    Returns:
        See `witness_kernels.seek_witness`; `CONTACTS` if there is one, but not near.
    """
    for k in range(6):
        work.objective[k] = 0.5 * (work.low[k] + work.high[k])
        if work.sum[6] > 0.0:
            work.objective[k] = work.sum[k] / work.sum[6]
    found = seek_from(work.objective, True, top, problem, stack, work)
    return keep_witness(found, near, problem.shape.radius, work)


@borrowing
def keep_witness(found, near, radius, work):
    """Keep a pose as the best, if one was found; see `seek_inside`."""
    if found == WITNESS:
        if near and not is_near(radius, work):
            return CONTACTS
        copy_pose(work.rotation, work.translation, work.best, work.shift)
    return found


@borrowing
def is_near(radius, work):
    """Whether a pose is in a box, or no farther from it than that is wide."""
    if not coordinates(work.rotation, work.translation, radius, work, work.objective):
        return False
    for k in range(6):
        away = abs(work.objective[k] - 0.5 * (work.high[k] + work.low[k]))
        if away > 1.5 * (work.high[k] - work.low[k]) + NEARBY:
            return False
    return True


@borrowing
def seek_nearby(top, near, problem, stack, work):
    """A witness by linear programs about where the last search for one ended.

    There the rows are exact to first order. Where bounds leave little, less than a polytope about
    the middle of the box can tell, programs find their way inside; least squares stall.
    Arguments and result as of `seek_inside`; the box is as it was.
    """
    z, radius, found = work.objective, problem.shape.radius, 0
    for k in range(6):
        work.kept[k, 0], work.kept[k, 1] = work.low[k], work.high[k]
    for _ in range(PROGRAMS):
        shift_of(work.rotation, work.translation, work.mean, radius, work.middle, z[3:])
        for k in range(6):
            side = work.kept[k, 1] - work.kept[k, 0]
            middle = z[k] if k >= 3 else 0.0
            work.low[k], work.high[k] = middle - side, middle + side
        for k in range(3):
            work.half[k] = 0.0
        note_cuts(top, problem, stack, work)
        used = cut_rows(rows_of(top, stack, problem, work), work)
        if tighten(0, 6, used, work) < 0.0 or work.sum[6] == 0.0:
            break
        for k in range(6):
            z[k] = work.sum[k] / work.sum[6]
        found = max(found, seek_from(z, True, top, problem, stack, work))
        if found >= CONTACTS:
            break
    view(top, stack, problem.shape, problem.touches, work)
    for k in range(6):
        work.low[k], work.high[k] = work.kept[k, 0], work.kept[k, 1]
    return keep_witness(found, near, problem.shape.radius, work)
