"""Compiled bounds on where a pose can be: a region that holds every pose within the bounds.

A small motion ``z = (w, s)`` of the object, in its own frame, turns it by ``w`` about a pivot and
shifts it by ``s``: a contact ``x`` becomes ``x - w x a - s`` with the lever ``a = x - pivot``, up
to a remainder that is quadratic in ``w``. Every pose within the bounds keeps each reading's linear
part within its bound plus that remainder, so the weighted sum of their squares confines ``z`` to an
ellipsoid. A smaller ellipsoid has smaller remainders, which confine it further: a few rounds take
the half radian that the normals leave to the degree that the positions allow.
"""

from __future__ import annotations

import numpy as np

from ...compiling import borrowing, kernel
from .cone_kernels import add_cones, cone_table, note_cones, raise_cones
from .place_kernels import (
    add_places,
    narrow_places,
    note_places,
    place_table,
    raise_places,
    widen_places,
)

ROUNDS = 5
SHRINKS = 0.9
PATIENCE = 2
"""Rounds go on until so many in a row have not shrunk the region below this share of its size."""
SQUARES_ROUNDING = 1e-12
"""What a sum of squares may lose, as a share of it: thousands of times what six of them do."""
STIFF_ROUNDING = 2e-14
"""What an inverse may lose, as a share, for each unit of its condition: a hundred roundings."""


@borrowing
def invert_symmetric(matrix, inverse, factor, slope, root):
    """Invert a positive definite (6, 6) matrix by Cholesky; returns whether it is one.

    Also write ``L^-1 slope`` into (6,) ``root``, for the factor L, ``matrix = L L^T``.
    """
    # Loops to a constant: the compiler writes them out, which makes this three times as fast. The
    # diagonal is that of the factor's inverse from the start.
    for a in range(6):
        for b in range(a):
            value = matrix[a, b]
            for k in range(b):
                value -= factor[a, k] * factor[b, k]
            factor[a, b] = value * factor[b, b]
        value = matrix[a, a]
        for k in range(a):
            value -= factor[a, k] * factor[a, k]
        if not value > 0.0:
            return False
        factor[a, a] = 1.0 / np.sqrt(value)
    # By substitution: a product with the inverse would lose what a stiff matrix has of digits.
    for a in range(6):
        value = slope[a]
        for k in range(a):
            value -= factor[a, k] * root[k]
        root[a] = value * factor[a, a]
    # The factor's inverse, in place of its lower triangle.
    for a in range(6):
        for b in range(a):
            value = 0.0
            for k in range(b, a):
                value -= factor[a, k] * factor[k, b]
            factor[a, b] = value * factor[a, a]
    for a in range(6):
        for b in range(a + 1):
            value = 0.0
            for k in range(a, 6):
                value += factor[k, a] * factor[k, b]
            inverse[a, b] = value
            inverse[b, a] = value
    return True


@borrowing
def largest_eigenvalue(m):
    """Of a symmetric (3, 3) matrix, or of a larger one's first block, rounded up (Smith 1961)."""
    off = m[0, 1] * m[0, 1] + m[0, 2] * m[0, 2] + m[1, 2] * m[1, 2]
    mean = (m[0, 0] + m[1, 1] + m[2, 2]) / 3.0
    d0, d1, d2 = m[0, 0] - mean, m[1, 1] - mean, m[2, 2] - mean
    size = np.sqrt((d0 * d0 + d1 * d1 + d2 * d2 + 2.0 * off) / 6.0)
    if size <= 1e-300:
        return mean
    half = (
        d0 * (d1 * d2 - m[1, 2] * m[1, 2])
        - m[0, 1] * (m[0, 1] * d2 - m[1, 2] * m[0, 2])
        + m[0, 2] * (m[0, 1] * m[1, 2] - d1 * m[0, 2])
    ) / (2.0 * size * size * size)
    angle = np.arccos(min(1.0, max(-1.0, half))) / 3.0
    return mean + 2.0 * size * np.cos(angle) + 1e-7 * size


@borrowing
def square_root(spread, root):
    """Cholesky factor of a (3, 3) form, lower, into ``root``; null directions come out null."""
    for a in range(3):
        for b in range(a + 1):
            value = spread[a, b]
            for k in range(b):
                value -= root[a, k] * root[b, k]
            if a == b:
                root[a, a] = np.sqrt(max(value, 0.0))
            else:
                root[a, b] = value / root[b, b] if root[b, b] > 1e-150 else 0.0
            if b < a:
                root[b, a] = 0.0


