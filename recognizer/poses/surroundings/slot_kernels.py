"""Compiled slots: readings that stand for what a pose broke, see `cut_kernels`."""

from __future__ import annotations

import numpy as np

from ...compiling import borrowing, kernel
from ...models.polygon_kernels import nearest_in_polygon
from ..proofs.region_kernels import largest_eigenvalue, remainder, square_root

CUTS = 10
"""Readings that may be added to an interpretation; a case that needs more stays undecided."""
ROUND = 12.0
"""Radius of the ball that stands for the space above a plane, in distances that a corner can go."""
PATH, SUPPORT, APPROACH = 0, 1, 2


@kernel
def cut_levels(solid_faces):
    """What is kept of each cut: kinds, margins, choices left, choices with the ends of their slabs,
    the place cut and how far it can go, and the pose cut with a bound on turns from it."""
    return (
        np.zeros(CUTS, np.int64),
        np.zeros(CUTS),
        np.zeros(CUTS, np.int64),
        np.zeros((CUTS, max(solid_faces, 1)), np.int64),
        np.zeros((CUTS, max(solid_faces, 1), 2)),
        np.zeros((CUTS, 3)),
        np.zeros(CUTS),
        np.zeros((CUTS, 3, 3)),
        np.zeros((CUTS, 3)),
        np.zeros(CUTS),
    )


@borrowing
def span_along(lever, direction, region, root, angle, row):
    """How far a lever's end can go along a direction within a region, from the region's pose."""
    inverse, centre = region[1], region[2]
    a0, a1, a2 = lever[0], lever[1], lever[2]
    d0, d1, d2 = direction[0], direction[1], direction[2]
    row[0], row[1], row[2] = a1 * d2 - a2 * d1, a2 * d0 - a0 * d2, a0 * d1 - a1 * d0
    row[3], row[4], row[5] = d0, d1, d2
    mean, squared = 0.0, 0.0
    for a in range(6):
        mean -= row[a] * centre[a]
        for b in range(6):
            squared += row[a] * inverse[a, b] * row[b]
    return mean + np.sqrt(max(squared, 0.0)) + remainder(lever, direction, root, angle)


@kernel
def farthest_move(lever, region, angle, farthest):
    """How far a lever's end can go at all within a region, metres."""
    inverse, centre = region[1], region[2]
    jacobian = np.zeros((3, 6))
    jacobian[0, 1], jacobian[0, 2] = lever[2], -lever[1]
    jacobian[1, 0], jacobian[1, 2] = -lever[2], lever[0]
    jacobian[2, 0], jacobian[2, 1] = lever[1], -lever[0]
    jacobian[0, 3], jacobian[1, 4], jacobian[2, 5] = 1.0, 1.0, 1.0
    spread = jacobian @ inverse @ jacobian.T
    mean = jacobian @ centre
    length = np.sqrt((lever**2).sum())
    # A turn by t moves the end of a by no more than t^2 |a| / 2 beyond the linear part.
    far = np.sqrt((mean**2).sum()) + np.sqrt(max(largest_eigenvalue(spread), 0.0))
    return min(far + 0.5 * angle * angle * length, farthest)


@borrowing
def held_along(place, direction, row, faces, x, model, reaches, turn):
    """How far a place can go along a direction, as contacts are held to their features.

    Args:
        place: (3,) object frame.
        direction: (3,) unit; zero for how far it can go at all.
        row: how many readings count.
        faces: (n,) the feature of each, -1 for none.
        x: (n, 3) contacts, object frame.
        model: see `cut_kernels.clear_pose`.
        reaches: (n,) bounds on their positions.
        turn: the longest chord that a turn can make of a unit length.
    """
    start, corners = model[3], model[4]
    everywhere = direction[0] == 0.0 and direction[1] == 0.0 and direction[2] == 0.0
    least = np.inf
    for i in range(row):
        f = faces[i]
        if f < 0:
            continue
        most = -np.inf
        for c in range(start[f], start[f + 1]):
            along, squared = 0.0, 0.0
            for k in range(3):
                step = corners[c, k] - x[i, k]
                along += direction[k] * step
                squared += step * step
            most = max(most, np.sqrt(squared) if everywhere else along)
        lever = 0.0
        for k in range(3):
            lever += (place[k] - x[i, k]) ** 2
        # The contact goes to some place of its feature, and the rest turns about it.
        least = min(least, most + reaches[i] + turn * np.sqrt(lever))
    return least


