"""Compiled rows of a linear program about a pose: bounds, and how small motions change them."""

from __future__ import annotations

import numpy as np

from ...compiling import borrowing, kernel
from ...contacts.reading_kernels import ARC, NO_CONE, carry, cone_support, read, worst_on_pieces
from ...models.distance_kernels import deepest, signed_distance
from ...models.polygon_kernels import foot_in_polygon
from ..motions.motion_kernels import move
from ..proofs.proof_kernels import workspace
from .breach_kernels import below_support, pierced_paths, seen_from_behind

EXACT = 1e-9
"""By how much a witness may exceed a bound of a contact, as a share of it: rounding."""
SINE = 0.05
"""The sine by which an approach may come from behind that counts as much as a bound."""
STRIDE = 32.0
"""The part of a path to either side of where it seems to run deepest that is looked at again."""
THIRDS = 30
"""Steps of that search, each of which leaves two thirds."""
STEEP = 1e-12
"""Lengths (in radii) below which a direction is not known."""


@borrowing
def _write(at, value, scale, arm, direction, radius, rows, values):
    """A length along a direction at an arm's end that is to be low; returns the next row."""
    values[at] = value
    a0, a1, a2 = arm
    d0, d1, d2 = direction
    rows[at, 0] = -(a1 * d2 - a2 * d1) / (scale * radius)
    rows[at, 1] = -(a2 * d0 - a0 * d2) / (scale * radius)
    rows[at, 2] = -(a0 * d1 - a1 * d0) / (scale * radius)
    rows[at, 3], rows[at, 4], rows[at, 5] = -d0 / scale, -d1 / scale, -d2 / scale
    return at + 1


@borrowing
def _write_turn(at, value, scale, direction, u, radius, rows, values):
    """What a unit vector has along a direction, that is to be low; returns the next row."""
    values[at] = value
    d0, d1, d2 = direction
    u0, u1, u2 = u
    rows[at, 0] = (d1 * u2 - d2 * u1) / (scale * radius)
    rows[at, 1] = (d2 * u0 - d0 * u2) / (scale * radius)
    rows[at, 2] = (d0 * u1 - d1 * u0) / (scale * radius)
    rows[at, 3], rows[at, 4], rows[at, 5] = 0.0, 0.0, 0.0
    return at + 1


@borrowing
def _nearest_pieces(count, faces, x, model, targets):
    """The convex piece of each contact's face that it is nearest to."""
    normals, offsets, first, start, corners = model[:5]
    for i in range(count):
        f = faces[i]
        targets[i] = f
        if f < 0 or first[f + 1] - first[f] < 2:
            continue
        best = np.inf
        for p in range(first[f], first[f + 1]):
            gap, _, _, _ = foot_in_polygon(
                x[i], normals[f], offsets[f], corners, start[p], start[p + 1]
            )
            if gap < best:
                best = gap
                targets[i] = p


@borrowing
def _contact_rows(count, faces, x, u, model, contacts, readings, rows, values):
    """Rows of distances and normals that have been read; returns how many."""
    _, _, reaches, chords, sines = contacts
    gaps, lengths, _, _, kinds, misses, directions = readings
    centre, radius = model[5], model[6]
    at = 0
    for i in range(count):
        if faces[i] < 0:
            continue
        length = lengths[i]
        if length > STEEP * radius:
            arm = (x[i, 0] - centre[0], x[i, 1] - centre[1], x[i, 2] - centre[2])
            out = (gaps[i, 0] / length, gaps[i, 1] / length, gaps[i, 2] / length)
            value = length / reaches[i] - 1.0
            at = _write(at, value, reaches[i], arm, out, radius, rows, values)
        if kinds[i] == NO_CONE:
            continue
        bound = sines[i] if kinds[i] == ARC else chords[i]
        off = (directions[i, 0], directions[i, 1], directions[i, 2])
        turned = (u[i, 0], u[i, 1], u[i, 2])
        value = misses[i] / bound - 1.0
        at = _write_turn(at, value, bound, off, turned, radius, rows, values)
    return at


@borrowing
def _approach_rows(at, count, faces, rotation, approaches, model, near, rows, values):
    """Rows of contacts that are to be seen from in front; returns the next row."""
    directions, leasts = approaches
    cone_start, cone_normals, radius = model[7], model[8], model[6]
    for i in range(count):
        f = faces[i]
        if f < 0 or leasts[i] <= -1.0:
            continue
        for a in range(3):
            near[a] = 0.0
            for b in range(3):
                near[a] -= rotation[b, a] * directions[i, b]
        most, best = -2.0, cone_start[f]
        for k in range(cone_start[f], cone_start[f + 1]):
            along = 0.0
            for a in range(3):
                along += cone_normals[k, a] * near[a]
            if along > most:
                most, best = along, k
        lack = leasts[i] - cone_support(near, cone_normals, cone_start[f], cone_start[f + 1])
        m = (-cone_normals[best, 0], -cone_normals[best, 1], -cone_normals[best, 2])
        turned = (near[0], near[1], near[2])
        at = _write_turn(at, lack / SINE, SINE, m, turned, radius, rows, values)
    return at


