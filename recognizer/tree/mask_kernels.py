"""Compiled pair masks: which features one contact can be on if another is on a given one.

Sets of features are rows of 64-bit words. Every constant is an explicit ``np.uint64``: mixed with a
Python integer a uint64 would become signed and lose its highest bit.
"""

from __future__ import annotations

import numpy as np

from ..compiling import borrowing
from .tree_kernels import ANGLE, COMPONENT, DISTANCE, TILT

COLUMNS = 11
"""Rows of `pack_tables` a feature."""

MANY = 6
"""Features of a word above which all 64 are checked at once."""

_ONE = np.uint64(1)
_NONE = np.uint64(0)
_DE_BRUIJN = np.uint64(0x03F79D71B4CB0A89)
"""All six-bit patterns occur in it once, so that shifting it by a place names the place."""
_PLACES = np.array(
    [(0x03F79D71B4CB0A89 << place & (1 << 64) - 1) >> 58 for place in range(64)]
).argsort()


@borrowing
def _angle_between(u, v):
    # Unlike the arc cosine of a dot product this is accurate at 0 and at pi.
    apart = (u[0] - v[0]) ** 2 + (u[1] - v[1]) ** 2 + (u[2] - v[2]) ** 2
    together = (u[0] + v[0]) ** 2 + (u[1] + v[1]) ** 2 + (u[2] + v[2]) ** 2
    return 2.0 * np.arctan2(np.sqrt(apart), np.sqrt(together))


@borrowing
def _component_range(length, omega, error, reach):
    # The true normal lies in a cone around the measured one, so its component of the vector runs
    # from cos(omega + alpha) to cos(omega - alpha), clamped to [0, pi].
    least = length * np.cos(min(np.pi, omega + error)) - reach
    return least, length * np.cos(max(0.0, omega - error)) + reach


@borrowing
def pair_readings(contacts, errors, readings):
    """What two contacts show of each other, for i < j.

    Args:
        contacts: see `pose.kernel_contacts`.
        errors: (n,) bounds on normals, radians.
        readings: (n, n, 9) written in place: distance, angle between the normals, angles of the
            vector between the contacts against either normal, and the bound on the distance; least
            and greatest component of the vector along the first's true normal, and the second's.
    """
    points, normals, reaches = contacts[0], contacts[1], contacts[2]
    for j in range(len(points)):
        for i in range(j):
            row = readings[i, j]
            first = (normals[i, 0], normals[i, 1], normals[i, 2])
            second = (normals[j, 0], normals[j, 1], normals[j, 2])
            d0 = points[j, 0] - points[i, 0]
            d1 = points[j, 1] - points[i, 1]
            d2 = points[j, 2] - points[i, 2]
            length = np.sqrt(d0 * d0 + d1 * d1 + d2 * d2)
            row[0] = length
            row[1] = _angle_between(first, second)
            row[2] = np.pi / 2
            row[3] = np.pi / 2
            if length > 0.0:
                d0, d1, d2 = d0 / length, d1 / length, d2 / length
                row[2] = _angle_between(first, (d0, d1, d2))
                row[3] = _angle_between(second, (-d0, -d1, -d2))
            # Each end of the vector is off by its own bound at most (memo's 2-delta).
            row[4] = reaches[i] + reaches[j]
            for side in range(2):
                error = errors[i] if side == 0 else errors[j]
                low, high = _component_range(length, row[2 + side], error, row[4])
                row[5 + 2 * side], row[6 + 2 * side] = low, high


