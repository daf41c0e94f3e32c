"""Compiled geometry behind the range tables: distances and tilts between triangles."""

from __future__ import annotations

import numpy as np

from ..compiling import inlined, kernel

_SEGMENT_EPS = 1e-300


@inlined
def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def segment_distance_squared(p, q, r, s):
    """Squared distance of the segments p-q and r-s, (3,) each (Ericson, Section 5.1.9)."""
    d1 = q - p
    d2 = s - r
    w = p - r
    a = _dot(d1, d1)
    e = _dot(d2, d2)
    f = _dot(d2, w)
    c = _dot(d1, w)
    b = _dot(d1, d2)
    denominator = a * e - b * b
    # Parallel segments: any point of the first will do, the clamps below find its partner.
    u = 0.0
    if denominator > 1e-14 * a * e:
        u = min(max((b * f - c * e) / denominator, 0.0), 1.0)
    v = (b * u + f) / max(e, _SEGMENT_EPS)
    if v < 0.0:
        v = 0.0
        u = min(max(-c / max(a, _SEGMENT_EPS), 0.0), 1.0)
    elif v > 1.0:
        v = 1.0
        u = min(max((b - c) / max(a, _SEGMENT_EPS), 0.0), 1.0)
    gap = w + u * d1 - v * d2
    return _dot(gap, gap)


@kernel
def point_triangle_distance_squared(p, a, b, c):
    """Squared distance of a point from a solid triangle, (3,) each (Ericson, Section 5.1.5).

    Infinity for a triangle without area: its edges say all there is to say.
    """
    ab = b - a
    ac = c - a
    aa, bb, mixed = _dot(ab, ab), _dot(ac, ac), _dot(ab, ac)
    if aa * bb - mixed * mixed <= 1e-18 * aa * bb:
        return np.inf
    ap = p - a
    d1 = _dot(ab, ap)
    d2 = _dot(ac, ap)
    if d1 <= 0.0 and d2 <= 0.0:
        return _dot(ap, ap)
    bp = p - b
    d3 = _dot(ab, bp)
    d4 = _dot(ac, bp)
    if d3 >= 0.0 and d4 <= d3:
        return _dot(bp, bp)
    vc = d1 * d4 - d3 * d2
    if vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        gap = ap - (d1 / (d1 - d3)) * ab
        return _dot(gap, gap)
    cp = p - c
    d5 = _dot(ab, cp)
    d6 = _dot(ac, cp)
    if d6 >= 0.0 and d5 <= d6:
        return _dot(cp, cp)
    vb = d5 * d2 - d1 * d6
    if vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        gap = ap - (d2 / (d2 - d6)) * ac
        return _dot(gap, gap)
    va = d3 * d6 - d5 * d4
    if va <= 0.0 and d4 - d3 >= 0.0 and d5 - d6 >= 0.0:
        gap = bp - ((d4 - d3) / ((d4 - d3) + (d5 - d6))) * (c - b)
        return _dot(gap, gap)
    scale = 1.0 / (va + vb + vc)
    gap = ap - (vb * scale) * ab - (vc * scale) * ac
    return _dot(gap, gap)


@kernel
def triangle_distance_squared(s, t):
    """Squared distance of two solid triangles, (3, 3) each, that don't pierce each other."""
    best = np.inf
    for i in range(3):
        best = min(best, point_triangle_distance_squared(s[i], t[0], t[1], t[2]))
        best = min(best, point_triangle_distance_squared(t[i], s[0], s[1], s[2]))
        for j in range(3):
            gap = segment_distance_squared(s[i], s[(i + 1) % 3], t[j], t[(j + 1) % 3])
            best = min(best, gap)
    return best


@kernel
def nearest_distances(triangles, first):
    """Smallest distance between every two faces.

    Args:
        triangles: (t, 3, 3) corners, sorted by face.
        first: (f + 1,) the first triangle of each face.

    Returns:
        (f, f) distances, zero on the diagonal.
    """
    faces = len(first) - 1
    count = len(triangles)
    middles = np.empty((count, 3))
    radii = np.empty(count)
    for k in range(count):
        middles[k] = (triangles[k, 0] + triangles[k, 1] + triangles[k, 2]) / 3.0
        reach = 0.0
        for i in range(3):
            arm = triangles[k, i] - middles[k]
            reach = max(reach, _dot(arm, arm))
        radii[k] = np.sqrt(reach)
    nearest = np.zeros((faces, faces))
    for a in range(faces):
        for b in range(a + 1, faces):
            best = np.inf
            for s in range(first[a], first[a + 1]):
                for t in range(first[b], first[b + 1]):
                    between = middles[s] - middles[t]
                    # The spheres around two triangles are never nearer than the triangles.
                    gap = np.sqrt(_dot(between, between)) - radii[s] - radii[t]
                    if gap > 0.0 and gap * gap >= best:
                        continue
                    best = min(best, triangle_distance_squared(triangles[s], triangles[t]))
            nearest[a, b] = np.sqrt(best)
            nearest[b, a] = nearest[a, b]
    return nearest


@kernel
def tilt_ranges(triangles, first, normals, offsets):
    """Range of the angle between face a's normal and the direction from a point of a to one of b.

    Each pair of triangles is boxed in height above a's plane and distance along it; the box's
    extreme angles hold the true range, so the result is sound but not tight.

    Args:
        triangles: (t, 3, 3) corners, sorted by face.
        first: (f + 1,) the first triangle of each face.
        normals: (f, 3) outward unit normals.
        offsets: (f,) plane offsets.

    Returns:
        (f, f) smallest angles, (f, f) largest angles, radians; pi / 2 on the diagonal.
    """
    faces = len(first) - 1
    least = np.full((faces, faces), np.pi / 2)
    most = np.full((faces, faces), np.pi / 2)
    flat = np.empty((3, 3))
    for a in range(faces):
        for b in range(faces):
            if a == b:
                continue
            low, high = np.pi, 0.0
            for t in range(first[b], first[b + 1]):
                bottom, top = np.inf, -np.inf
                for i in range(3):
                    height = _dot(normals[a], triangles[t, i]) - offsets[a]
                    bottom = min(bottom, height)
                    top = max(top, height)
                    flat[i] = triangles[t, i] - height * normals[a]
                for s in range(first[a], first[a + 1]):
                    near = np.sqrt(triangle_distance_squared(triangles[s], flat))
                    far = 0.0
                    for i in range(3):
                        for j in range(3):
                            gap = triangles[s, i] - flat[j]
                            far = max(far, np.sqrt(_dot(gap, gap)))
                    low = min(low, np.arctan2(near if top > 0.0 else far, top))
                    # At height zero any distance makes a right angle; no distance at all, none.
                    high = max(high, np.arctan2(far if bottom >= 0.0 else near, bottom))
            least[a, b] = low
            most[a, b] = high
    return least, most
