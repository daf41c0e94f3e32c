"""Compiled ranges over three faces: the angles and the area of a triangle of points on them.

The triangle of three points, one on each face, has legs u and w at one of them, its apex, and there
the angle atan2(s, y) with s = |u x w| and y = u . w. That angle is at least t if
s cos t - y sin t >= 0, and at most t if y sin t - s cos t >= 0. A function of three points that is
concave in each of them is least at corners of the faces' convex hulls, so it is enough to look at
corners, where these two are concave or something below them is:

- s is convex in each point, and s >= n . (u x w), which is affine in each, for any unit n;
- y is affine in the ends of the legs and convex in the apex p, and y >= y - |p - c|^2, which is
  affine in it, for any c.

Of each pair take what is concave for the sign that the term has; then the least t that all corners
allow, or the greatest, is a bound. That is exact for acute ranges' upper and obtuse ranges' lower
end, but for c. The same n bounds the area s / 2 from below; from above the corners are exact.
"""

from __future__ import annotations

import numpy as np

from ..compiling import inlined, kernel

CORNER_TERMS = 11
"""Columns of the scratch array of `_corner_terms`."""
TURNS = 4
"""Directions n tried; the first is that of the mean of u x w, which is nearly always good."""
CONE_TURNS = 32
"""Steps towards the narrowest cone; any axis is sound."""
ROUNDING = 1e-7
"""Angles are widened by this (radians): an arc cosine of a rounded number is off by up to 2e-8."""
DUST = 1e-15
"""Terms below this share of the squared diameter are rounding and count as zero."""


@inlined
def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def _angle_between(u, v):
    apart = 0.0
    together = 0.0
    for k in range(3):
        apart += (u[k] - v[k]) ** 2
        together += (u[k] + v[k]) ** 2
    return 2.0 * np.arctan2(np.sqrt(apart), np.sqrt(together))


@kernel
def direction_cones(corners, start, shortest):
    """A cone that holds all directions from a point of face a to one of face b (Appendix II).

    Vectors between points of two convex hulls are in the hull of those between their corners.

    Args:
        corners: (c, 3) corners of the faces' hulls, metres.
        start: (f + 1,) the first corner of each face.
        shortest: vectors not longer than this have no direction, metres.

    Returns:
        (f, f, 3) unit axes, and (f, f) half-angles, radians: at most pi / 2, or pi for any
        direction.
    """
    faces = len(start) - 1
    axes = np.zeros((faces, faces, 3))
    half_angles = np.full((faces, faces), np.pi)
    widest = 0
    for a in range(faces):
        widest = max(widest, start[a + 1] - start[a])
    units = np.empty((widest**2, 3))
    axis = np.empty(3)
    for a in range(faces):
        for b in range(faces):
            axes[a, b, 2] = 1.0
            count = 0
            axis[:] = 0.0
            for p in range(start[a], start[a + 1]):
                for q in range(start[b], start[b + 1]):
                    d = corners[q] - corners[p]
                    length = np.sqrt(_dot(d, d))
                    if length > shortest:
                        units[count] = d / length
                        axis += units[count]
                        count += 1
            best = 0.0
            for turn in range(CONE_TURNS):
                length = np.sqrt(_dot(axis, axis))
                if count == 0 or length < 1e-9:
                    break
                axis /= length
                worst = 0
                for k in range(1, count):
                    if _dot(units[k], axis) < _dot(units[worst], axis):
                        worst = k
                cosine = _dot(units[worst], axis)
                # A cone that holds all corners holds all between them only up to a half-space,
                # where rounding decides; it is as if the faces were off by less than `SLACK`.
                if cosine > best or (best == 0.0 and cosine > -1e-12):
                    best = max(best, cosine)
                    axes[a, b] = axis
                    half_angles[a, b] = np.arccos(min(best, 1.0)) + ROUNDING
                axis += (units[worst] - axis) / (turn + 2.0)
    return axes, half_angles


@kernel
def annulus_range(axes, inner, outer, apex, left, right):
    """Range of the angle at a point of ``apex``, from what is known of either leg by itself.

    The memo's combination of two cones of directions, for annuli: a direction within ``inner`` to
    ``outer`` of an axis. Around a face's own normal they are narrow where no cone is.

    Args:
        axes: (f, f, k, 3) unit axes of annuli that hold all directions from a to b.
        inner: (f, f, k) least angle of such a direction with the axis, radians.
        outer: (f, f, k) greatest such angle.
        apex: the face of the apex.
        left: the face of one leg's end.
        right: the face of the other's.

    Returns:
        Least and greatest angle, radians.
    """
    least, most = 0.0, np.pi
    count = axes.shape[2]
    for k in range(count):
        for m in range(count):
            psi = _angle_between(axes[apex, left, k], axes[apex, right, m])
            for turned in range(2):
                one, i, other, j = (left, k, right, m) if turned == 0 else (right, m, left, k)
                a, b = inner[apex, one, i], outer[apex, one, i]
                c, d = inner[apex, other, j], outer[apex, other, j]
                # The other leg's angle with this leg's axis, then the two legs'.
                low = max(0.0, c - psi, psi - d)
                high = min(np.pi, psi + d, 2.0 * np.pi - psi - c)
                least = max(least, a - high, low - b)
                most = min(most, b + high, 2.0 * np.pi - a - low)
    return least, most


