"""Compiled geometry of the plane: distances of edges, and bit masks of compatible edge pairs.

The masks are laid out as `tree_kernels.grow` reads them, so that the tree is the same in the plane
and in space. As there, every constant beside a bit set is an explicit ``np.uint64``.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from ..tree.tree_kernels import ANGLE, COMPONENT, DISTANCE, TILT

ANGLE_ROUNDING = 1e-9
"""Angles between measured normals are widened by this, radians: rounding."""

_ONE = np.uint64(1)


@njit(cache=True)
def wrap(angle):
    """The same angle in [-pi, pi], radians."""
    return angle - 2.0 * np.pi * np.round(angle / (2.0 * np.pi))


@njit(cache=True)
def turn_between(u, v):
    """The angle by which (2,) ``u`` turns counter-clockwise into ``v``, radians in [-pi, pi]."""
    return np.arctan2(u[0] * v[1] - u[1] * v[0], u[0] * v[0] + u[1] * v[1])


@njit(cache=True)
def _point_segment_squared(p, a, b):
    e0, e1 = b[0] - a[0], b[1] - a[1]
    g0, g1 = p[0] - a[0], p[1] - a[1]
    share = (g0 * e0 + g1 * e1) / max(e0 * e0 + e1 * e1, 1e-300)
    share = min(max(share, 0.0), 1.0)
    g0 -= share * e0
    g1 -= share * e1
    return g0 * g0 + g1 * g1


@njit(cache=True)
def _side(a, b, p):
    return (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])


@njit(cache=True)
def segment_distances(segments):
    """Smallest distance between every two of (e, 2, 2) segments, as (e, e); zero if they cross."""
    count = len(segments)
    nearest = np.zeros((count, count))
    for i in range(count):
        a, b = segments[i, 0], segments[i, 1]
        for j in range(i + 1, count):
            c, d = segments[j, 0], segments[j, 1]
            # Segments that don't cross are nearest at an end of one of them.
            best = min(
                min(_point_segment_squared(a, c, d), _point_segment_squared(b, c, d)),
                min(_point_segment_squared(c, a, b), _point_segment_squared(d, a, b)),
            )
            if (_side(a, b, c) > 0.0) != (_side(a, b, d) > 0.0) and (
                (_side(c, d, a) > 0.0) != (_side(c, d, b) > 0.0)
            ):
                best = 0.0
            nearest[i, j] = np.sqrt(best)
            nearest[j, i] = nearest[i, j]
    return nearest


@njit(cache=True)
def tilt_ranges(segments, normals):
    """Range of the angle from edge a's normal to a direction from a point of a to one of b.

    The vectors from a to b fill a parallelogram. Two edges of one outline have at most a corner in
    common, so it has the origin at a corner or outside: its directions span less than pi, and the
    extreme ones point at its corners.

    Args:
        segments: (e, 2, 2) first and last point of each edge.
        normals: (e, 2) outward unit normals.

    Returns:
        (e, e) first angles in [-2 pi, pi], (e, e) last angles, not below the first; counted
        counter-clockwise, radians. On the diagonal -pi and pi: any.
    """
    count = len(segments)
    first = np.full((count, count), -np.pi)
    last = np.full((count, count), np.pi)
    between = np.empty(2)
    for a in range(count):
        for b in range(count):
            if a == b:
                continue
            between[:] = 0.0
            for k in range(2):
                between += segments[b, k] - segments[a, k]
            middle = turn_between(normals[a], between)
            low, high = 0.0, 0.0
            for k in range(2):
                for m in range(2):
                    corner = segments[b, m] - segments[a, k]
                    if corner[0] == 0.0 and corner[1] == 0.0:
                        continue
                    turn = turn_between(between, corner)
                    low = min(low, turn)
                    high = max(high, turn)
            first[a, b] = middle + low
            last[a, b] = middle + high
    return first, last


@njit(cache=True)
def _apart(low, high, middle, half):
    """Whether the arcs [low, high] and middle -+ half, radians, have nothing in common."""
    return abs(wrap(0.5 * (low + high) - middle)) > 0.5 * (high - low) + half


@njit(cache=True)
def pair_masks(
    positions,
    normals,
    position_error,
    normal_error,
    distance_min,
    distance_max,
    angle,
    component_min,
    component_max,
    tilt_min,
    tilt_max,
    domains,
    from_contact,
    constraints,
    masks,
):
    """Which edges contact j can be on if contact i is on edge a, for i < j, j >= from_contact.

    Args:
        positions: (n, 2) world, metres.
        normals: (n, 2) world, unit.
        position_error: (n,) metres.
        normal_error: (n,) radians, pi where the normal is unknown.
        distance_min ... tilt_max: (e, e) the model's range tables.
        domains: (n, w) bit sets, the edges each contact may be on; narrowed in place for
            contacts from ``from_contact`` on, to edges that some partner supports.
        from_contact: pairs of contacts below it are left alone.
        constraints: bits, which constraints to apply.
        masks: (n, n, e, w) bit sets, written in place.
    """
    count = len(positions)
    edges = len(angle)
    words = domains.shape[1]
    supported = np.empty(words, np.uint64)
    for j in range(from_contact, count):
        for i in range(j):
            d = positions[j] - positions[i]
            length = np.sqrt(d[0] * d[0] + d[1] * d[1])
            # Each end of the vector is off by its own bound at most (memo's 2-delta).
            reach = position_error[i] + position_error[j]
            # Each normal is off by its own bound, either way, so the angle from one to the other,
            # which has a sign in the plane, is off by the sum. Turning the world changes nothing.
            both = normal_error[i] + normal_error[j] + ANGLE_ROUNDING
            gamma = turn_between(normals[i], normals[j])
            omega_i = turn_between(normals[i], d)
            omega_j = turn_between(normals[j], -d)
            # The true normal is within its bound of the measured one, so its component of d runs
            # from cos(omega + alpha) to cos(omega - alpha), clamped to [0, pi]; either end of d is
            # off by its bound, and a component by no more than the vector.
            low_i = length * np.cos(min(np.pi, abs(omega_i) + normal_error[i])) - reach
            high_i = length * np.cos(max(0.0, abs(omega_i) - normal_error[i])) + reach
            low_j = length * np.cos(min(np.pi, abs(omega_j) + normal_error[j])) - reach
            high_j = length * np.cos(max(0.0, abs(omega_j) - normal_error[j])) + reach
            # The true vector may point anywhere within asin(reach / length) of the measured one,
            # and anywhere at all if it may be zero; the normal adds its own bound.
            swing = np.arcsin(reach / length) if length > reach else np.pi
            bend_i = normal_error[i] + swing
            bend_j = normal_error[j] + swing
            supported[:] = np.uint64(0)
            for a in range(edges):
                row = masks[i, j, a]
                row[:] = np.uint64(0)
                if (domains[i, a >> 6] >> np.uint64(a & 63)) & _ONE == np.uint64(0):
                    continue
                any_b = False
                for b in range(edges):
                    if (domains[j, b >> 6] >> np.uint64(b & 63)) & _ONE == np.uint64(0):
                        continue
                    if constraints & DISTANCE and (
                        length < distance_min[a, b] - reach or length > distance_max[a, b] + reach
                    ):
                        continue
                    if constraints & ANGLE and abs(wrap(angle[a, b] - gamma)) > both:
                        continue
                    if constraints & COMPONENT and (
                        component_min[a, b] > high_i
                        or component_max[a, b] < low_i
                        or component_min[b, a] > high_j
                        or component_max[b, a] < low_j
                    ):
                        continue
                    if constraints & TILT and (
                        _apart(tilt_min[a, b], tilt_max[a, b], omega_i, bend_i)
                        or _apart(tilt_min[b, a], tilt_max[b, a], omega_j, bend_j)
                    ):
                        continue
                    row[b >> 6] |= _ONE << np.uint64(b & 63)
                    any_b = True
                if any_b:
                    for w in range(words):
                        supported[w] |= row[w]
            for w in range(words):
                domains[j, w] &= supported[w]
