"""Compiled checks of a pose: what it breaks of what else is known of the object."""

from __future__ import annotations

import numpy as np

from ..compiling import borrowing
from ..contacts.reading_kernels import cone_support
from ..models.distance_kernels import deepest, signed_distance

COARSE, FINER = 0.03, 0.2
"""Steps along a path that keeps its clearance easily, in radii; how much finer the next are."""
UNBROKEN, BROKEN, ANEW = 0, 1, 2
"""What of what is known a pose breaks: nothing; something; a path that was not heeded so far."""
EXACT = 1e-9
"""By how much a pose may break a limit, in sines or shares of the radius: rounding."""


@borrowing
def height_of(corner, rotation, translation, up):
    """The height of a corner, object frame, at a pose, object to world."""
    height = 0.0
    for i in range(3):
        place = translation[i]
        for k in range(3):
            place += rotation[i, k] * corner[k]
        height += up[i] * place
    return height


@borrowing
def stands_on(faces, known):
    """Which of its faces the object stands on, as its first contact's feature says; -1 if none."""
    return faces[0] - known.square if faces[0] >= known.square else -1


@borrowing
def below_support(faces, known, rotation, translation, radius):
    """Whether a corner is on the wrong side of its height."""
    slack, foot = EXACT * radius, stands_on(faces, known)
    for v in range(len(known.corners)):
        height = height_of(known.corners[v], rotation, translation, known.up)
        if known.signs[v] * (known.limits[v] - height) > slack:
            return True
    if foot >= 0:
        for v in range(known.foot_start[foot], known.foot_start[foot + 1]):
            if height_of(known.feet[v], rotation, translation, known.up) > known.ceiling + slack:
                return True
    return False


@borrowing
def seen_from_behind(faces, known, rotation, model, front):
    """Whether some contact's feature has no normal that faces its approach."""
    cone_start, cone_normals = model[7], model[8]
    for i in range(len(faces)):
        f = faces[i]
        if f < 0 or known.leasts[i] <= -1.0:
            continue
        face_front(known.fronts[i], rotation, front)
        facing = cone_support(front, cone_normals, cone_start[f], cone_start[f + 1])
        if facing < known.leasts[i] - EXACT:
            return True
    return False


@borrowing
def face_front(front, rotation, turned):
    """A way back along an approach, world frame, into the object's frame, (3,) in place."""
    for a in range(3):
        turned[a] = 0.0
        for b in range(3):
            turned[a] += rotation[b, a] * front[b]


@borrowing
def nearest_on_path(s, least, grain, known, model, rotation, translation, space):
    """Where a free path runs deepest in the object at a pose, or comes nearest to it.

    Args:
        s: the path.
        least: how far away it should be, metres; ...
        grain: ... if it is, nowhere is it nearer than this less than that.
        known: see `known.Known`.
        model: see `pose.KernelModel`.
        rotation: (3, 3) object to world.
        translation: (3,) metres.
        space: five (3,) arrays: the path's ends in the object's frame and the place are written
            into the first three; the others are work space.

    Returns:
        Its signed distance there, infinity if the path is out of reach.
    """
    one, other, place, point, nearest = space
    for k in range(3):
        one[k] = 0.0
        other[k] = 0.0
        for i in range(3):
            one[k] += rotation[i, k] * (known.starts[s, i] - translation[i])
            other[k] += rotation[i, k] * (known.ends[s, i] - translation[i])
    return deepest(
        *(one, other, least, grain, known.bound, model, known.solid_faces),
        *(place, point, nearest),
    )


@borrowing
def is_broken(s, known, model, rotation, translation, space):
    """Whether a path is not known to keep its clearance: looked at ever closer, where that matters.

    Arguments as in `nearest_on_path`.
    """
    clearance, grain = known.clearances[s], max(COARSE * known.bound, known.grains[s])
    while True:
        least = clearance + grain
        distance = nearest_on_path(s, least, grain, known, model, rotation, translation, space)
        if distance >= least:
            return False
        if grain <= known.grains[s] or distance < clearance + known.grains[s]:
            return True
        grain = max(FINER * grain, known.grains[s])


@borrowing
def breaks_known(faces, known, model, rotation, translation, heeded, space):
    """Whether a pose breaks anything that is known.

    Arguments as in `nearest_on_path`, the feature of each contact, (n,), and (m,) ``heeded``, where
    the first path that it breaks is marked.

    Returns:
        `UNBROKEN`, `BROKEN`, or `ANEW` if a path was marked that wasn't.
    """
    if below_support(faces, known, rotation, translation, model[6]) or seen_from_behind(
        faces, known, rotation, model, space[3]
    ):
        return BROKEN
    outcome = UNBROKEN
    for s in range(len(known.starts)):
        if is_broken(s, known, model, rotation, translation, space):
            if not heeded[s]:
                heeded[s] = True
                return ANEW
            outcome = BROKEN
    return outcome


@borrowing
def move_inside(place, clearance, model, solid_faces, space):
    """Move a place of a path, within the radius around it that is free, into the object.

    Returns:
        Its clearance after the move: zero at most; above zero if it didn't get inside.
    """
    _, _, _, trial, nearest = space
    distance = signed_distance(place, model, solid_faces, nearest)
    if distance < 0.0:
        return min(clearance, 0.0)
    if clearance <= 0.0:
        return 1.0
    d0, d1, d2 = nearest[0] - place[0], nearest[1] - place[1], nearest[2] - place[2]
    least, best = np.inf, 0.0
    far = distance + 1e-300
    for part in range(1, 6):
        length = distance + (clearance - distance) * 0.999 * part / 5.0
        share = length / far
        trial[0], trial[1] = place[0] + d0 * share, place[1] + d1 * share
        trial[2] = place[2] + d2 * share
        depth = signed_distance(trial, model, solid_faces, nearest)
        if depth < least:
            least, best = depth, share
    place[0] += d0 * best
    place[1] += d1 * best
    place[2] += d2 * best
    return 0.0 if least < 0.0 else 1.0
