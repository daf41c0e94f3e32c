"""Compiled readings: how far each contact is from its feature, and each normal from its cone.

A feature is a face, a convex edge or a convex vertex: a solid convex polygon, a segment or a point,
with the cone of outward normals that a finger can meet there (one for a face, an arc for an edge, a
spherical polygon for a vertex). A polygon stands for a feature: its own convex hull, or one of the
convex pieces of a concave face.
"""

from __future__ import annotations

import numpy as np

from ..compiling import borrowing
from ..models.polygon_kernels import CORNER, foot_in_polygon, nearest_in_polygon

UNKNOWN_NORMAL = 2.0
"""A chord no two unit vectors exceed: a bound this wide says nothing."""
NO_CONE, RAY, ARC, CONE_END = 0, 1, 2, 3
"""What is known of a normal: nothing, or it is inside the cone; the distance to the one normal of a
face; the angle's sine off the plane of an arc; the distance to an arc's end."""


@borrowing
def nearest_on_arc(u, first, last):
    """Where on an arc between two unit normals ``u`` is nearest.

    Args:
        u: (3,) unit vector.
        first: (3,) one end.
        last: (3,) other end, less than half a turn on.

    Returns:
        The signed distance off the plane; 0 within the arc, 1 at its first end, 2 at its last; and
        the unit normal of the arc's plane, ``first x last``.
    """
    a0 = first[1] * last[2] - first[2] * last[1]
    a1 = first[2] * last[0] - first[0] * last[2]
    a2 = first[0] * last[1] - first[1] * last[0]
    length = np.sqrt(a0 * a0 + a1 * a1 + a2 * a2)
    a0, a1, a2 = a0 / length, a1 / length, a2 / length
    off = a0 * u[0] + a1 * u[1] + a2 * u[2]
    # axis x first points along the arc at its start, last x axis back along it at its end.
    after = (
        u[0] * (a1 * first[2] - a2 * first[1])
        + u[1] * (a2 * first[0] - a0 * first[2])
        + u[2] * (a0 * first[1] - a1 * first[0])
    )
    before = (
        u[0] * (last[1] * a2 - last[2] * a1)
        + u[1] * (last[2] * a0 - last[0] * a2)
        + u[2] * (last[0] * a1 - last[1] * a0)
    )
    if after >= 0.0 and before >= 0.0:
        return off, 0, (a0, a1, a2)
    near_first = u[0] * first[0] + u[1] * first[1] + u[2] * first[2]
    near_last = u[0] * last[0] + u[1] * last[1] + u[2] * last[2]
    return off, 1 if near_first >= near_last else 2, (a0, a1, a2)


@borrowing
def nearest_in_cone(u, normals, start, stop, direction):
    """How a unit vector misses a cone of normals.

    Args:
        u: (3,) unit vector.
        normals: (c, 3) unit normals, of which start to stop are the cone's corners, in order.
        start: the first corner.
        stop: one past the last.
        direction: (3,) written in place: the unit direction in which ``u`` misses the cone.

    Returns:
        The kind, and by how much ``u`` misses: a chord, or for `ARC` the sine of an angle.
    """
    count = stop - start
    if count == 1:
        gap = 0.0
        for k in range(3):
            direction[k] = u[k] - normals[start, k]
            gap += direction[k] * direction[k]
        gap = np.sqrt(gap)
        if gap > 1e-300:
            for k in range(3):
                direction[k] /= gap
        return RAY, gap
    if count > 2:
        inside = True
        for k in range(start, stop):
            after = k + 1 if k + 1 < stop else start
            off, _, _ = nearest_on_arc(u, normals[k], normals[after])
            inside &= off >= 0.0
        if inside:
            return NO_CONE, 0.0
    best = -np.inf
    kind, miss = NO_CONE, 0.0
    for k in range(start, stop if count > 2 else start + 1):
        after = k + 1 if k + 1 < stop else start
        off, where, axis = nearest_on_arc(u, normals[k], normals[after])
        if where == 0:
            if off > 0.0 and count > 2:
                continue
            near = np.sqrt(max(0.0, 1.0 - off * off))
            if near > best:
                best, kind, miss = near, ARC, abs(off)
                sign = 1.0 if off > 0.0 else -1.0
                direction[0] = sign * axis[0]
                direction[1] = sign * axis[1]
                direction[2] = sign * axis[2]
        else:
            end = k if where == 1 else after
            near = u[0] * normals[end, 0] + u[1] * normals[end, 1] + u[2] * normals[end, 2]
            if near > best:
                best, kind = near, CONE_END
                miss = np.sqrt(max(0.0, 2.0 - 2.0 * near))
                for i in range(3):
                    direction[i] = (u[i] - normals[end, i]) / max(miss, 1e-300)
    return kind, miss


@borrowing
def cone_support(direction, normals, start, stop):
    """The most that any normal of a cone has along a direction; see `nearest_in_cone`."""
    best = -np.inf
    for k in range(start, stop):
        along = 0.0
        for i in range(3):
            along += direction[i] * normals[k, i]
        best = max(best, along)
    if stop - start == 1:
        return best
    length = 0.0
    for i in range(3):
        length += direction[i] * direction[i]
    inside = stop - start > 2
    for k in range(start, stop if stop - start > 2 else start + 1):
        after = k + 1 if k + 1 < stop else start
        off, where, _ = nearest_on_arc(direction, normals[k], normals[after])
        inside &= off >= 0.0
        if where == 0:
            best = max(best, np.sqrt(max(0.0, length - off * off)))
    return np.sqrt(length) if inside else best


