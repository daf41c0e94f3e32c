"""Compiled test of contacts on parallel faces: how the object may lean, whatever its spin.

Contacts on faces with one normal ``m``, or its opposite, say nothing of turns about ``m``. What
they ask of its direction in the world, ``v``, are caps and bands of the unit sphere: each measured
normal has a cap of its bound about it, and two contacts are as far apart along ``v`` as their
planes are, up to both bounds. (Bands of pairs say all: intervals of a line that meet in pairs meet
all together.) A set with circles for its borders has a corner where two of them meet, or a whole
circle, so that a few points tell whether there is any direction.
"""

from __future__ import annotations

import numpy as np

from ...compiling import borrowing, kernel
from ..motions.motion_kernels import perpendicular

PARALLEL = 1e-14
"""Normals whose cosine is this near to one are taken as the same: they differ by 1.5e-7."""
LEVEL = 1e-6
"""What heights may be off for that, as a share of the object's radius."""
SLACK = 5e-6
"""By how much a point may be beyond a circle. Corners are found to a tenth of it (see `SKEW`)."""
SKEW = 1e-8
"""A squared sine between the axes of two circles below which where they meet isn't known well: the
corner's part in the axes' plane is off by 1e-12, its distance from that by the root at most."""
MOST = 48
"""Circles that are looked at: corners are as many as their pairs. To leave one out is sound."""
SAME = 1e-20
"""The same below which two circles about one axis are one, or don't meet."""


WALK = 6
"""Points that are looked at on the way from a cap's middle, each on the circle that the last one
was farthest beyond: mostly the third or so is beyond none."""
OVERSHOOT = 0.1
"""By how much that one is inside its circle, as a share of how far the last was outside."""


@kernel
def lean_space(count):
    """Work space for so many contacts: circles, a core of them, a group's members and signs.

    Of circles: axes, bounds. Of a core: axes, bounds, numbers.
    """
    return (
        (np.empty((MOST + 1, 3)), np.empty(MOST + 1)),
        (np.empty((MOST + 1, 3)), np.empty(MOST + 1), np.empty(MOST + 1, np.int64)),
        np.empty(count, np.int64),
        np.empty(count),
    )


@borrowing
def _most_beyond(axes, limits, count, x, y, z):
    """The circle that a point of the sphere is farthest beyond, and how far; -1 if none surely."""
    worst, where = SLACK, -1
    for k in range(count):
        beyond = axes[k, 0] * x + axes[k, 1] * y + axes[k, 2] * z - limits[k]
        if beyond > worst:
            worst, where = beyond, k
    return where, worst


@borrowing
def _beyond(axes, limits, count, x, y, z):
    """Whether a point of the sphere is surely beyond some circle."""
    for k in range(count):
        if axes[k, 0] * x + axes[k, 1] * y + axes[k, 2] * z > limits[k] + SLACK:
            return True
    return False


@borrowing
def _corner(axes, limits, count):
    """A point within all circles: one of any circle, or one where two of them meet.

    Returns:
        Whether there is one, or may be one that isn't known well; whether it is known; the point.
    """
    for k in range(count):
        if limits[k] < -1.0 - SLACK:
            return False, False, (0.0, 0.0, 0.0)
        # Any point of the circle.
        a, b, c = axes[k, 0], axes[k, 1], axes[k, 2]
        x, y, z = perpendicular(a, b, c)
        height = min(max(limits[k], -1.0), 1.0)
        far = np.sqrt(max(1.0 - height * height, 0.0))
        x, y, z = height * a + far * x, height * b + far * y, height * c + far * z
        if not _beyond(axes, limits, count, x, y, z):
            return True, True, (x, y, z)
    for k in range(count):
        a, b, c = axes[k, 0], axes[k, 1], axes[k, 2]
        for j in range(k):
            d, e, f = axes[j, 0], axes[j, 1], axes[j, 2]
            x, y, z = b * f - c * e, c * d - a * f, a * e - b * d
            square = x * x + y * y + z * z
            if square < SKEW:
                if square > SAME:
                    return True, False, (0.0, 0.0, 0.0)
                continue
            cosine = a * d + b * e + c * f
            first = (limits[k] - cosine * limits[j]) / square
            second = (limits[j] - cosine * limits[k]) / square
            p, q, r = first * a + second * d, first * b + second * e, first * c + second * f
            rest = 1.0 - (p * p + q * q + r * r)
            if rest < -1e-11:
                continue
            far = np.sqrt(max(rest, 0.0) / square)
            for side in (-far, far):
                u, v, w = p + side * x, q + side * y, r + side * z
                if not _beyond(axes, limits, count, u, v, w):
                    return True, True, (u, v, w)
    return False, False, (0.0, 0.0, 0.0)


@borrowing
def _some_direction(axes, limits, count, x, y, z, core):
    """Whether some unit v has ``axes[k] . v <= limits[k]`` for all k, or may have.

    From a first guess (x, y, z) on, a point beyond some circle adds that circle to a core. At first
    the next point is the one of that circle nearest to the last, then a point within all of the
    core. A core without any is a proof, and it is mostly a few of dozens.
    """
    core_axes, core_limits, numbers = core
    used = 0
    for step in range(WALK + count + 1):
        k, excess = _most_beyond(axes, limits, count, x, y, z)
        if k < 0:
            return True
        a, b, c = axes[k, 0], axes[k, 1], axes[k, 2]
        known = False
        for j in range(used):
            known |= numbers[j] == k
        if not known:
            core_axes[used, 0], core_axes[used, 1], core_axes[used, 2] = a, b, c
            core_limits[used], numbers[used] = limits[k], k
            used += 1
        if step < WALK:
            height = excess + limits[k]
            x, y, z = x - height * a, y - height * b, z - height * c
            length = np.sqrt(x * x + y * y + z * z)
            if length < 1e-6:
                x, y, z = perpendicular(a, b, c)
                length = 1.0
            # A little inside: what walks along two circles would come near their corner only.
            height = min(max(limits[k] - OVERSHOOT * excess, -1.0), 1.0)
            far = np.sqrt(1.0 - height * height) / length
            x, y, z = height * a + far * x, height * b + far * y, height * c + far * z
        else:
            some, sure, (x, y, z) = _corner(core_axes, core_limits, used)
            if not some:
                return False
            if not sure:
                return True
    return True