@kernel
def _corner_terms(corners, start, lifts, faces, terms):
    """u x w, its length, y at each apex, and y - |p - c|^2 at each, for all triples of corners."""
    a, b, c = faces
    count = 0
    for p in range(start[a], start[a + 1]):
        for q in range(start[b], start[b + 1]):
            u = corners[q] - corners[p]
            for r in range(start[c], start[c + 1]):
                w = corners[r] - corners[p]
                row = terms[count]
                row[0] = u[1] * w[2] - u[2] * w[1]
                row[1] = u[2] * w[0] - u[0] * w[2]
                row[2] = u[0] * w[1] - u[1] * w[0]
                row[3] = np.sqrt(_dot(row, row))
                row[4] = _dot(u, w)
                row[5] = _dot(u, u) - row[4]
                row[6] = _dot(w, w) - row[4]
                row[7] = row[4] - lifts[p]
                row[8] = row[5] - lifts[q]
                row[9] = row[6] - lifts[r]
                count += 1
    return count


@kernel
def _obtuse_least(terms, count, apex, dust):
    """The least angle if no corner's is acute, else 0."""
    least = np.pi
    seen = False
    for k in range(count):
        s, y = terms[k, 3], terms[k, 4 + apex]
        if y > dust:
            return 0.0
        if s > dust or y < -dust:
            least = min(least, np.arctan2(s, min(y, 0.0)))
            seen = True
    return least if seen else 0.0


@kernel
def _acute_most(terms, count, apex, dust):
    """The greatest angle if no corner's is obtuse, after the apex's deduction, else pi."""
    most = 0.0
    seen = False
    for k in range(count):
        s, y = terms[k, 3], terms[k, 7 + apex]
        if y < -dust:
            return np.pi
        if s > dust or y > dust:
            most = max(most, np.arctan2(s, max(y, 0.0)))
            seen = True
    return most if seen else np.pi


@kernel
def _acute_least(terms, count, apex, dust):
    """A bound up to pi / 2 below all angles, from x = n . (u x w) in the last column."""
    upper, lower = np.pi / 2, 0.0
    for k in range(count):
        x, y = terms[k, 10], terms[k, 4 + apex]
        if y > dust:
            if x <= 0.0:
                return 0.0
            upper = min(upper, np.arctan2(x, y))
        elif x < -dust:
            lower = max(lower, np.arctan2(-x, max(-y, 0.0)))
    return upper if upper >= lower else 0.0


@kernel
def _obtuse_most(terms, count, apex, dust):
    """A bound from pi / 2 on above all angles, from x = n . (u x w) in the last column."""
    lower, upper = np.pi / 2, np.pi
    for k in range(count):
        x, y = terms[k, 10], terms[k, 7 + apex]
        if y < -dust:
            if x <= 0.0:
                return np.pi
            lower = max(lower, np.arctan2(x, y))
        elif x < -dust:
            upper = min(upper, np.pi - np.arctan2(-x, max(y, 0.0)))
    return lower if lower <= upper else np.pi


@kernel
def corner_ranges(corners, start, lifts, faces, dust, terms, out):
    """Ranges of a triangle's angles and area from the corners of the hulls of its faces.

    Args:
        corners: (c, 3) corners of the faces' hulls, metres.
        start: (f + 1,) the first corner of each face.
        lifts: (c,) |p - c|^2 of each corner, c the middle of its face, square metres.
        faces: three faces.
        dust: terms below it count as zero, square metres.
        terms: scratch, `CORNER_TERMS` columns and a row for each triple of corners.
        out: (4, 2) least and greatest angle at a point of each face, radians, and area, square
            metres; written in place.
    """
    count = _corner_terms(corners, start, lifts, faces, terms)
    n = np.zeros(3)
    out[3] = 0.0
    for k in range(count):
        out[3, 1] = max(out[3, 1], 0.5 * terms[k, 3])
        for axis in range(3):
            n[axis] += terms[k, axis] / count
    for apex in range(3):
        out[apex, 0] = _obtuse_least(terms, count, apex, dust)
        out[apex, 1] = _acute_most(terms, count, apex, dust)
    for _turn in range(TURNS):
        length = np.sqrt(_dot(n, n))
        if length <= dust:
            break
        worst = 0
        for k in range(count):
            terms[k, 10] = _dot(terms[k], n) / length
            if terms[k, 10] < terms[worst, 10]:
                worst = k
        out[3, 0] = max(out[3, 0], 0.5 * (terms[worst, 10] - 10.0 * dust))
        for apex in range(3):
            out[apex, 0] = max(out[apex, 0], _acute_least(terms, count, apex, dust))
            out[apex, 1] = min(out[apex, 1], _obtuse_most(terms, count, apex, dust))
        # Towards the point nearest to the origin of the hull of all u x w (Gilbert).
        step = terms[worst, :3] - n
        squared = _dot(step, step)
        share = min(1.0, -_dot(n, step) / squared) if squared > 0.0 else 0.0
        if share <= 0.0:
            break
        n += share * step


@kernel
def triple_range(corners, start, lifts, axes, inner, outer, faces, dust, terms, out):
    """Ranges of a triangle's angles and area; arguments as of `corner_ranges`, `annulus_range`."""
    corner_ranges(corners, start, lifts, faces, dust, terms, out)
    for apex in range(3):
        left, right = faces[(apex + 1) % 3], faces[(apex + 2) % 3]
        least, most = annulus_range(axes, inner, outer, faces[apex], left, right)
        out[apex, 0] = max(out[apex, 0], least)
        out[apex, 1] = min(out[apex, 1], most)
    # The three angles of any triangle add up to pi.
    for side in range(2):
        for apex in range(3):
            rest = np.pi - out[(apex + 1) % 3, 1 - side] - out[(apex + 2) % 3, 1 - side]
            out[apex, side] = max(out[apex, 0], rest) if side == 0 else min(out[apex, 1], rest)
    for apex in range(3):
        out[apex, 0] -= ROUNDING
        out[apex, 1] += ROUNDING
