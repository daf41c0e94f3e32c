"""Compiled interpretation tree: bit masks of compatible face pairs and the search over them.

Sets of faces are rows of 64-bit words. Every constant is an explicit ``np.uint64``: mixed with a
Python integer a uint64 would become signed and lose its highest bit.
"""

from __future__ import annotations

import numpy as np

from ..compiling import kernel

DISTANCE, ANGLE, COMPONENT, TILT = 1, 2, 4, 8
"""Bits that switch the four constraints on."""

_ONE = np.uint64(1)


@kernel
def _angle_between(u, v):
    # Unlike the arc cosine of a dot product this is accurate at 0 and at pi.
    apart = 0.0
    together = 0.0
    for k in range(3):
        apart += (u[k] - v[k]) ** 2
        together += (u[k] + v[k]) ** 2
    return 2.0 * np.arctan2(np.sqrt(apart), np.sqrt(together))


@kernel
def farthest_first(rows):
    """An order of (n, k) rows: the two farthest apart, then always the farthest from all before."""
    count = len(rows)
    order = np.arange(count)
    apart = np.zeros((count, count))
    best = 0.0
    first, second = -1, -1
    for i in range(count):
        for j in range(i + 1, count):
            squared = 0.0
            for k in range(rows.shape[1]):
                squared += (rows[i, k] - rows[j, k]) ** 2
            apart[i, j] = squared
            apart[j, i] = squared
            if squared > best:
                best, first, second = squared, i, j
    if first < 0:
        return order
    gap = np.minimum(apart[first], apart[second])
    gap[first] = -1.0
    gap[second] = -1.0
    order[0], order[1] = first, second
    for at in range(2, count):
        farthest = 0
        for i in range(1, count):
            if gap[i] > gap[farthest]:
                farthest = i
        order[at] = farthest
        gap = np.minimum(gap, apart[farthest])
        gap[farthest] = -1.0
        for i in range(at):
            gap[order[i]] = -1.0
    return order


@kernel
def spread_first(positions, normals):
    """`farthest_first` by positions, as shares of their largest extent, and by half the normals."""
    count, dimension = positions.shape
    rows = np.empty((count, 2 * dimension))
    reach = 0.0
    for k in range(dimension):
        least, most = np.inf, -np.inf
        for i in range(count):
            least, most = min(least, positions[i, k]), max(most, positions[i, k])
        reach = max(reach, most - least)
    for i in range(count):
        for k in range(dimension):
            rows[i, k] = positions[i, k] / reach if reach > 0.0 else positions[i, k]
            rows[i, dimension + k] = normals[i, k] / 2.0
    return farthest_first(rows)


@kernel
def least_span(points, errors):
    """The least that the farthest two of (n, 3) points can be apart, (n,) bounds on each."""
    most = 0.0
    for i in range(len(points)):
        for j in range(i):
            squared = 0.0
            for k in range(points.shape[1]):
                squared += (points[i, k] - points[j, k]) ** 2
            most = max(most, np.sqrt(squared) - errors[i] - errors[j])
    return most


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
    """Which faces contact j can be on if contact i is on face a, for i < j, j >= from_contact.

    Args:
        positions: (n, 3) world, metres.
        normals: (n, 3) world, unit.
        position_error: (n,) metres.
        normal_error: (n,) radians.
        distance_min ... tilt_max: (f, f) the model's range tables.
        domains: (n, w) bit sets, the faces each contact may be on; narrowed in place for
            contacts from ``from_contact`` on, to faces that some partner supports.
        from_contact: pairs of contacts below it are left alone.
        constraints: bits, which constraints to apply.
        masks: (n, n, f, w) bit sets, written in place.
    """
    count = len(positions)
    faces = len(angle)
    words = domains.shape[1]
    supported = np.empty(words, np.uint64)
    for j in range(from_contact, count):
        for i in range(j):
            d = positions[j] - positions[i]
            length = np.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
            # Each end of the vector is off by its own bound at most (memo's 2-delta).
            reach = position_error[i] + position_error[j]
            both = normal_error[i] + normal_error[j]
            gamma = _angle_between(normals[i], normals[j])
            if length > 0.0:
                omega_i = _angle_between(normals[i], d / length)
                omega_j = _angle_between(normals[j], -d / length)
            else:
                omega_i = np.pi / 2
                omega_j = np.pi / 2
            # The true normal lies in a cone around the measured one, so its component of d runs
            # from cos(omega + alpha) to cos(omega - alpha), clamped to [0, pi].
            low_i = length * np.cos(min(np.pi, omega_i + normal_error[i])) - reach
            high_i = length * np.cos(max(0.0, omega_i - normal_error[i])) + reach
            low_j = length * np.cos(min(np.pi, omega_j + normal_error[j])) - reach
            high_j = length * np.cos(max(0.0, omega_j - normal_error[j])) + reach
            # The true vector may point anywhere within asin(reach / length) of the measured one.
            swing = np.arcsin(reach / length) if length > reach else np.pi
            bend_i = normal_error[i] + swing
            bend_j = normal_error[j] + swing
            supported[:] = np.uint64(0)
            for a in range(faces):
                row = masks[i, j, a]
                row[:] = np.uint64(0)
                if (domains[i, a >> 6] >> np.uint64(a & 63)) & _ONE == np.uint64(0):
                    continue
                any_b = False
                for b in range(faces):
                    if (domains[j, b >> 6] >> np.uint64(b & 63)) & _ONE == np.uint64(0):
                        continue
                    if constraints & 2 and abs(angle[a, b] - gamma) > both + 1e-9:
                        continue
                    if constraints & 4 and (
                        component_min[a, b] > high_i
                        or component_max[a, b] < low_i
                        or component_min[b, a] > high_j
                        or component_max[b, a] < low_j
                    ):
                        continue
                    if constraints & 1 and (
                        length < distance_min[a, b] - reach or length > distance_max[a, b] + reach
                    ):
                        continue
                    if constraints & 8 and (
                        tilt_min[a, b] > omega_i + bend_i
                        or tilt_max[a, b] < omega_i - bend_i
                        or tilt_min[b, a] > omega_j + bend_j
                        or tilt_max[b, a] < omega_j - bend_j
                    ):
                        continue
                    row[b >> 6] |= _ONE << np.uint64(b & 63)
                    any_b = True
                if any_b:
                    for w in range(words):
                        supported[w] |= row[w]
            for w in range(words):
                domains[j, w] &= supported[w]


