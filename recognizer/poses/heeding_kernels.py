"""Compiled slopes of what is known besides contacts, for a search for a witness.

Each bound that a pose comes near to, or breaks, adds to the normal equations of `witness_kernels`:
corners at the support, contacts seen from behind, and paths where they run deepest.
"""

from __future__ import annotations

import numpy as np

from ..compiling import borrowing
from ..contacts.reading_kernels import cone_support
from ..models.distance_kernels import signed_distance
from .breach_kernels import COARSE, face_front, height_of, nearest_on_path, stands_on
from .motions.motion_kernels import add_row, slope_row

SINE = 0.05
"""The sine by which an approach may come from behind that counts as much as a bound."""
THIRDS = 6
"""Steps of that search, each of which leaves two thirds."""
BESIDE = 0.01
"""How far beside that the ways out are looked at, in bounds."""
STEEP = 1e-12
"""Lengths (in radii) below which a direction is not known."""


@borrowing
def hindering(share, faces, known, model, rotation, translation, heeded, space):
    """Normal equations of what is known that is broken, or met with too little to spare, squared.

    Args:
        share: of each bound that is aimed at.
        faces: (n,) the feature of each contact.
        known: see `known.Known`.
        model: see `pose.KernelModel`.
        rotation: (3, 3) object to world.
        translation: (3,) metres.
        heeded: (m,) the paths that count.
        space: system, gradient, row, (3,) turn, arm and spare; and five (3,) arrays.

    Returns:
        The sum, in bounds.
    """
    system, gradient, row, turn, arm, spare = space[0]
    centre, radius = model[5], model[6]
    cost, foot = 0.0, stands_on(faces, known)
    face_front(known.up, rotation, turn)
    margin, weight = (1.0 - share) * known.slack, 1.0 / known.slack**2
    count = len(known.corners)
    first, last = (known.foot_start[foot], known.foot_start[foot + 1]) if foot >= 0 else (0, 0)
    for v in range(count + last - first):
        corner = known.corners[v] if v < count else known.feet[first + v - count]
        sign = known.signs[v] if v < count else -1.0
        limit = known.limits[v] if v < count else known.ceiling
        height = height_of(corner, rotation, translation, known.up)
        excess = sign * (limit - height) + margin
        if excess > 0.0:
            for k in range(3):
                arm[k] = sign * (corner[k] - centre[k])
            slope_row(turn, arm, radius, spare, row)
            for k in range(3, 6):
                row[k] *= sign
            add_row(row, excess, weight, system, gradient)
            cost += weight * excess * excess
    cost += _add_approaches(share, faces, known, model, rotation, space[0])
    for s in range(len(heeded)):
        if heeded[s]:
            cost += _add_path(s, share, known, model, rotation, translation, space)
    return cost


@borrowing
def _add_approaches(share, faces, known, model, rotation, space):
    """Contacts that are seen from behind."""
    system, gradient, row, turn, _, _ = space
    cone_start, cone_normals, radius = model[7], model[8], model[6]
    cost = 0.0
    for i in range(len(faces)):
        f = faces[i]
        if f < 0 or known.leasts[i] <= -1.0:
            continue
        face_front(known.fronts[i], rotation, turn)
        facing = cone_support(turn, cone_normals, cone_start[f], cone_start[f + 1])
        excess = known.leasts[i] - facing + (1.0 - share) * SINE
        if excess <= 0.0:
            continue
        most, best = -2.0, cone_start[f]
        for k in range(cone_start[f], cone_start[f + 1]):
            m = cone_normals[k]
            along = m[0] * turn[0] + m[1] * turn[1] + m[2] * turn[2]
            if along > most:
                most, best = along, k
        m = cone_normals[best]
        row[0] = -(m[1] * turn[2] - m[2] * turn[1]) / radius
        row[1] = -(m[2] * turn[0] - m[0] * turn[2]) / radius
        row[2] = -(m[0] * turn[1] - m[1] * turn[0]) / radius
        row[3] = row[4] = row[5] = 0.0
        add_row(row, excess, 1.0 / SINE**2, system, gradient)
        cost += excess * excess / SINE**2
    return cost


