"""Compiled linear programs over small motions: how far a polytope in a box reaches.

The simplex method in six variables: from the box's corner by the dual (Lemke 1954), from a vertex
that an earlier program ended at by the primal. Every basis has multipliers, and whatever they are
they prove a bound: a sum of inequalities with weights that aren't negative is one, and what it
leaves over of the objective is bounded by the box. So bounds hold whenever the method stops, and
rounding takes nothing from them.
"""

from __future__ import annotations

import numpy as np

from ..compiling import borrowing, kernel, vectorised

PIVOTS = 60
"""The most of a program."""
EXACT = 1e-9
"""By how much a vertex may break an inequality, as a share of the box's largest side."""
STEEP = 1e-9
"""What counts as above zero, of multipliers and of an inequality's pace along an edge."""
AT_ONCE = 1e-15
"""A slack below which an inequality is met at once."""
BOX = 12
"""Inequalities below this number are the box's own: low and high of each variable in turn."""


@kernel
def simplex_space(most):
    """Work space of programs with so many inequalities, and the vertex that the last one ended at.

    Active inequalities (6,), the inverse of their matrix (6, 6), multipliers (6,), a vertex (6,),
    an inequality's shares of the active ones (6,), what is left over of an objective or the way
    along an edge (6,); of each inequality its slack, its pace along an edge, and how soon
    it is met there, (m,) each; and whether the vertex is one of the polytope (1,).
    """
    return (
        np.empty(6, np.int64),
        np.empty((6, 6)),
        np.empty(6),
        np.empty(6),
        np.empty(6),
        np.empty(6),
        np.empty(most),
        np.empty(most),
        np.empty(most),
        np.zeros(1, np.bool_),
    )


@borrowing
def _add_multiple(r, multiplier, columns, low, high, rest):
    """Add a multiple of an inequality to (6,) ``rest``; returns that of its limit."""
    if r < BOX:
        k = r >> 1
        if r & 1:
            rest[k] += multiplier
            return multiplier * high[k]
        rest[k] -= multiplier
        return -multiplier * low[k]
    for k in range(6):
        rest[k] += multiplier * columns[k, r - BOX]
    return multiplier * columns[6, r - BOX]


@vectorised
def _set_slacks(columns, count, vertex, slacks):
    v0, v1, v2, v3, v4, v5 = vertex[0], vertex[1], vertex[2], vertex[3], vertex[4], vertex[5]
    for r in range(count):
        near = columns[0, r] * v0 + columns[1, r] * v1 + columns[2, r] * v2
        slacks[r] = (columns[6, r] - near) - (
            columns[3, r] * v3 + columns[4, r] * v4 + columns[5, r] * v5
        )


@vectorised
def _set_paces(columns, count, step, paces):
    s0, s1, s2, s3, s4, s5 = step[0], step[1], step[2], step[3], step[4], step[5]
    for r in range(count):
        near = columns[0, r] * s0 + columns[1, r] * s1 + columns[2, r] * s2
        paces[r] = near + (columns[3, r] * s3 + columns[4, r] * s4 + columns[5, r] * s5)


@vectorised
def _set_haste(count, paces, slacks, haste):
    """Inverse of how far along an edge each inequality is met, negated; zero if it never is."""
    for r in range(count):
        ratio = -paces[r] / max(slacks[r], AT_ONCE)
        haste[r] = ratio if paces[r] > STEEP else 0.0


@borrowing
def _least(values, count):
    """Where the least of some values is, and which it is; -1 and 0 if none is below zero.

    In four strands, so that no comparison waits for the one before it.
    """
    a, b, c, d = 0.0, 0.0, 0.0, 0.0
    at_a, at_b, at_c, at_d = -1, -1, -1, -1
    whole = count & ~3
    for r in range(0, whole, 4):
        if values[r] < a:
            a, at_a = values[r], r
        if values[r + 1] < b:
            b, at_b = values[r + 1], r + 1
        if values[r + 2] < c:
            c, at_c = values[r + 2], r + 2
        if values[r + 3] < d:
            d, at_d = values[r + 3], r + 3
    for r in range(whole, count):
        if values[r] < a:
            a, at_a = values[r], r
    if b < a:
        a, at_a = b, at_b
    if d < c:
        c, at_c = d, at_d
    if c < a:
        a, at_a = c, at_c
    return at_a, a


@vectorised
def _go_along(count, far, paces, slacks):
    for r in range(count):
        slacks[r] -= far * paces[r]


@borrowing
def _set_vertex(columns, low, high, space):
    """The vertex where the active inequalities meet."""
    active, inverse, vertex = space[0], space[1], space[3]
    for k in range(6):
        vertex[k] = 0.0
    for j in range(6):
        r = active[j]
        limit = (high[r >> 1] if r & 1 else -low[r >> 1]) if r < BOX else columns[6, r - BOX]
        for k in range(6):
            vertex[k] += inverse[k, j] * limit


@borrowing
def _set_shares(r, columns, space):
    """An inequality as a sum of the active ones."""
    inverse, shares = space[1], space[4]
    for j in range(6):
        if r < BOX:
            shares[j] = (1.0 if r & 1 else -1.0) * inverse[r >> 1, j]
        else:
            shares[j] = 0.0
            for k in range(6):
                shares[j] += columns[k, r - BOX] * inverse[k, j]


@borrowing
def _exchange(leaving, entering, space):
    """Make an inequality active, of which the shares are set, in place of another."""
    active, inverse, shares = space[0], space[1], space[4]
    scale = 1.0 / shares[leaving]
    for k in range(6):
        inverse[k, leaving] *= scale
        part = inverse[k, leaving]
        for j in range(6):
            if j != leaving:
                inverse[k, j] -= shares[j] * part
    active[leaving] = entering