@borrowing
def _support_rows(at, support, scale, pose, model, near, rows, values):
    """Rows of corners that are to be above or below a height; returns the next row."""
    corners, signs, limits, up = support
    rotation, translation = pose
    centre, radius = model[5], model[6]
    for a in range(3):
        near[a] = 0.0
        for b in range(3):
            near[a] += rotation[b, a] * up[b]
    shift = translation[0] * up[0] + translation[1] * up[1] + translation[2] * up[2]
    for v in range(len(corners)):
        height = shift
        for a in range(3):
            height += near[a] * corners[v, a]
        value = signs[v] * (limits[v] - height) / scale
        arm = (corners[v, 0] - centre[0], corners[v, 1] - centre[1], corners[v, 2] - centre[2])
        way = (signs[v] * near[0], signs[v] * near[1], signs[v] * near[2])
        at = _write(at, value, scale, arm, way, radius, rows, values)
    return at


@borrowing
def _place_at(share, one, other, place):
    for k in range(3):
        place[k] = one[k] + share * (other[k] - one[k])


@borrowing
def _settle_deepest(one, other, place, model, solid_faces, nearest, near, point):
    """Move a place of a path that is about where it runs deepest to where it does."""
    length, along = 0.0, 0.0
    for k in range(3):
        length += (other[k] - one[k]) ** 2
        along += (place[k] - one[k]) * (other[k] - one[k])
    if length == 0.0:
        return
    share = along / length
    low, high = max(0.0, share - 1.0 / STRIDE), min(1.0, share + 1.0 / STRIDE)
    for _ in range(THIRDS):
        first, last = low + (high - low) / 3.0, high - (high - low) / 3.0
        _place_at(first, one, other, point)
        before = signed_distance(point, model, solid_faces, nearest, near)
        _place_at(last, one, other, point)
        if before < signed_distance(point, model, solid_faces, nearest, near):
            high = last
        else:
            low = first
    deepest_yet = signed_distance(place, model, solid_faces, nearest, near)
    for share in (0.5 * (low + high), low, high):
        _place_at(share, one, other, point)
        if signed_distance(point, model, solid_faces, nearest, near) < deepest_yet:
            deepest_yet = signed_distance(point, model, solid_faces, nearest, near)
            _place_at(share, one, other, place)


@borrowing
def _outward(place, model, solid_faces, nearest, near):
    """The way in which the signed distance of a place grows."""
    distance = signed_distance(place, model, solid_faces, nearest, near)
    if distance == 0.0:
        return 0.0, 0.0, 0.0
    return (
        (place[0] - nearest[0]) / distance,
        (place[1] - nearest[1]) / distance,
        (place[2] - nearest[2]) / distance,
    )


@borrowing
def _way_out(one, other, place, step, model, solid_faces, nearest, near, point):
    """How the least distance of a path from the object grows with a shift of the path.

    Where the path runs deepest between two faces, it comes nearer to one on the way to the other:
    the two ways out are mixed so that a shift along the path changes nothing.
    """
    length = 0.0
    for k in range(3):
        length += (other[k] - one[k]) ** 2
    length = np.sqrt(length)
    if length <= step:
        return _outward(place, model, solid_faces, nearest, near)
    share, along, before, after = step / length, 0.0, 0.0, 0.0
    for k in range(3):
        along += (place[k] - one[k]) * (other[k] - one[k]) / (length * length)
    if along <= share or along >= 1.0 - share:
        return _outward(place, model, solid_faces, nearest, near)
    _place_at(along - share, one, other, point)
    a0, a1, a2 = _outward(point, model, solid_faces, nearest, near)
    _place_at(along + share, one, other, point)
    b0, b1, b2 = _outward(point, model, solid_faces, nearest, near)
    d0, d1, d2 = other[0] - one[0], other[1] - one[1], other[2] - one[2]
    before = (a0 * d0 + a1 * d1 + a2 * d2) / length
    after = (b0 * d0 + b1 * d1 + b2 * d2) / length
    if before > -1e-9 or after < 1e-9:
        return _outward(place, model, solid_faces, nearest, near)
    mix = after / (after - before)
    return (
        mix * a0 + (1.0 - mix) * b0,
        mix * a1 + (1.0 - mix) * b1,
        mix * a2 + (1.0 - mix) * b2,
    )