@kernel
def set_slab(slot, face, model, place, low, high, size):
    """Make a slot's feature a square in the middle of a slab over a face's plane."""
    normals, offsets, _, start, corners, _, _, cone_start, cone_normals = model
    m = normals[face].copy()
    middle = 0.5 * (low + high)
    normals[slot] = m
    offsets[slot] = offsets[face] + middle
    cone_normals[cone_start[slot]] = m
    along = 0
    for k in range(1, 3):
        if abs(m[k]) < abs(m[along]):
            along = k
    one = np.zeros(3)
    one[along] = 1.0
    one -= m[along] * m
    one /= np.sqrt((one**2).sum())
    other = np.cross(m, one)
    foot = place + (offsets[slot] - (m * place).sum()) * m
    first = start[slot]
    corners[first] = foot + size * (one + other)
    corners[first + 1] = foot + size * (other - one)
    corners[first + 2] = foot - size * (one + other)
    corners[first + 3] = foot + size * (one - other)


@kernel
def set_point(slot, corner, normal, model):
    """Make a slot's feature a corner."""
    normals, offsets, _, start, corners, _, _, cone_start, cone_normals = model
    normals[slot] = normal
    cone_normals[cone_start[slot]] = normal
    offsets[slot] = (normal * corner).sum()
    corners[start[slot]] = corner


@kernel
def _order_choices(count, choices, ends, place, model):
    """Sort the faces of a cut, the nearest plane last: choices are taken from there."""
    normals, offsets = model[0], model[1]
    for k in range(1, count):
        f, low, high = choices[k], ends[k, 0], ends[k, 1]
        depth = offsets[f] - (normals[f] * place).sum()
        j = k
        while j > 0:
            g = choices[j - 1]
            if offsets[g] - (normals[g] * place).sum() >= depth:
                break
            choices[j], ends[j] = g, ends[j - 1]
            j -= 1
        choices[j], ends[j, 0], ends[j, 1] = f, low, high


@kernel
def list_exits(
    place, clearance, row, faces, farthest, most, solid_faces, contacts, model, work, angle, out
):
    """The faces through which a place of a free path, in the object at this pose, may leave it.

    Wherever the place goes, it goes no farther than the region of poses lets it. If it ends outside
    (or, with a bound below zero, that near to outside), the straight way there crosses a face
    outwards, and ends in front of its plane.

    Args:
        place: (3,) in the object, object frame.
        clearance: how near to the outside it may stay, metres, negative or zero.
        row: how many readings there are.
        faces: (n,) the feature of each, -1 for none.
        farthest: a bound on how far the place can go.
        most: faces from which on no more are looked for.
        solid_faces: how many of the features are faces of the solid.
        contacts: see `cut_kernels.clear_pose`.
        model: likewise.
        work: see `proof_kernels.workspace`; its region is about the pose.
        angle: bounds every turn of the region, radians.
        out: faces (f,), the lowest and the highest it can end over their planes (f, 2), metres.

    Returns:
        How many faces there are, and how far the place can go at all.
    """
    normals, offsets, first, start, corners = model[0], model[1], model[2], model[3], model[4]
    choices, ends = out
    region, root, pivot = work[1], work[2][1], work[5][2]
    lever = place - pivot
    line, near = np.empty(6), np.empty(3)
    x, reaches = work[3][0], contacts[2]
    turn = 2.0 * np.sin(0.5 * angle)
    held = held_along(place, np.zeros(3), row, faces, x, model, reaches, turn)
    away = farthest_move(lever, region, angle, min(farthest, held))
    square_root(region[0], root)
    found = 0
    for f in range(solid_faces):
        height = (normals[f] * place).sum() - offsets[f]
        if height >= 0.0 or height + away < clearance:
            continue
        span = span_along(lever, normals[f], region, root, angle, line)
        if height + span < clearance:
            continue
        held = held_along(place, normals[f], row, faces, x, model, reaches, turn)
        high = height + min(span, held, away)
        if high < clearance:
            continue
        gap = np.inf
        for p in range(first[f], first[f + 1]):
            squared, _, _ = nearest_in_polygon(
                place, normals[f], offsets[f], corners, start[p], start[p + 1], near
            )
            gap = min(gap, squared)
        if np.sqrt(gap) > away - clearance:
            continue
        choices[found] = f
        ends[found, 0] = clearance
        ends[found, 1] = high
        found += 1
        if found == most:
            break
    return found, away