@borrowing
def nearest_on_feature(x, normal, offset, corners, start, stop, nearest):
    """`nearest_in_polygon` for polygons of any number of corners; one is a point."""
    if stop - start > 1:
        return nearest_in_polygon(x, normal, offset, corners, start, stop, nearest)
    squared = 0.0
    height = -offset
    for k in range(3):
        nearest[k] = corners[start, k]
        squared += (x[k] - nearest[k]) ** 2
        height += normal[k] * x[k]
    return squared, height, CORNER


@borrowing
def read(count, faces, targets, x, u, model, contacts, readings):
    """How far each contact is from its feature's hull and each normal from its cone, in place.

    Args:
        count: how many contacts count.
        faces: (n,) the feature of each contact, -1 for none.
        targets: (n,) the polygon that stands for that feature.
        x: (n, 3) contacts, object frame, metres.
        u: (n, 3) measured normals, object frame.
        model: see `pose.KernelModel`.
        contacts: likewise.
        readings: gaps (n, 3) from the nearest point of the feature; their lengths (n,); heights
            (n,); what is nearest (n,), see `polygon_kernels`; kinds (n,), misses (n,) and
            directions (n, 3) of normals, see `nearest_in_cone`; all written.

    Returns:
        The largest reading in bounds.
    """
    normals, offsets, _, start, corners, _, _, cone_start, cone_normals = model
    _, _, reaches, chords, sines = contacts
    gaps, lengths, heights, regions, kinds, misses, directions = readings
    worst = 0.0
    for i in range(count):
        f = faces[i]
        if f < 0:
            continue
        p = targets[i]
        squared, height, region = nearest_on_feature(
            x[i], normals[f], offsets[f], corners, start[p], start[p + 1], gaps[i]
        )
        lengths[i] = np.sqrt(squared)
        heights[i] = height
        regions[i] = region
        for k in range(3):
            gaps[i, k] = x[i, k] - gaps[i, k]
        worst = max(worst, lengths[i] / reaches[i])
        kinds[i] = NO_CONE
        if chords[i] >= UNKNOWN_NORMAL:
            continue
        kind, miss = nearest_in_cone(
            u[i], cone_normals, cone_start[f], cone_start[f + 1], directions[i]
        )
        if kind == ARC and sines[i] >= 1.0:
            continue
        kinds[i] = kind
        misses[i] = miss
        if kind != NO_CONE:
            worst = max(worst, miss / (sines[i] if kind == ARC else chords[i]))
    return worst


@borrowing
def worst_on_pieces(count, faces, targets, x, model, contacts, readings):
    """The largest distance of a contact from its feature itself, concave faces too, in bounds.

    Arguments as in `read`, which must have run.

    Returns:
        The largest distance, and the contact it is of.
    """
    normals, offsets, first, start, corners = model[0], model[1], model[2], model[3], model[4]
    reaches = contacts[2]
    lengths = readings[1]
    worst, where = 0.0, 0
    for i in range(count):
        f = faces[i]
        if f < 0:
            continue
        squared = lengths[i] * lengths[i]
        if targets[i] == f and first[f + 1] - first[f] > 1:
            squared = np.inf
            for k in range(first[f], first[f + 1]):
                gap, _, _, _ = foot_in_polygon(
                    x[i], normals[f], offsets[f], corners, start[k], start[k + 1]
                )
                squared = min(squared, gap)
        share = np.sqrt(squared) / reaches[i]
        if share > worst:
            worst, where = share, i
    return worst, where


@borrowing
def meets_all(count, faces, x, u, model, contacts, slack, spare):
    """Whether every reading is within its bound, concave faces as they are; stops at the first no.

    Arguments as in `read`; ``slack`` is a share of each bound, (3,) ``spare`` is work space.
    """
    normals, offsets, first, start, corners, _, _, cone_start, cone_normals = model
    _, _, reaches, chords, sines = contacts
    wider = 1.0 + slack
    # A feature is no nearer than its plane: most poses fail here, or by a normal.
    for i in range(count):
        f = faces[i]
        if f < 0:
            continue
        height = normals[f, 0] * x[i, 0] + normals[f, 1] * x[i, 1] + normals[f, 2] * x[i, 2]
        if abs(height - offsets[f]) > wider * reaches[i]:
            return False
        if chords[i] >= UNKNOWN_NORMAL:
            continue
        kind, miss = nearest_in_cone(u[i], cone_normals, cone_start[f], cone_start[f + 1], spare)
        if kind == ARC and sines[i] < 1.0 and miss > wider * sines[i]:
            return False
        if kind not in (NO_CONE, ARC) and miss > wider * chords[i]:
            return False
    for i in range(count):
        f = faces[i]
        if f < 0:
            continue
        squared = np.inf
        concave = first[f + 1] - first[f] > 1
        for p in range(first[f] if concave else f, first[f + 1] if concave else f + 1):
            gap, _, _ = nearest_on_feature(
                x[i], normals[f], offsets[f], corners, start[p], start[p + 1], spare
            )
            squared = min(squared, gap)
        if squared > (wider * reaches[i]) ** 2:
            return False
    return True


@borrowing
def carry(count, points, measured, rotation, translation, x, u):
    """The first contacts and normals, world frame, into the object's frame: ``x``, ``u``."""
    for i in range(count):
        p0 = points[i, 0] - translation[0]
        p1 = points[i, 1] - translation[1]
        p2 = points[i, 2] - translation[2]
        n0, n1, n2 = measured[i, 0], measured[i, 1], measured[i, 2]
        for k in range(3):
            r0, r1, r2 = rotation[0, k], rotation[1, k], rotation[2, k]
            x[i, k] = r0 * p0 + r1 * p1 + r2 * p2
            u[i, k] = r0 * n0 + r1 * n1 + r2 * n2