@borrowing
def remainder(lever, direction, root, angle):
    """How far a turn within a region can move a lever's end along a direction beyond linear.

    A turn by w moves the end of a by ``sinc |w| (w x a) + (1 - cos |w|) / |w|^2 w x (w x a)``
    (Rodrigues). Along m the second is the form ``(w . a)(w . m) - |w|^2 (a . m)`` with a factor of
    at most a half, and the first differs from ``w x a`` by a share of at most ``|w|^2 / 6``.

    Args:
        lever: (3,) a.
        direction: (3,) m.
        root: (3, 3) lower L; the region's ``w`` are ``L v`` with ``|v| <= 1``.
        angle: bound on |w|, radians.
    """
    a0, a1, a2 = lever[0], lever[1], lever[2]
    m0, m1, m2 = direction[0], direction[1], direction[2]
    l00, l10, l11 = root[0, 0], root[1, 0], root[1, 1]
    l20, l21, l22 = root[2, 0], root[2, 1], root[2, 2]
    # L^T a, L^T m and L^T (a x m).
    p0, p1, p2 = l00 * a0 + l10 * a1 + l20 * a2, l11 * a1 + l21 * a2, l22 * a2
    q0, q1, q2 = l00 * m0 + l10 * m1 + l20 * m2, l11 * m1 + l21 * m2, l22 * m2
    c0, c1, c2 = a1 * m2 - a2 * m1, a2 * m0 - a0 * m2, a0 * m1 - a1 * m0
    t0, t1, t2 = l00 * c0 + l10 * c1 + l20 * c2, l11 * c1 + l21 * c2, l22 * c2
    along = a0 * m0 + a1 * m1 + a2 * m2
    f00 = p0 * q0 - along * (l00 * l00 + l10 * l10 + l20 * l20)
    f11 = p1 * q1 - along * (l11 * l11 + l21 * l21)
    f22 = p2 * q2 - along * l22 * l22
    f01 = 0.5 * (p0 * q1 + p1 * q0) - along * (l10 * l11 + l20 * l21)
    f02 = 0.5 * (p0 * q2 + p2 * q0) - along * l20 * l22
    f12 = 0.5 * (p1 * q2 + p2 * q1) - along * l21 * l22
    bent = np.sqrt(f00 * f00 + f11 * f11 + f22 * f22 + 2.0 * (f01 * f01 + f02 * f02 + f12 * f12))
    linear = np.sqrt(t0 * t0 + t1 * t1 + t2 * t2)
    return 0.5 * bent + angle * angle / 6.0 * linear


@borrowing
def turn_between(one, other, turn):
    """The rotation vector of ``one^T other`` into (3,) ``turn``; returns its length, radians."""
    trace = 0.0
    for k in range(3):
        a, b = (k + 1) % 3, (k + 2) % 3
        turn[k] = 0.0
        for i in range(3):
            turn[k] += 0.5 * (one[i, b] * other[i, a] - one[i, a] * other[i, b])
            trace += one[i, k] * other[i, k]
    sine = np.sqrt(turn[0] ** 2 + turn[1] ** 2 + turn[2] ** 2)
    angle = np.arctan2(sine, 0.5 * (trace - 1.0))
    if sine > 1e-9:
        for k in range(3):
            turn[k] *= angle / sine
    return angle


@borrowing
def ball_radius(angle, longest):
    """Radius, in rotation vectors of lengths up to ``longest``, that holds a ball of rotations.

    It is about the vector to the ball's centre, unless the longest is a right angle or more: then
    it is about zero. The exponential shortens lengths by a share of 2 sin(W / 2) / W at least, and
    balls of less than a right angle are convex, so that the way between two of its rotations stays
    among them.
    """
    if longest >= 0.5 * np.pi:
        return longest
    return angle * 0.5 * longest / np.sin(0.5 * longest) + 1e-9


@kernel
def region_workspace(count):
    """Work space of `bound_region` for a number of contacts, with a region in it.

    Returns:
        spread (3, 3): every pose's ``w`` has ``(w . p)^2 <= p^T spread p``; inverse (6, 6) and
        centre (6,): every pose's ``z`` has ``((z - centre) . p)^2 <= p^T inverse p``; and work
        space.
    """
    return (
        np.empty((3, 3)),
        np.empty((6, 6)),
        np.empty(6),
        (np.empty((6, 6)), np.empty((6, 6)), np.zeros((6, 6))),
        (np.empty(6), np.empty(6), np.empty(3)),
        np.empty((3, 3)),
        place_table(2 * count),
        cone_table(count),
    )


