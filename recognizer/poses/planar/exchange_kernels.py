"""Compiled decision at one angle: a place that meets all bounds, or a proof that there is none.

With the contacts turned about their mean, ``q_i(a) = R(-a) (p_i - mean)``, a pose is an angle ``a``
and the place ``y`` of that mean in the object's frame. It has to bring each ``y + q_i(a)`` within
its bound ``b_i`` of edge ``i``. For one angle the least excess

    v(a) = min over y of max over i of (distance(y + q_i(a), edge i) - b_i)

is a convex problem in two unknowns. For any unit vector ``d`` the distance is at least
``d . (y + q_i(a)) - h_i(d)``, with ``h_i(d)`` the most that ``d . x`` is on the edge. Three such
bounds with weights ``w_k >= 0`` of sum 1 and ``sum w_k d_k = 0`` give a bound free of y,

    v(a) >= sum w_k (d_k . q_k(a) - h_k(d_k) - b_k) = M cos(a - a0) - K.

At the optimum for one angle it is v there (three suffice: Helly's theorem in the plane). But it
holds for every angle, so if v is above zero at one, a whole arc around that one is excluded, in
closed form.
"""

from __future__ import annotations

import numpy as np

from ...compiling import inlined, kernel
from .motion_kernels import EXACT, nearest_on_edge

FOUND, EXCLUDED, OPEN = 1, 0, 2
"""A place within all bounds was found; there is none; neither could be shown."""
MOST_EXCHANGES = 60


@inlined
def _cross(a0, a1, b0, b1):
    return a0 * b1 - a1 * b0


@kernel
def _support(d0, d1, edge, outline):
    """The most that ``d . x`` is on an edge."""
    starts, tangents, lengths = outline[0], outline[1], outline[2]
    along = d0 * tangents[edge, 0] + d1 * tangents[edge, 1]
    return d0 * starts[edge, 0] + d1 * starts[edge, 1] + max(along * lengths[edge], 0.0)


@kernel
def start_exchange(face, reach, outline, basis, bounds):
    """The first three bounds: from both sides of the first contact's edge, and past its end.

    Args:
        face: the edge of contact 0.
        reach: its bound, metres.
        outline: see `planar_motion_kernels`.
        basis: (3,) the contact of each bound, written in place.
        bounds: (3, 3) direction ``d`` and ``h(d) + b`` of each bound, written in place.
    """
    t0, t1 = outline[1][face, 0], outline[1][face, 1]
    basis[:] = 0
    bounds[0, 0], bounds[0, 1] = t1, -t0
    bounds[1, 0], bounds[1, 1] = -t1, t0
    bounds[2, 0], bounds[2, 1] = t0, t1
    for k in range(3):
        bounds[k, 2] = _support(bounds[k, 0], bounds[k, 1], face, outline) + reach