@kernel
def grow(prefixes, domains, masks, stop, budget, nodes):
    """Extend interpretations of the first contacts to the first ``stop`` contacts.

    Depth-first, with forward checking: each assignment narrows the faces left to all later
    contacts below ``stop``, and a contact with none left ends the branch.

    Args:
        prefixes: (m, k) a face for each of the first k contacts.
        domains: (n, w) bit sets, the faces each contact may be on.
        masks: (n, n, f, w) pair masks.
        stop: the number of contacts to reach, k < stop <= n.
        budget: the most interpretations to return.
        nodes: (n,) counts of interpretations alive at each level, added to in place.

    Returns:
        (m', stop) interpretations, and whether that is all of them.
    """
    start = prefixes.shape[1]
    words = domains.shape[1]
    leaves = np.empty((64, stop), np.int32)
    found = 0
    left = np.empty((stop + 1, stop, words), np.uint64)
    untried = np.empty((stop, words), np.uint64)
    chosen = np.empty(stop, np.int64)
    for m in range(len(prefixes)):
        alive = True
        for j in range(start, stop):
            for w in range(words):
                bits = domains[j, w]
                for i in range(start):
                    bits &= masks[i, j, prefixes[m, i], w]
                left[start, j, w] = bits
        for j in range(start, stop):
            some = np.uint64(0)
            for w in range(words):
                some |= left[start, j, w]
            if some == np.uint64(0):
                alive = False
                break
        if not alive:
            continue
        level = start
        untried[level] = left[level, level]
        while level >= start:
            word = 0
            while word < words and untried[level, word] == np.uint64(0):
                word += 1
            if word == words:
                level -= 1
                continue
            bits = untried[level, word]
            lowest = bits & (~bits + _ONE)
            untried[level, word] = bits ^ lowest
            face = word * 64 + _bit_index(lowest)
            chosen[level] = face
            alive = True
            for j in range(level + 1, stop):
                some = np.uint64(0)
                for w in range(words):
                    bits = left[level, j, w] & masks[level, j, face, w]
                    left[level + 1, j, w] = bits
                    some |= bits
                if some == np.uint64(0):
                    alive = False
                    break
            nodes[level] += 1
            if not alive:
                continue
            if level + 1 < stop:
                level += 1
                untried[level] = left[level, level]
                continue
            if found == budget:
                return leaves[:found].copy(), False
            if found == len(leaves):
                larger = np.empty((2 * found, stop), np.int32)
                larger[:found] = leaves
                leaves = larger
            for i in range(start):
                leaves[found, i] = prefixes[m, i]
            for i in range(start, stop):
                leaves[found, i] = chosen[i]
            found += 1
    return leaves[:found].copy(), True


@kernel
def _bit_index(single):
    index = 0
    for step in (32, 16, 8, 4, 2, 1):
        if single >> np.uint64(step) != np.uint64(0):
            single >>= np.uint64(step)
            index += step
    return index