@borrowing
def narrow(a, packed, half_angle, reading, error_i, error_j, switches, domain, kept):
    """Which features of a set contact j can be on if contact i is on ``a``.

    Checked anew on every branch: after a level or two the sets are so small that looking up rows
    made for all features would cost more.

    Args:
        a: the feature of contact i.
        packed: (f, `COLUMNS`, f) see `ranges.pack_tables`.
        half_angle: how far a's normals lean from its middle one, radians.
        reading: (9,) see `pair_readings`.
        error_i: bound on contact i's normal, radians.
        error_j: bound on contact j's.
        switches: bits, which constraints to apply.
        domain: (w,) bit set.
        kept: (w,) bit set, written in place.

    Returns:
        How many features are kept.
    """
    length, gamma, reach = reading[0], reading[1], reading[4]
    inf = np.inf
    least_d, most_d, least_g, most_g = -inf, inf, -inf, inf
    least_i, most_i, least_j, most_j = -inf, inf, -inf, inf
    if switches & DISTANCE:
        least_d, most_d = length - reach, length + reach
    if switches & ANGLE:
        both = error_i + error_j + 1e-9
        least_g, most_g = gamma - both, gamma + both
    if switches & COMPONENT:
        least_i, most_i, least_j, most_j = reading[5], reading[6], reading[7], reading[8]
        if half_angle > 0.0:
            least_i, most_i = _component_range(length, reading[2], error_i + half_angle, reach)
    # The true vector may point anywhere within asin(reach / length) of the measured one.
    bend_i, bend_j = 0.0, 0.0
    if switches & TILT:
        swing = np.arcsin(reach / length) if length > reach else np.pi
        bend_i, bend_j = error_i + half_angle + swing, error_j + swing
    count = 0
    features = packed.shape[2]
    for w in range(len(domain)):
        bits = domain[w]
        if count_bits(bits) > MANY:
            # Free of branches, so that it becomes vector instructions.
            found = _NONE
            for place in range(min(64, features - 64 * w)):
                b = 64 * w + place
                fits = (packed[a, 2, b] <= most_g) & (packed[a, 3, b] >= least_g)
                fits &= (packed[a, 4, b] <= most_i) & (packed[a, 5, b] >= least_i)
                fits &= (packed[a, 6, b] <= most_j) & (packed[a, 7, b] >= least_j)
                fits &= (packed[a, 0, b] <= most_d) & (packed[a, 1, b] >= least_d)
                found |= np.uint64(fits) << np.uint64(place)
            bits &= found
            if not switches & TILT:
                kept[w] = bits
                count += count_bits(bits)
                continue
        kept[w] = bits
        while bits != _NONE:
            lowest = bits & (~bits + _ONE)
            bits ^= lowest
            b = 64 * w + bit_index(lowest)
            # The angle first: it rules out most.
            if (
                packed[a, 2, b] > most_g
                or packed[a, 3, b] < least_g
                or packed[a, 4, b] > most_i
                or packed[a, 5, b] < least_i
                or packed[a, 6, b] > most_j
                or packed[a, 7, b] < least_j
                or packed[a, 0, b] > most_d
                or packed[a, 1, b] < least_d
            ) or (
                switches & TILT
                and (
                    packed[a, 8, b] > reading[2] + bend_i
                    or packed[a, 9, b] < reading[2] - bend_i
                    or packed[b, 8, a] > reading[3] + bend_j + packed[a, 10, b]
                    or packed[b, 9, a] < reading[3] - bend_j - packed[a, 10, b]
                )
            ):
                kept[w] ^= lowest
            else:
                count += 1
    return count


@borrowing
def count_bits(word):
    """How many bits of a word are set."""
    word -= (word >> np.uint64(1)) & np.uint64(0x5555555555555555)
    pairs = word & np.uint64(0x3333333333333333)
    word = pairs + ((word >> np.uint64(2)) & np.uint64(0x3333333333333333))
    word = (word + (word >> np.uint64(4))) & np.uint64(0x0F0F0F0F0F0F0F0F)
    return int((word * np.uint64(0x0101010101010101)) >> np.uint64(56))


@borrowing
def bit_index(single):
    """The place of the only bit set in a word."""
    return int(_PLACES[(single * _DE_BRUIJN) >> np.uint64(58)])


@borrowing
def take_lowest(members):
    """Take the lowest feature out of a (w,) bit set; -1 if it is empty."""
    for w in range(len(members)):
        bits = members[w]
        if bits != _NONE:
            lowest = bits & (~bits + _ONE)
            members[w] = bits ^ lowest
            return w * 64 + bit_index(lowest)
    return -1