@borrowing
def _add_path(s, share, known, model, rotation, translation, space):
    """A free path that runs too deep, where it runs deepest."""
    (system, gradient, row, turn, arm, spare), places = space
    _, _, place, _, nearest = places
    centre, radius, solid_faces = model[5], model[6], known.solid_faces
    least = known.clearances[s] + known.grains[s]
    margin = (1.0 - share) * known.scales[s] + 0.1 * known.grains[s]
    grain = COARSE * known.bound
    distance = nearest_on_path(
        s, least + margin, grain, known, model, rotation, translation, places
    )
    if distance == np.inf or distance > least + margin:
        return 0.0
    _settle_deepest(places, grain, model, solid_faces)
    distance = signed_distance(place, model, solid_faces, nearest)
    excess = least + margin - distance
    if excess <= 0.0 or abs(distance) <= STEEP * radius:
        return 0.0
    d0, d1, d2 = _way_out(places, BESIDE * known.scales[s], model, solid_faces)
    turn[0], turn[1], turn[2] = -d0, -d1, -d2
    for k in range(3):
        arm[k] = place[k] - centre[k]
    slope_row(turn, arm, radius, spare, row)
    weight = 1.0 / known.scales[s] ** 2
    add_row(row, excess, weight, system, gradient)
    return weight * excess * excess


@borrowing
def _place_at(share, one, other, place):
    for k in range(3):
        place[k] = one[k] + share * (other[k] - one[k])


@borrowing
def _settle_deepest(places, step, model, solid_faces):
    """Move a place of a path that is within a step of where it runs deepest about there."""
    one, other, place, point, nearest = places
    length, along = 0.0, 0.0
    for k in range(3):
        length += (other[k] - one[k]) ** 2
        along += (place[k] - one[k]) * (other[k] - one[k])
    if length == 0.0:
        return
    share = along / length
    aside = step / np.sqrt(length)
    low, high = max(0.0, share - aside), min(1.0, share + aside)
    for _ in range(THIRDS):
        first, last = low + (high - low) / 3.0, high - (high - low) / 3.0
        _place_at(first, one, other, point)
        before = signed_distance(point, model, solid_faces, nearest)
        _place_at(last, one, other, point)
        if before < signed_distance(point, model, solid_faces, nearest):
            high = last
        else:
            low = first
    deepest_yet = signed_distance(place, model, solid_faces, nearest)
    for share in (0.5 * (low + high), low, high):
        _place_at(share, one, other, point)
        distance = signed_distance(point, model, solid_faces, nearest)
        if distance < deepest_yet:
            deepest_yet = distance
            _place_at(share, one, other, place)


@borrowing
def _outward(place, model, solid_faces, nearest):
    """The way in which the signed distance of a place grows."""
    distance = signed_distance(place, model, solid_faces, nearest)
    if distance == 0.0:
        return 0.0, 0.0, 0.0
    return (
        (place[0] - nearest[0]) / distance,
        (place[1] - nearest[1]) / distance,
        (place[2] - nearest[2]) / distance,
    )


@borrowing
def _way_out(places, step, model, solid_faces):
    """How the least distance of a path from the object grows with a shift of the path.

    Where the path runs deepest between two faces, it comes nearer to one on the way to the other:
    the two ways out are mixed so that a shift along the path changes nothing.
    """
    one, other, place, point, nearest = places
    length = 0.0
    for k in range(3):
        length += (other[k] - one[k]) ** 2
    length = np.sqrt(length)
    if length <= step:
        return _outward(place, model, solid_faces, nearest)
    share, along = step / length, 0.0
    for k in range(3):
        along += (place[k] - one[k]) * (other[k] - one[k]) / (length * length)
    if along <= share or along >= 1.0 - share:
        return _outward(place, model, solid_faces, nearest)
    _place_at(along - share, one, other, point)
    a0, a1, a2 = _outward(point, model, solid_faces, nearest)
    _place_at(along + share, one, other, point)
    b0, b1, b2 = _outward(point, model, solid_faces, nearest)
    d0, d1, d2 = other[0] - one[0], other[1] - one[1], other[2] - one[2]
    before = (a0 * d0 + a1 * d1 + a2 * d2) / length
    after = (b0 * d0 + b1 * d1 + b2 * d2) / length
    if before > -1e-9 or after < 1e-9:
        return _outward(place, model, solid_faces, nearest)
    mix = after / (after - before)
    return (
        mix * a0 + (1.0 - mix) * b0,
        mix * a1 + (1.0 - mix) * b1,
        mix * a2 + (1.0 - mix) * b2,
    )