@borrowing
def _path_rows(at, paths, scales, pose, bound, model, solid_faces, space, rows, values):
    """Rows of paths, each where it runs deepest, that are to be outside; returns the next row."""
    starts, ends, clearances, grains = paths
    rotation, translation = pose
    centre, radius = model[5], model[6]
    one, other, place, point, nearest, near = space[:6]
    for s in range(len(starts)):
        for k in range(3):
            one[k] = 0.0
            other[k] = 0.0
            for i in range(3):
                one[k] += rotation[i, k] * (starts[s, i] - translation[i])
                other[k] += rotation[i, k] * (ends[s, i] - translation[i])
        least = clearances[s] + grains[s]
        distance = deepest(
            one, other, least, grains[s], bound, model, solid_faces, place, point, nearest, near
        )
        if distance == np.inf:
            continue
        if distance < least:
            _settle_deepest(one, other, place, model, solid_faces, nearest, near, point)
        distance = signed_distance(place, model, solid_faces, nearest, near)
        if abs(distance) <= STEEP * radius:
            continue
        out = _way_out(
            one, other, place, 0.01 * scales[s], model, solid_faces, nearest, near, point
        )
        arm = (place[0] - centre[0], place[1] - centre[1], place[2] - centre[2])
        way = (-out[0], -out[1], -out[2])
        # A little more than is asked for, so that the test itself sees it.
        value = (least + 0.1 * grains[s] - distance) / scales[s]
        at = _write(at, value, scales[s], arm, way, radius, rows, values)
    return at


@kernel
def bound_rows(
    faces,
    contacts,
    model,
    solid_faces,
    bound,
    paths,
    path_scales,
    support,
    support_scale,
    approaches,
    rotation,
    translation,
):
    """Every bound at a pose, in units of itself, with its slopes.

    Args:
        faces: (n,) the feature of each contact, -1 for none.
        contacts: see `pose.kernel_contacts`.
        model: likewise.
        solid_faces: how many of the features are faces of the solid.
        bound: radius about the centroid that holds the solid, metres.
        paths: see `cut_kernels.clear_pose`.
        path_scales: (m,) the unit of each, metres.
        support: see `cut_kernels.clear_pose`.
        support_scale: its unit, metres.
        approaches: see `cut_kernels.clear_pose`.
        rotation: (3, 3) object to world.
        translation: (3,) likewise, metres.

    Returns:
        (r,) values, none above zero at a witness; (r, 6) how they change with a rotation about the
        centroid times the radius, and a shift, of the object in its own frame; and whether the pose
        is a witness.
    """
    count = len(faces)
    most = 3 * count + len(support[0]) + len(paths[0])
    rows, values = np.empty((most, 6)), np.empty(most)
    work = workspace(count)
    readings, x, u = work[0], work[3][0], work[3][1]
    targets = np.empty(count, np.int64)
    near = np.empty(3)
    pose = (rotation, translation)
    space = (
        np.empty(3), np.empty(3), np.empty(3), np.empty(3), np.empty(3), np.empty(3), np.empty(3),
        np.empty(3), np.empty(3), np.empty(3), np.empty(3),
    )  # fmt: skip
    carry(count, contacts[0], contacts[1], rotation, translation, x, u)
    _nearest_pieces(count, faces, x, model, targets)
    worst = read(count, faces, targets, x, u, model, contacts, readings)
    at = _contact_rows(count, faces, x, u, model, contacts, readings, rows, values)
    at = _approach_rows(at, count, faces, rotation, approaches, model, near, rows, values)
    at = _support_rows(at, support, support_scale, pose, model, near, rows, values)
    at = _path_rows(at, paths, path_scales, pose, bound, model, solid_faces, space, rows, values)
    met = worst <= 1.0 + EXACT
    if met:
        read(count, faces, faces, x, u, model, contacts, readings)
        exact, _ = worst_on_pieces(count, faces, faces, x, model, contacts, readings)
        met = exact <= 1.0 + EXACT
    if met:
        met = below_support(pose, support[0], support[1], support[2], support[3], model[6]) < 0
    if met:
        met = seen_from_behind(count, faces, pose, approaches[0], approaches[1], model, near) < 0
    if met:
        m = len(paths[0])
        broken, places = np.empty(m, np.int64), np.empty((m, 3))
        met = pierced_paths(paths, pose, bound, model, solid_faces, broken, places, space) == 0
    return values[:at].copy(), rows[:at].copy(), met


@kernel
def apply_motion(rotation, translation, step, centre, radius):
    """A pose after a small motion, see `motion_kernels.move`."""
    turned, shifted = np.empty((3, 3)), np.empty(3)
    move(rotation, translation, step, centre, radius, turned, shifted)
    return turned, shifted
