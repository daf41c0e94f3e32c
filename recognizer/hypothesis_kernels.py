"""Compiled grouping of poses."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def group_poses(rotations, centres, symmetries, most_turn, most_shift):
    """Put each pose into the first group whose leader it is close to, or open a new one.

    Poses are close if their centroids are, and if some symmetry of the object brings their
    rotations together.

    Args:
        rotations: (m, 3, 3) object to world, best pose first.
        centres: (m, 3) the object's centroid in the world, metres.
        symmetries: (g, 3, 3) the object's rotations onto itself.
        most_turn: largest angle within a group, radians.
        most_shift: largest shift within a group, metres.

    Returns:
        (m,) group of each pose, numbered by first appearance.
    """
    count = len(rotations)
    groups = np.empty(count, np.int64)
    leaders = np.empty(count, np.int64)
    found = 0
    # A rotation by s has trace 1 + 2 cos s.
    least_trace = 1.0 + 2.0 * np.cos(most_turn)
    for m in range(count):
        groups[m] = -1
        for g in range(found):
            k = leaders[g]
            shift = 0.0
            for i in range(3):
                shift += (centres[m, i] - centres[k, i]) ** 2
            if shift > most_shift * most_shift:
                continue
            between = rotations[k].T @ rotations[m]
            for s in range(len(symmetries)):
                trace = 0.0
                for i in range(3):
                    for j in range(3):
                        trace += between[i, j] * symmetries[s, i, j]
                if trace >= least_trace:
                    groups[m] = g
                    break
            if groups[m] >= 0:
                break
        if groups[m] < 0:
            groups[m] = found
            leaders[found] = m
            found += 1
    return groups