@kernel
def least_excess(angle, faces, arms, reaches, outline, margin, basis, bounds, weights, y):
    """Solve the problem in y at one angle until it is decided, by exchanging bounds.

    The dual simplex method: the weights stay a proof while the bound they give rises, so the basis
    of one angle is a start for another. The bound that enters is the one that the contact worst
    off has at the current y.

    Args:
        angle: radians.
        faces: (n,) the edge of each contact.
        arms: (n, 2) contacts from their mean, world frame.
        reaches: (n,) bounds on positions, metres.
        outline: see `planar_motion_kernels`.
        margin: what counts as above zero, metres.
        basis: (3,) see `start_exchange`; changed in place.
        bounds: (3, 3) likewise.
        weights: (3,) written in place: those of the bounds.
        y: (2,) written in place.

    Returns:
        FOUND, EXCLUDED or OPEN.
    """
    cosine, sine = np.cos(angle), np.sin(angle)
    right = np.empty(3)
    for exchange in range(MOST_EXCHANGES):
        a0, a1 = bounds[0, 0], bounds[0, 1]
        b0, b1 = bounds[1, 0], bounds[1, 1]
        c0, c1 = bounds[2, 0], bounds[2, 1]
        weights[0] = _cross(b0, b1, c0, c1)
        weights[1] = _cross(c0, c1, a0, a1)
        weights[2] = _cross(a0, a1, b0, b1)
        total = weights[0] + weights[1] + weights[2]
        if abs(total) < 1e-14:
            return OPEN
        weights /= total
        level = 0.0
        for k in range(3):
            q0, q1 = arms[basis[k], 0], arms[basis[k], 1]
            turned = bounds[k, 0] * (cosine * q0 + sine * q1)
            turned += bounds[k, 1] * (cosine * q1 - sine * q0)
            right[k] = bounds[k, 2] - turned
            level -= weights[k] * right[k]
        # All three bounds are equal at y.
        u, v = right[0] - right[2], right[1] - right[2]
        y[0] = (u * (b1 - c1) - v * (a1 - c1)) / total
        y[1] = (v * (a0 - c0) - u * (b0 - c0)) / total
        met = True
        worst = -np.inf
        where, e0, e1 = 0, 0.0, 0.0
        for i in range(len(faces)):
            q0, q1 = arms[i, 0], arms[i, 1]
            g0, g1, _ = nearest_on_edge(
                y[0] + cosine * q0 + sine * q1, y[1] + cosine * q1 - sine * q0, faces[i], outline
            )
            distance = np.sqrt(g0 * g0 + g1 * g1)
            met &= distance <= reaches[i] * (1.0 + 0.5 * EXACT)
            if distance - reaches[i] > worst:
                worst = distance - reaches[i]
                where = i
                scale = 1.0 / max(distance, 1e-300)
                e0, e1 = g0 * scale, g1 * scale
        if met:
            return FOUND
        # The higher the bound, the wider the arc it excludes; the last half of it isn't worth it.
        if level > margin and (worst < 2.0 * level or exchange > MOST_EXCHANGES // 2):
            return EXCLUDED
        # Taking in the new bound with weight s changes the others' by -s times the new direction's
        # barycentric coordinates; the first to reach zero leaves.
        leaving, least = -1, np.inf
        for k in range(3):
            if k == 0:
                share = _cross(b0 - e0, b1 - e1, c0 - e0, c1 - e1) / total
            elif k == 1:
                share = _cross(c0 - e0, c1 - e1, a0 - e0, a1 - e1) / total
            else:
                share = _cross(a0 - e0, a1 - e1, b0 - e0, b1 - e1) / total
            if share > 1e-12 and weights[k] < least * share:
                leaving, least = k, weights[k] / share
        if leaving < 0 or worst <= level:
            return OPEN
        basis[leaving] = where
        bounds[leaving, 0], bounds[leaving, 1] = e0, e1
        bounds[leaving, 2] = _support(e0, e1, faces[where], outline) + reaches[where]
    return OPEN


@kernel
def excluded_arc(arms, extent, margin, basis, bounds, weights):
    """The angles at which the weighted bounds are above the margin: middle and half-width, radians.

    Args:
        arms: (n, 2) contacts from their mean, world frame.
        extent: no pose has a ``y`` longer than this, metres.
        margin: metres.
        basis: (3,) see `start_exchange`.
        bounds: (3, 3) likewise.
        weights: (3,) of the bounds; made into a proof that rounding can't hurt.
    """
    for k in range(3):
        weights[k] = max(weights[k], 0.0)
    weights /= weights.sum()
    along, across, level = 0.0, 0.0, 0.0
    rest0, rest1 = 0.0, 0.0
    for k in range(3):
        d0, d1 = bounds[k, 0], bounds[k, 1]
        q0, q1 = arms[basis[k], 0], arms[basis[k], 1]
        along += weights[k] * (d0 * q0 + d1 * q1)
        across += weights[k] * (d0 * q1 - d1 * q0)
        level += weights[k] * bounds[k, 2]
        rest0 += weights[k] * d0
        rest1 += weights[k] * d1
    # Rounding leaves the weighted directions a sum that y still bears on.
    level += margin + extent * np.sqrt(rest0 * rest0 + rest1 * rest1)
    swing = np.sqrt(along * along + across * across)
    if level <= -swing:
        return 0.0, 2.0 * np.pi
    if level >= swing:
        return 0.0, -1.0
    return np.arctan2(across, along), np.arccos(level / swing)
