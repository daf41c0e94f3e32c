"""Compiled linear programs over small motions: how far a polytope in a box reaches.

Dual simplex (Lemke 1954) in six variables. Every basis on the way has multipliers, and whatever
they are they prove a bound: a sum of inequalities with weights that aren't negative is one, and
what it leaves over of the objective is bounded by the box. So bounds hold whenever the method
stops, and rounding takes nothing from them.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from .compiling import borrowing

PIVOTS = 60
"""The most of a program."""
EXACT = 1e-9
"""By how much a vertex may break an inequality, as a share of the box's largest side."""
BOX = 12
"""Inequalities below this number are the box's own: low and high of each variable in turn."""


@njit(cache=True)
def simplex_space():
    """Work space of a program.

    Active rows (6,), the inverse of their matrix (6, 6), multipliers (6,), a vertex (6,), a row's
    multipliers (6,), and what is left over of an objective (6,).
    """
    return (
        np.empty(6, np.int64),
        np.empty((6, 6)),
        np.empty(6),
        np.empty(6),
        np.empty(6),
        np.empty(6),
    )


@borrowing
def _add_multiple(r, multiplier, rows, limits, low, high, rest):
    """Add a multiple of an inequality to (6,) ``rest``; returns that of its limit."""
    if r < BOX:
        k = r >> 1
        if r & 1:
            rest[k] += multiplier
            return multiplier * high[k]
        rest[k] -= multiplier
        return -multiplier * low[k]
    for k in range(6):
        rest[k] += multiplier * rows[r - BOX, k]
    return multiplier * limits[r - BOX]


@borrowing
def _most_broken(rows, limits, count, low, high, vertex):
    """The inequality that a vertex breaks most; -1 if none."""
    side = 0.0
    for k in range(6):
        side = max(side, high[k] - low[k])
    entering, worst = -1, EXACT * side
    for r in range(count):
        excess = -limits[r]
        for k in range(6):
            excess += rows[r, k] * vertex[k]
        if excess > worst:
            entering, worst = r + BOX, excess
    for k in range(6):
        if vertex[k] - high[k] > worst:
            entering, worst = 2 * k + 1, vertex[k] - high[k]
        if low[k] - vertex[k] > worst:
            entering, worst = 2 * k, low[k] - vertex[k]
    return entering


@borrowing
def farthest(objective, rows, limits, count, low, high, space):
    """How far a polytope in a box reaches along a direction.

    Args:
        objective: (6,) the direction.
        rows: (m, 6) of the inequalities ``rows @ z <= limits``, of which ``count`` count.
        limits: (m,) likewise.
        count: how many.
        low: (6,) the box.
        high: (6,) likewise.
        space: see `simplex_space`.

    Returns:
        The reach; minus infinity if the polytope is empty.
    """
    active, inverse, multipliers, vertex, shares, rest = space
    # The box's corner that is farthest.
    for k in range(6):
        positive = objective[k] >= 0.0
        active[k] = 2 * k + (1 if positive else 0)
        for j in range(6):
            inverse[k, j] = 0.0
        inverse[k, k] = 1.0 if positive else -1.0
        multipliers[k] = abs(objective[k])
    for _ in range(PIVOTS):
        for k in range(6):
            vertex[k] = 0.0
        for j in range(6):
            r = active[j]
            limit = (high[r >> 1] if r & 1 else -low[r >> 1]) if r < BOX else limits[r - BOX]
            for k in range(6):
                vertex[k] += inverse[k, j] * limit
        entering = _most_broken(rows, limits, count, low, high, vertex)
        if entering < 0:
            break
        leaving, ratio = -1, np.inf
        for j in range(6):
            if entering < BOX:
                shares[j] = (1.0 if entering & 1 else -1.0) * inverse[entering >> 1, j]
            else:
                shares[j] = 0.0
                for k in range(6):
                    shares[j] += rows[entering - BOX, k] * inverse[k, j]
            if shares[j] > 1e-9 and multipliers[j] < ratio * shares[j]:
                leaving, ratio = j, multipliers[j] / shares[j]
        if leaving < 0:
            # What enters, less its shares of the active ones, is about nothing (Farkas).
            rest[:] = 0.0
            most = _add_multiple(entering, 1.0, rows, limits, low, high, rest)
            for j in range(6):
                share = max(-shares[j], 0.0)
                most += _add_multiple(active[j], share, rows, limits, low, high, rest)
            for k in range(6):
                most -= min(rest[k] * low[k], rest[k] * high[k])
            # By more than what a sum of six products loses.
            if most < -1e-3 * EXACT * (high[0] - low[0]):
                return -np.inf
            break
        for j in range(6):
            multipliers[j] = ratio if j == leaving else multipliers[j] - ratio * shares[j]
        for k in range(6):
            inverse[k, leaving] /= shares[leaving]
        for j in range(6):
            if j != leaving:
                for k in range(6):
                    inverse[k, j] -= shares[j] * inverse[k, leaving]
        active[leaving] = entering
    rest[:] = 0.0
    bound = 0.0
    for j in range(6):
        share = max(multipliers[j], 0.0)
        bound += _add_multiple(active[j], share, rows, limits, low, high, rest)
    for k in range(6):
        left = objective[k] - rest[k]
        bound += max(left * low[k], left * high[k])
    return bound
