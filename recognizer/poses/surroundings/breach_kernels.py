"""Compiled checks of a pose: what it breaks of what else is known of the object."""

from __future__ import annotations

import numpy as np

from ...compiling import borrowing, kernel
from ...contacts.reading_kernels import cone_support
from ...models.distance_kernels import deepest, signed_distance

EXACT = 1e-9
"""By how much a pose may break a limit, in sines or shares of the radius: rounding."""


@borrowing
def below_support(pose, corners, signs, limits, up, radius):
    """The corner that breaks its limit most; -1 if none does."""
    rotation, translation = pose
    most, which = EXACT * radius, -1
    for v in range(len(corners)):
        height = 0.0
        for i in range(3):
            place = translation[i]
            for k in range(3):
                place += rotation[i, k] * corners[v, k]
            height += up[i] * place
        lack = signs[v] * (limits[v] - height)
        if lack > most:
            most, which = lack, v
    return which


@borrowing
def seen_from_behind(count, faces, pose, approaches, leasts, model, near):
    """A contact whose feature has no normal that faces its approach; -1 if there is none."""
    rotation = pose[0]
    cone_start, cone_normals = model[7], model[8]
    for i in range(count):
        f = faces[i]
        if f < 0 or leasts[i] <= -1.0:
            continue
        for a in range(3):
            near[a] = 0.0
            for b in range(3):
                near[a] -= rotation[b, a] * approaches[i, b]
        if cone_support(near, cone_normals, cone_start[f], cone_start[f + 1]) < leasts[i] - EXACT:
            return i
    return -1


@borrowing
def pierced_paths(paths, pose, bound, model, solid_faces, broken, worst_places, space):
    """The paths that run deeper in the object than is allowed, and where.

    Args:
        paths: see `cut_kernels.clear_pose`.
        pose: rotation and translation.
        bound: radius about the centroid that holds the solid.
        model: see `pose.ModelTest`.
        solid_faces: how many of its features are faces.
        broken: (m,) the paths, written in place.
        worst_places: (m, 3) the deepest place of each, object frame, likewise.
        space: work space.

    Returns:
        How many there are.
    """
    starts, ends, clearances, grains = paths
    rotation, translation = pose
    one, other, found, point, nearest, near = space[:6]
    count = 0
    for s in range(len(starts)):
        for k in range(3):
            one[k] = 0.0
            other[k] = 0.0
            for i in range(3):
                one[k] += rotation[i, k] * (starts[s, i] - translation[i])
                other[k] += rotation[i, k] * (ends[s, i] - translation[i])
        clearance = clearances[s] + grains[s]
        distance = deepest(
            one,
            other,
            clearance,
            grains[s],
            bound,
            model,
            solid_faces,
            found,
            point,
            nearest,
            near,
        )
        if clearance > distance:
            broken[count] = s
            for k in range(3):
                worst_places[count, k] = found[k]
            count += 1
    return count


@kernel
def move_inside(place, clearance, model, solid_faces, nearest, near, trial):
    """Move a place of a path, within the radius around it that is free, into the object.

    Returns:
        Its clearance after the move: zero at most; above zero if it didn't get inside.
    """
    distance = signed_distance(place, model, solid_faces, nearest, near)
    if distance < 0.0:
        return min(clearance, 0.0)
    if clearance <= 0.0:
        return 1.0
    least, best = np.inf, 0.0
    far = distance + 1e-300
    for part in range(1, 6):
        length = distance + (clearance - distance) * 0.999 * part / 5.0
        for k in range(3):
            trial[k] = place[k] + (nearest[k] - place[k]) / far * length
        depth = _depth_at(trial, model, solid_faces, near)
        if depth < least:
            least, best = depth, length
    for k in range(3):
        place[k] += (nearest[k] - place[k]) / far * best
    return 0.0 if least < 0.0 else 1.0


@kernel
def _depth_at(x, model, solid_faces, near):
    nearest = np.empty(3)
    return signed_distance(x, model, solid_faces, nearest, near)
