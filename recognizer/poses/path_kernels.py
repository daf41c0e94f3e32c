"""Compiled free paths against a box of poses: what of it they rule out, wholly or by a row.

A place of a path that is in the object at the middle of a box moves, over the box, no farther than
its turns and shifts take it. If that is not as far as out of the object, no pose of the box leaves
the path free. If it is only through one face, the place ends in front of that face's plane: a row.
"""

from __future__ import annotations

import numpy as np

from ..compiling import borrowing
from ..models.distance_kernels import signed_distance
from ..models.polygon_kernels import foot_in_polygon
from .breach_kernels import COARSE, move_inside, nearest_on_path

PLACES = 9
"""Places of a path that is broken that are looked at: where it runs deepest, and ..."""
APART = 4.0
"""... before and behind that, so many of them to the solid's radius."""
ROUNDING = 1e-9
"""Of lengths, in radii."""


@borrowing
def heed_paths(problem, work):
    """Note what free paths ask of the poses in a box, as cuts.

    Args:
        problem: see `cover.Problem`.
        work: see `work_space.Work`: a box that was tightened, and the pose at its middle as
            ``rotation`` and ``translation``.

    Returns:
        Whether a pose can be left.
    """
    known, model, radius = problem.known, problem.model, problem.shape.radius
    places = work.seeking[13]
    place = places[2]
    square, apart = 0.0, 0.0
    for k in range(3):
        # Turns about the middle, which the box needn't be even about.
        square += max(work.high[k] ** 2, work.low[k] ** 2)
        apart += (0.5 * (work.high[3 + k] - work.low[3 + k])) ** 2
    chord = np.sqrt(square / (1.0 + 0.25 * square))
    for s in range(len(known.starts)):
        least, grain = known.clearances[s], COARSE * known.bound
        distance = nearest_on_path(
            *(s, least, grain, known, model, work.rotation, work.translation, places)
        )
        if distance >= least:
            continue
        for part in range(PLACES):
            if part > 0 and not _place_beside(part, known.bound, places, work.best_place):
                continue
            for k in range(3):
                if part == 0:
                    work.best_place[k] = place[k]
            clearance = move_inside(place, least, model, known.solid_faces, places)
            if clearance > 0.0:
                continue
            square = 0.0
            for k in range(3):
                middle = 0.5 * (work.low[3 + k] + work.high[3 + k])
                square += (place[k] / radius - middle) ** 2
            far = radius * (chord * np.sqrt(square) + np.sqrt(apart) + ROUNDING)
            depth = -signed_distance(place, model, known.solid_faces, places[4])
            if depth + clearance > far:
                return False
            exits = _cut_exit(place, far, clearance, problem, work)
            if exits == 0:
                return False
            if exits == 1:
                break
    return True


@borrowing
def _place_beside(part, bound, places, deepest_place):
    """A place of a path a way before or behind where it runs deepest; returns whether there is."""
    one, other, place = places[:3]
    squared, along = 0.0, 0.0
    for k in range(3):
        squared += (other[k] - one[k]) ** 2
        along += (deepest_place[k] - one[k]) * (other[k] - one[k])
    if squared == 0.0:
        return False
    step = bound / APART * ((part + 1) // 2) * (1.0 if part % 2 == 0 else -1.0)
    share = along / squared + step / np.sqrt(squared)
    if not 0.0 <= share <= 1.0:
        return False
    for k in range(3):
        place[k] = one[k] + share * (other[k] - one[k])
    return True


@borrowing
def _cut_exit(place, far, clearance, problem, work):
    """Note a place's way out of the object as a cut, if there is only one.

    The straight way to where a place ends that is outside, or no deeper inside than its clearance
    says, crosses a face's plane from behind, within its outline, and ends no deeper behind it.

    Args:
        place: (3,) in the object, its frame, metres.
        far: how far it can go.
        clearance: its least signed distance where it ends, zero at most.
        problem: see `cover.Problem`.
        work: see `work_space.Work`.

    Returns:
        How many there are, two standing for more.
    """
    normals, offsets, first, start, corners = problem.model[:5]
    radius, found, exit_face = problem.shape.radius, 0, -1
    for f in range(problem.known.solid_faces):
        n = normals[f]
        height = n[0] * place[0] + n[1] * place[1] + n[2] * place[2] - offsets[f]
        if height >= 0.0 or height + far < clearance:
            continue
        for p in range(first[f], first[f + 1]):
            gap, _, _, _ = foot_in_polygon(place, n, offsets[f], corners, start[p], start[p + 1])
            if np.sqrt(gap) <= far - clearance:
                found += 1
                exit_face = f
                break
        if found > 1:
            return found
    at = work.cut_count[0]
    if found == 0 or at == len(work.cuts):
        return found
    # The place as a point of the world, about the contacts' mean.
    for k in range(3):
        arm = work.translation[k] - work.mean[k]
        for a in range(3):
            arm += work.rotation[k, a] * place[a]
        work.cut_arms[at, k] = arm / radius
        work.cuts[at, k] = work.cuts[at, 3 + k] = -normals[exit_face, k]
    work.cuts[at, 6] = -(offsets[exit_face] + clearance) / radius + ROUNDING
    work.cut_count[0] += 1
    return found