@borrowing
def bound_region(
    count,
    faces,
    targets,
    x,
    levers,
    u,
    model,
    contacts,
    readings,
    reach,
    rotation,
    ball,
    angle,
    region,
):
    """The region around a pose that holds every pose within the bounds.

    The weights of the sum are free; where a round's best fit leaves a reading large, it counts more
    in the next (Lawson), which makes the region of all bounds together as small as their
    intersection, and empty if that is.

    Args:
        count: how many contacts count.
        faces: (n,) the feature of each, -1 for none.
        targets: (n,) the polygon that stands for it.
        x: (n, 3) contacts, object frame, metres.
        levers: (n, 3) contacts less the pivot.
        u: (n, 3) measured normals, object frame.
        model: see `pose.ModelTest`.
        contacts: likewise.
        readings: see `reading_kernels.read`.
        reach: a shift of the pivot that no pose within the bounds exceeds, metres.
        rotation: (3, 3) this pose's, object to world.
        ball: (3, 3) a rotation that none within the bounds is farther from than ...
        angle: ... this angle, radians.
        region: see `region_workspace`; written in place.

    Returns:
        An angle that bounds every rotation of the region, radians, from this pose, -1 if the region
        is empty; and one from the region's centre. (Two turns ``exp(v)`` and ``exp(w)`` are at most
        ``|v - w|`` apart.)
    """
    normals = model[0]
    spread, inverse, centre, systems, slopes, root, places, cones = region
    system, trial, factor = systems
    slope, middle, offset = slopes
    used = note_places(count, faces, targets, x, levers, model, contacts[2], readings, places)
    used_cones = note_cones(count, faces, u, normals, contacts, readings, cones)
    # Known beforehand: the ball.
    off = turn_between(rotation, ball, offset)
    result = min(off + angle, np.pi)
    ball_angle = ball_radius(angle, result)
    if result >= 0.5 * np.pi:
        offset[:] = 0.0
        off = 0.0
    about = result
    size = 3.0 * result * result
    centre[:] = 0.0
    inverse[:] = 0.0
    for a in range(3):
        inverse[a, a] = 2.0 * result * result
        inverse[3 + a, 3 + a] = 2.0 * reach * reach
        for b in range(3):
            spread[a, b] = result * result if a == b else 0.0
    idle = 0
    for _ in range(ROUNDS):
        square_root(spread, root)
        # The ball, and |s| <= reach: each adds at most 1 to the sum.
        allowed = 2.0 - (off / ball_angle) ** 2
        system[:] = 0.0
        slope[3:] = 0.0
        for a in range(3):
            slope[a] = -offset[a] / (ball_angle * ball_angle)
            system[a, a] = 1.0 / (ball_angle * ball_angle)
            system[3 + a, 3 + a] = 1.0 / (reach * reach)
        widen_places(used, places, root, result)
        allowed += add_places(used, places, system, slope)
        allowed += add_cones(used_cones, cones, result, system, slope)
        if not invert_symmetric(system, trial, factor, slope, middle):
            break
        # Complete the square about the centre.
        squares, stiff, slack = 0.0, 0.0, 0.0
        for a in range(6):
            squares += middle[a] * middle[a]
            stiff += system[a, a]
            slack += trial[a, a]
        # The centre itself, by the factor's inverse from the left; from below, in place.
        for a in range(6):
            value = 0.0
            for k in range(a, 6):
                value -= factor[k, a] * middle[k]
            middle[a] = value
        # Sums lose digits to large squares, and the inverse to a stiff system: far less than this.
        allowed += (1.0 + SQUARES_ROUNDING) * squares
        if allowed < 0.0:
            return -1.0, 0.0
        allowed *= 1.0 + STIFF_ROUNDING * stiff * slack
        far = np.sqrt(middle[0] ** 2 + middle[1] ** 2 + middle[2] ** 2)
        near = np.sqrt(max(allowed * largest_eigenvalue(trial), 0.0))
        # (w . p)^2 <= (|c . p| + sqrt(p E p))^2 <= (1 + t) p E p + (1 + 1 / t) (c . p)^2.
        share = max(far, 1e-9) / max(near, 1e-12)
        trace = (1.0 + share) * allowed * (trial[0, 0] + trial[1, 1] + trial[2, 2])
        trace += (1.0 + 1.0 / share) * far * far
        idle += 1
        if trace < size:
            if trace < SHRINKS * size:
                idle = 0
            size = trace
            about = near
            for a in range(6):
                centre[a] = middle[a]
                for b in range(6):
                    inverse[a, b] = allowed * trial[a, b]
            for a in range(3):
                for b in range(3):
                    spread[a, b] = (1.0 + share) * inverse[a, b]
                    spread[a, b] += (1.0 + 1.0 / share) * centre[a] * centre[b]
        result = min(result, far + near)
        if idle == PATIENCE:
            break
        if not narrow_places(used, places, centre, inverse):
            return -1.0, 0.0
        _raise_weights(used, places, used_cones, cones, middle)
    return result, min(about, result + np.sqrt(centre[0] ** 2 + centre[1] ** 2 + centre[2] ** 2))


@borrowing
def _raise_weights(used, places, used_cones, cones, middle):
    """Count each reading by how large the fit of this round leaves it; their mean stays 1."""
    raise_places(used, places, middle)
    raise_cones(used_cones, cones, middle)
    total = 0.0
    for r in range(used):
        total += places[2][2, r]
    for r in range(used_cones):
        total += cones[2][r]
    scale = (used + used_cones) / max(total, 1e-300)
    for r in range(used):
        places[2][2, r] *= scale
    for r in range(used_cones):
        cones[2][r] *= scale