@borrowing
def _most_broken(count, low, high, space):
    """The inequality that a vertex breaks most; -1 if none."""
    vertex, slacks = space[3], space[6]
    side = 0.0
    for k in range(6):
        side = max(side, high[k] - low[k])
    r, least = _least(slacks, count)
    entering = r + BOX
    if least >= -EXACT * side:
        entering, least = -1, -EXACT * side
    for k in range(6):
        if high[k] - vertex[k] < least:
            entering, least = 2 * k + 1, high[k] - vertex[k]
        if vertex[k] - low[k] < least:
            entering, least = 2 * k, vertex[k] - low[k]
    return entering


@borrowing
def _first_met(count, low, high, space):
    """The inequality that is met first along an edge from a vertex, and how far along."""
    vertex, step, slacks, paces, haste = space[3], space[5], space[6], space[7], space[8]
    _set_haste(count, paces, slacks, haste)
    r, ratio = _least(haste, count)
    entering, far = -1, np.inf
    if r >= 0:
        entering, far = r + BOX, -1.0 / ratio
    for k in range(6):
        if step[k] > STEEP:
            room = max(high[k] - vertex[k], 0.0)
            if room < far * step[k]:
                entering, far = 2 * k + 1, room / step[k]
        elif step[k] < -STEEP:
            room = max(vertex[k] - low[k], 0.0)
            if room < far * -step[k]:
                entering, far = 2 * k, room / -step[k]
    return entering, far


@borrowing
def _bound(objective, columns, low, high, space):
    """What the multipliers of the active inequalities prove of an objective."""
    active, multipliers, rest = space[0], space[2], space[5]
    for k in range(6):
        rest[k] = 0.0
    bound = 0.0
    for j in range(6):
        share = max(multipliers[j], 0.0)
        bound += _add_multiple(active[j], share, columns, low, high, rest)
    for k in range(6):
        left = objective[k] - rest[k]
        bound += max(left * low[k], left * high[k])
    return bound


@borrowing
def farthest(objective, columns, count, low, high, space):
    """How far a polytope in a box reaches along a direction.

    Args:
        objective: (6,) the direction.
        columns: (7, m) of each inequality ``row @ z <= limit`` the row and the limit.
        count: how many of them count.
        low: (6,) the box.
        high: (6,) likewise.
        space: see `simplex_space`.

    Returns:
        The reach; minus infinity if the polytope is empty.
    """
    active, inverse, multipliers, vertex, shares, rest, slacks, _, _, known = space
    known[0] = False
    # The box's corner that is farthest.
    for k in range(6):
        positive = objective[k] >= 0.0
        active[k] = 2 * k + (1 if positive else 0)
        for j in range(6):
            inverse[k, j] = 0.0
        inverse[k, k] = 1.0 if positive else -1.0
        multipliers[k] = abs(objective[k])
    for _ in range(PIVOTS):
        _set_vertex(columns, low, high, space)
        _set_slacks(columns, count, vertex, slacks)
        entering = _most_broken(count, low, high, space)
        if entering < 0:
            known[0] = True
            break
        _set_shares(entering, columns, space)
        leaving, ratio = -1, np.inf
        for j in range(6):
            if shares[j] > STEEP and multipliers[j] < ratio * shares[j]:
                leaving, ratio = j, multipliers[j] / shares[j]
        if leaving < 0:
            # What enters, less its shares of the active ones, is about nothing (Farkas).
            rest[:] = 0.0
            most = _add_multiple(entering, 1.0, columns, low, high, rest)
            for j in range(6):
                share = max(-shares[j], 0.0)
                most += _add_multiple(active[j], share, columns, low, high, rest)
            for k in range(6):
                most -= min(rest[k] * low[k], rest[k] * high[k])
            # By more than what a sum of six products loses.
            if most < -1e-3 * EXACT * (high[0] - low[0]):
                return -np.inf
            break
        for j in range(6):
            multipliers[j] = ratio if j == leaving else multipliers[j] - ratio * shares[j]
        _exchange(leaving, entering, space)
    return _bound(objective, columns, low, high, space)


@borrowing
def forget_vertex(space):
    """Let the next program start anew: it is about another polytope."""
    space[9][0] = False


@borrowing
def farther(objective, columns, count, low, high, space):
    """`farthest`, from the vertex that the last program about the same polytope ended at.

    The box may have been shrunk since, to what holds the polytope. Half as many steps mostly.
    """
    _, inverse, multipliers, vertex, shares, step, slacks, paces, _, known = space
    if not known[0]:
        return farthest(objective, columns, count, low, high, space)
    _set_vertex(columns, low, high, space)
    _set_slacks(columns, count, vertex, slacks)
    for _ in range(PIVOTS):
        leaving, least = -1, -STEEP
        for j in range(6):
            value = 0.0
            for k in range(6):
                value += objective[k] * inverse[k, j]
            multipliers[j] = value
            if value < least:
                leaving, least = j, value
        if leaving < 0:
            return _bound(objective, columns, low, high, space)
        for k in range(6):
            step[k] = -inverse[k, leaving]
        _set_paces(columns, count, step, paces)
        entering, far = _first_met(count, low, high, space)
        if entering < 0:
            break
        _set_shares(entering, columns, space)
        if abs(shares[leaving]) < STEEP:
            break  # the matrix is singular to rounding, or about to be
        _exchange(leaving, entering, space)
        _set_vertex(columns, low, high, space)
        _go_along(count, far, paces, slacks)
    return farthest(objective, columns, count, low, high, space)