@kernel
def cut_path(level, row, place, found, away, contacts, model, pose, levels):
    """Note a place of a free path in the object as a cut: it leaves through one of some faces.

    Args:
        level: of the cut, with its exits listed.
        row: of the readings, the one that stands for it.
        place: (3,) in the object, object frame.
        found: how many exits there are.
        away: how far the place can go at all, metres.
        contacts: see `cut_kernels.clear_pose`.
        model: likewise.
        pose: the rotation and translation cut.
        levels: see `cut_levels`.
    """
    rotation, translation = pose
    kinds, _, left, choices, ends, places, sizes, _, _, _ = levels
    kinds[level] = PATH
    places[level] = place
    sizes[level] = away
    left[level] = found
    contacts[3][row], contacts[4][row] = 2.0, 1.0
    for k in range(3):
        contacts[0][row, k] = translation[k]
        for i in range(3):
            contacts[0][row, k] += rotation[k, i] * place[i]
    _order_choices(found, choices[level], ends[level], place, model)


@kernel
def cut_support(
    level, row, faces, slot, corner, sign, limit, up, farthest, contacts, model, pose, work, levels
):
    """A corner beyond its limit: it is in a ball that touches the plane, where it can get.

    Arguments as in `cut_path` and `list_exits`, and the slot's feature; the corner (3,), object
    frame; whether it is to be above (1) or below (-1) the limit along ``up`` (3,), metres.
    """
    rotation, translation = pose
    kinds, margins, left, choices, _, _, _, _, _, angles = levels
    turn = 2.0 * np.sin(0.5 * angles[level])
    held = held_along(corner, np.zeros(3), row, faces, work[3][0], model, contacts[2], turn)
    away = farthest_move(corner - work[5][2], work[1], angles[level], min(farthest, held))
    large = ROUND * away
    foot, normal = translation.copy(), np.zeros(3)
    for k in range(3):
        for i in range(3):
            foot[k] += rotation[k, i] * corner[i]
            normal[k] -= sign * rotation[i, k] * up[i]
    contacts[0][row] = foot + (limit - (foot * up).sum() + sign * large) * up
    contacts[3][row], contacts[4][row] = 2.0, 1.0
    # To hold every place above the plane where the corner can get, the ball reaches below it by
    # the sagitta of its arc; in the ball without that the corner is above for certain.
    margins[level] = away * away / (2.0 * large)
    contacts[2][row] = large + margins[level]
    kinds[level] = SUPPORT
    left[level] = 1
    choices[level, 0] = slot
    set_point(slot, corner, normal, model)


@kernel
def cut_approach(level, row, contact, face, direction, least, contacts, levels):
    """A contact seen from behind: its normal is within some angle of where the finger came from.

    Arguments as in `cut_path`, and the contact, its feature, the unit direction (3,) of the
    approach and the least cosine between its opposite and the normal.
    """
    kinds, margins, left, choices = levels[0], levels[1], levels[2], levels[3]
    points, measured, reaches, chords, sines = contacts
    points[row] = points[contact]
    measured[row] = -direction
    reaches[row] = reaches[contact]
    chords[row] = np.sqrt(2.0 - 2.0 * least)
    sines[row] = 1.0
    kinds[level] = APPROACH
    margins[level] = 0.0
    left[level] = 1
    choices[level, 0] = face
