"""Compiled pair masks: which features one contact can be on if another is on a given one.

Sets of features are rows of 64-bit words. Every constant is an explicit ``np.uint64``: mixed with a
Python integer a uint64 would become signed and lose its highest bit.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from .tree_kernels import ANGLE, COMPONENT, DISTANCE, TILT

COLUMNS = 11
"""Rows of `pack_tables` a feature."""

_ONE = np.uint64(1)
_BYTES = np.uint64(0x0101010101010101)
_GATHER = np.uint64(0x0102040810204080)
_TOP = np.uint64(56)


@njit(cache=True)
def _angle_between(u, v):
    # Unlike the arc cosine of a dot product this is accurate at 0 and at pi.
    apart = 0.0
    together = 0.0
    for k in range(3):
        apart += (u[k] - v[k]) ** 2
        together += (u[k] + v[k]) ** 2
    return 2.0 * np.arctan2(np.sqrt(apart), np.sqrt(together))


@njit(cache=True)
def pair_readings(contacts, errors, readings):
    """What two contacts show of each other, for i < j.

    Args:
        contacts: see `search_kernels.search_model`.
        errors: (n,) bounds on normals, radians.
        readings: (n, n, 5) written in place: distance, angle between the normals, angles of the
            vector between the contacts against either normal, and the bound on the distance.
    """
    points, normals, reaches = contacts[0], contacts[1], contacts[2]
    for j in range(len(points)):
        for i in range(j):
            row = readings[i, j]
            d = points[j] - points[i]
            length = np.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
            row[0] = length
            row[1] = _angle_between(normals[i], normals[j])
            row[2] = np.pi / 2
            row[3] = np.pi / 2
            if length > 0.0:
                d /= length
                row[2] = _angle_between(normals[i], d)
                row[3] = _angle_between(normals[j], -d)
            # Each end of the vector is off by its own bound at most (memo's 2-delta).
            row[4] = reaches[i] + reaches[j]


@njit(cache=True)
def compatible(a, packed, half_angle, reading, error_i, error_j, switches, fits, words, row):
    """Which features contact j can be on if contact i is on ``a``.

    Args:
        a: the feature of contact i.
        packed: (f, `COLUMNS`, f) see `ranges.pack_tables`.
        half_angle: how far a's normals lean from its middle one, radians.
        reading: (5,) see `pair_readings`.
        error_i: bound on contact i's normal, radians.
        error_j: bound on contact j's.
        switches: bits, which constraints to apply.
        fits: (64 w,) bytes, zero beyond the features; work space.
        words: (8 w,) the same bytes as 64-bit words.
        row: (w,) bit set, written in place.
    """
    length, gamma, omega_i, omega_j, reach = reading
    table = packed[a]
    count = packed.shape[2]
    near, far = table[0], table[1]
    narrow, broad = table[2], table[3]
    low_i, high_i, low_j, high_j = table[4], table[5], table[6], table[7]
    inf = np.inf
    least_d, most_d = (length - reach, length + reach) if switches & DISTANCE else (-inf, inf)
    both = error_i + error_j + 1e-9
    least_g, most_g = (gamma - both, gamma + both) if switches & ANGLE else (-inf, inf)
    least_i, most_i, least_j, most_j = -inf, inf, -inf, inf
    if switches & COMPONENT:
        # The true normal lies in a cone around the measured one, so its component of the vector
        # runs from cos(omega + alpha) to cos(omega - alpha), clamped to [0, pi].
        cone = error_i + half_angle
        least_i = length * np.cos(min(np.pi, omega_i + cone)) - reach
        most_i = length * np.cos(max(0.0, omega_i - cone)) + reach
        least_j = length * np.cos(min(np.pi, omega_j + error_j)) - reach
        most_j = length * np.cos(max(0.0, omega_j - error_j)) + reach
    for b in range(count):
        fits[b] = (
            (near[b] <= most_d)
            & (far[b] >= least_d)
            & (narrow[b] <= most_g)
            & (broad[b] >= least_g)
            & (low_i[b] <= most_i)
            & (high_i[b] >= least_i)
            & (low_j[b] <= most_j)
            & (high_j[b] >= least_j)
        )
    if switches & TILT:
        # The true vector may point anywhere within asin(reach / length) of the measured one.
        swing = np.arcsin(reach / length) if length > reach else np.pi
        bend_i, bend_j = error_i + half_angle + swing, error_j + swing
        for b in range(count):
            fits[b] &= (
                (table[8, b] <= omega_i + bend_i)
                & (table[9, b] >= omega_i - bend_i)
                & (packed[b, 8, a] <= omega_j + bend_j + table[10, b])
                & (packed[b, 9, a] >= omega_j - bend_j - table[10, b])
            )
    for w in range(len(row)):
        bits = np.uint64(0)
        for k in range(8):
            # Eight bytes of 0 or 1 become eight bits: none of the products overlap.
            byte = ((words[8 * w + k] & _BYTES) * _GATHER) >> _TOP
            bits |= byte << np.uint64(8 * k)
        row[w] = bits


@njit(cache=True)
def count_bits(bits):
    """How many bits of a word are set."""
    found = 0
    while bits != np.uint64(0):
        bits &= bits - _ONE
        found += 1
    return found


@njit(cache=True)
def bit_index(single):
    """The place of the only bit set in a word."""
    index = 0
    for step in (32, 16, 8, 4, 2, 1):
        if single >> np.uint64(step) != np.uint64(0):
            single >>= np.uint64(step)
            index += step
    return index
