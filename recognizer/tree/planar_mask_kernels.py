"""Compiled bit masks of compatible pairs of edges of an outline.

They are laid out as `tree_kernels.grow` reads them, so that the tree is the same in the plane and
in space. As there, every constant beside a bit set is an explicit ``np.uint64``.
"""

from __future__ import annotations

import numpy as np

from ..compiling import kernel
from ..models.planar_kernels import turn_between, wrap
from .tree_kernels import ANGLE, COMPONENT, DISTANCE, TILT

ANGLE_ROUNDING = 1e-9
"""Angles between measured normals are widened by this, radians: rounding."""

_ONE = np.uint64(1)


@kernel
def _apart(low, high, middle, half):
    """Whether the arcs [low, high] and middle -+ half, radians, have nothing in common."""
    return abs(wrap(0.5 * (low + high) - middle)) > 0.5 * (high - low) + half


@kernel
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