@borrowing
def _add(axes, limits, count, a, b, c, limit, cap):
    """Add ``(a, b, c) . v <= limit``, of a unit axis, if it cuts a cap.

    Args:
        axes: (m, 3) of the circles so far, ...
        limits: (m,) their bounds.
        count: how many there are.
        a: the axis ...
        b: ...
        c: ...
        limit: and its bound.
        cap: middle (x, y, z), cosine and sine of its angle, which is below a right one.

    Returns:
        How many there are then; -1 if it leaves nothing of the cap.
    """
    x, y, z, narrow, wide = cap
    cosine = min(max(a * x + b * y + c * z, -1.0), 1.0)
    across = wide * np.sqrt(1.0 - cosine * cosine)
    # Of the cap, the axis has this at least, and this at most.
    least = cosine * narrow - across if cosine > -narrow else -1.0
    if limit < least - SLACK:
        return -1
    most = cosine * narrow + across if cosine < narrow else 1.0
    if limit >= most or count == MOST:
        return count
    axes[count, 0], axes[count, 1], axes[count, 2] = a, b, c
    limits[count] = limit
    return count + 1


@borrowing
def _group_leans(size, members, signs, faces, contacts, errors, model, x, y, z, angle, space):
    """Whether the normal of a group of parallel faces has a direction in a cap about (x, y, z)."""
    (axes, limits), core, _, _ = space
    cap = (x, y, z, np.cos(angle), np.sin(angle))
    points, measured, reaches, _, _ = contacts
    offsets, radius = model[1], model[6]
    count = 0
    for g in range(size):
        i, sign = members[g], signs[g]
        if errors[i] < np.pi:
            u, v, w = -sign * measured[i, 0], -sign * measured[i, 1], -sign * measured[i, 2]
            count = _add(axes, limits, count, u, v, w, -np.cos(errors[i]), cap)
            if count < 0:
                return False
        for h in range(g):
            j = members[h]
            a, b, c = (
                points[i, 0] - points[j, 0],
                points[i, 1] - points[j, 1],
                points[i, 2] - points[j, 2],
            )
            rise = sign * offsets[faces[i]] - signs[h] * offsets[faces[j]]
            room = reaches[i] + reaches[j] + LEVEL * radius
            length = np.sqrt(a * a + b * b + c * c)
            if abs(rise) > length + room:
                return False
            if length <= room:
                continue  # (such a band is nearly the whole sphere)
            a, b, c = a / length, b / length, c / length
            for side in (-1.0, 1.0):
                count = _add(
                    axes,
                    limits,
                    count,
                    side * a,
                    side * b,
                    side * c,
                    (side * rise + room) / length,
                    cap,
                )
                if count < 0:
                    return False
    if count == 0:
        return True
    axes[count, 0], axes[count, 1], axes[count, 2] = -x, -y, -z
    limits[count] = -cap[3]
    return _some_direction(axes, limits, count + 1, x, y, z, core)


@borrowing
def leans(depth, faces, contacts, errors, model, half_angles, rotation, angle, space):
    """Whether each set of contacts on parallel faces allows some rotation, or may.

    Sound: only the faces' planes and normals are asked for, each to its bound.

    Args:
        depth: how many contacts.
        faces: (n,) the feature of each, -1 for none.
        contacts: see `search_kernels.search_model`.
        errors: likewise.
        model: likewise.
        half_angles: likewise.
        rotation: (3, 3) the middle of the cell, object to world.
        angle: of the cell, radians; below zero if there is none.
        space: see `lean_space`.
    """
    normals, measured, members, signs = model[0], contacts[1], space[2], space[3]
    for i in range(depth):
        if faces[i] < 0 or half_angles[faces[i]] != 0.0:
            continue
        m0, m1, m2 = normals[faces[i], 0], normals[faces[i], 1], normals[faces[i], 2]
        size = 0
        for j in range(depth):
            if faces[j] < 0 or half_angles[faces[j]] != 0.0:
                continue
            f = faces[j]
            cosine = m0 * normals[f, 0] + m1 * normals[f, 1] + m2 * normals[f, 2]
            if abs(cosine) < 1.0 - PARALLEL:
                continue
            if j < i:
                size = 0  # looked at with that one
                break
            members[size] = j
            signs[size] = 1.0 if cosine > 0.0 else -1.0
            size += 1
        if size < 2:
            continue
        narrowest = 0
        for g in range(1, size):
            if errors[members[g]] < errors[members[narrowest]]:
                narrowest = g
        k, sign = members[narrowest], signs[narrowest]
        x, y, z = sign * measured[k, 0], sign * measured[k, 1], sign * measured[k, 2]
        cap = errors[k]
        if angle >= 0.0:
            x = rotation[0, 0] * m0 + rotation[0, 1] * m1 + rotation[0, 2] * m2
            y = rotation[1, 0] * m0 + rotation[1, 1] * m1 + rotation[1, 2] * m2
            z = rotation[2, 0] * m0 + rotation[2, 1] * m1 + rotation[2, 2] * m2
            cap = angle
        if cap < 0.5 * np.pi and not _group_leans(
            size, members, signs, faces, contacts, errors, model, x, y, z, cap, space
        ):
            return False
    return True
