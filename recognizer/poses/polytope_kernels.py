"""Compiled tightening of a box of poses by linear programs over rows."""

from __future__ import annotations

import numpy as np

from ..compiling import borrowing
from .simplex_kernels import farther, forget_vertex

ROUNDING = 1e-10
"""Room for rounding, as of a row."""
NEAR = 0.1
"""A vertex met so near to a side, as a share of the box, spares the program for that side."""


@borrowing
def tighten(first, last, count, work):
    """Shrink a box to what a polytope in it reaches, along some of its axes.

    Args:
        first: the first axis.
        last: one past the last.
        count: how many of the rows count.
        work: see `work_space.Work`. Its box, ``low`` and ``high``, is shrunk in place; ``sum`` is
            that of all vertices met, and how many.

    Returns:
        What is left of the longest side, at most, as a share; below zero if no pose is left.
    """
    low, high, objective, seen = work.low, work.high, work.objective, work.seen
    forget_vertex(work.programs)
    vertex, known = work.programs[3], work.programs[9]
    work.sum[6] = 0.0
    for k in range(6):
        work.sum[k] = 0.0
        objective[k] = 0.0
        seen[k, 0], seen[k, 1] = np.inf, -np.inf
    most = 0.0
    for k in range(first, last):
        before = high[k] - low[k]
        if before == 0.0:
            continue
        for side in range(2):
            if side == 1 and seen[k, 1] >= high[k] - NEAR * before:
                continue
            if side == 0 and seen[k, 0] <= low[k] + NEAR * before:
                continue
            objective[k] = 2.0 * side - 1.0
            reach = farther(objective, work.columns, count, low, high, work.programs) + ROUNDING
            objective[k] = 0.0
            if side == 1:
                high[k] = min(high[k], reach)
            else:
                low[k] = max(low[k], -reach)
            if low[k] > high[k]:
                return -1.0
            if known[0]:
                work.sum[6] += 1.0
                for j in range(6):
                    work.sum[j] += vertex[j]
                    seen[j, 0] = min(seen[j, 0], vertex[j])
                    seen[j, 1] = max(seen[j, 1], vertex[j])
        most = max(most, (high[k] - low[k]) / before)
    return most
