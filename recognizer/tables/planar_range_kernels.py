"""Compiled ranges of the plane: which way one edge of an outline lies from another."""

from __future__ import annotations

import numpy as np

from ..compiling import kernel
from ..models.planar_kernels import turn_between


@kernel
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
