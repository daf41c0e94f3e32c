"""Compiled geometry of the plane: turns between directions and distances of segments."""

from __future__ import annotations

import numpy as np

from ..compiling import kernel


@kernel
def wrap(angle):
    """The same angle in [-pi, pi], radians."""
    return angle - 2.0 * np.pi * np.round(angle / (2.0 * np.pi))


@kernel
def turn_between(u, v):
    """The angle by which (2,) ``u`` turns counter-clockwise into ``v``, radians in [-pi, pi]."""
    return np.arctan2(u[0] * v[1] - u[1] * v[0], u[0] * v[0] + u[1] * v[1])


@kernel
def _point_segment_squared(p, a, b):
    e0, e1 = b[0] - a[0], b[1] - a[1]
    g0, g1 = p[0] - a[0], p[1] - a[1]
    share = (g0 * e0 + g1 * e1) / max(e0 * e0 + e1 * e1, 1e-300)
    share = min(max(share, 0.0), 1.0)
    g0 -= share * e0
    g1 -= share * e1
    return g0 * g0 + g1 * g1


@kernel
def _side(a, b, p):
    return (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])


@kernel
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
