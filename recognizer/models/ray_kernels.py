"""Compiled ray casting against triangles."""

from __future__ import annotations

import numpy as np

from ..compiling import borrowing


@borrowing
def first_hits(origins, directions, triangles, distances, hits):
    """The first triangle each ray meets (Moeller and Trumbore).

    Args:
        origins: (r, 3) starts.
        directions: (r, 3) unit directions.
        triangles: (t, 3, 3) corners.
        distances: (r,) distance to the hit, infinity for a miss; written in place.
        hits: (r,) triangle index, -1 for a miss; written in place.
    """
    for r in range(len(origins)):
        o, d = origins[r], directions[r]
        best, hit = np.inf, -1
        for t in range(len(triangles)):
            a0, a1, a2 = triangles[t, 0, 0], triangles[t, 0, 1], triangles[t, 0, 2]
            e0, e1, e2 = triangles[t, 1, 0] - a0, triangles[t, 1, 1] - a1, triangles[t, 1, 2] - a2
            g0, g1, g2 = triangles[t, 2, 0] - a0, triangles[t, 2, 1] - a1, triangles[t, 2, 2] - a2
            p0 = d[1] * g2 - d[2] * g1
            p1 = d[2] * g0 - d[0] * g2
            p2 = d[0] * g1 - d[1] * g0
            det = e0 * p0 + e1 * p1 + e2 * p2
            if det == 0.0:
                continue
            s0, s1, s2 = o[0] - a0, o[1] - a1, o[2] - a2
            u = (s0 * p0 + s1 * p1 + s2 * p2) / det
            # A hair of slack, so that no ray slips between two triangles.
            if u < -1e-12 or u > 1.0 + 1e-12:
                continue
            q0 = s1 * e2 - s2 * e1
            q1 = s2 * e0 - s0 * e2
            q2 = s0 * e1 - s1 * e0
            v = (d[0] * q0 + d[1] * q1 + d[2] * q2) / det
            if v < -1e-12 or u + v > 1.0 + 1e-12:
                continue
            depth = (g0 * q0 + g1 * q1 + g2 * q2) / det
            if 0.0 <= depth < best:
                best, hit = depth, t
        distances[r] = best
        hits[r] = hit
