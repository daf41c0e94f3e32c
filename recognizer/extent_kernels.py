"""Compiled extents of a pose set: how far any pose within the bounds is from a given one.

About a pose, bounds are inequalities that are linear in a small motion, up to a remainder that is
quadratic in its turn and is given to them as room. What is left is a polytope that holds all poses
of an interpretation near that pose, and linear programs say how far it reaches.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from .compiling import borrowing
from .motion_kernels import cross
from .proof_kernels import workspace
from .reading_kernels import UNKNOWN_NORMAL, carry, read, worst_on_pieces

TANGENTS = 8
"""Half-planes about a cone of normals."""
ROWS_OF_ONE = 2 * 3 + TANGENTS
"""Inequalities of a contact, but for one for each corner of its feature's hull."""
PIVOTS = 60
"""The most; the bound of a program that needs more is the one it has by then."""
CUTS = 24
"""Planes that are cut off the shadow of a polytope; one that takes more counts as too long."""
MOST_CORNERS = 256
EXACT = 1e-9
"""By how much a vertex may break an inequality, as a share of the box it is sought in."""


@borrowing
def _hold(direction, room, arm, radius, rows, limits, count):
    """Add that a contact moves by no more than ``room`` along a direction of the object's frame."""
    # It moves by -w x arm - s; rotations are scaled by the radius.
    rows[count, 0] = -(arm[1] * direction[2] - arm[2] * direction[1]) / radius
    rows[count, 1] = -(arm[2] * direction[0] - arm[0] * direction[2]) / radius
    rows[count, 2] = -(arm[0] * direction[1] - arm[1] * direction[0]) / radius
    for k in range(3):
        rows[count, 3 + k] = -direction[k]
    limits[count] = room
    return count + 1


@borrowing
def _along(direction, x):
    return direction[0] * x[0] + direction[1] * x[1] + direction[2] * x[2]


@borrowing
def contact_rows(faces, contacts, errors, model, half_angles, x, u, turn, rows, limits, space):
    """Inequalities ``rows @ step <= limits`` on small motions of the object, in place.

    A motion is a rotation about the object's centroid, times its radius, and a shift. Every pose
    within the bounds, not farther than ``turn`` from the pose in rotation, satisfies them: with the
    turn ``T`` and the shift read in the turned frame, a contact goes to ``T^T (x - c) + c - s``,
    which is at most ``|x - c| turn^2 / 2`` from ``x - w x (x - c) - s``.

    Args:
        faces: (n,) the feature of each contact, -1 for none.
        contacts: see `search_kernels.search_model`.
        errors: likewise.
        model: likewise.
        half_angles: likewise.
        x: (n, 3) contacts, object frame, metres.
        u: (n, 3) measured normals, object frame.
        turn: radians.
        rows: (m, 6); limits: (m,).
        space: five (3,) arrays.

    Returns:
        How many inequalities there are.
    """
    normals, start, corners, centre, radius = model[0], model[3], model[4], model[5], model[6]
    _, _, reaches, chords, _ = contacts
    arm, direction, side, first, second = space
    count = 0
    for i in range(len(faces)):
        f = faces[i]
        if f < 0:
            continue
        for k in range(3):
            arm[k] = x[i, k] - centre[k]
        margin = reaches[i] + 0.5 * turn * turn * np.sqrt(_along(arm, arm))
        size = start[f + 1] - start[f]
        flat = half_angles[f] == 0.0 and size > 2
        for axis in range(1 if flat else 3):
            for sign in (-1.0, 1.0):
                for k in range(3):
                    direction[k] = sign * (normals[f, k] if flat else 1.0 * (k == axis))
                most = -np.inf
                for c in range(start[f], start[f + 1]):
                    most = max(most, _along(direction, corners[c]))
                room = most + margin - _along(direction, x[i])
                count = _hold(direction, room, arm, radius, rows, limits, count)
        if flat:
            for c in range(start[f], start[f + 1]):
                after = c + 1 if c + 1 < start[f + 1] else start[f]
                for k in range(3):
                    side[k] = corners[after, k] - corners[c, k]
                cross(side, normals[f], direction)
                length = np.sqrt(_along(direction, direction))
                most = -np.inf
                for k in range(3):
                    direction[k] /= length
                for other in range(start[f], start[f + 1]):
                    most = max(most, _along(direction, corners[other]))
                room = most + margin - _along(direction, x[i])
                count = _hold(direction, room, arm, radius, rows, limits, count)
        if half_angles[f] > 0.0 or chords[i] >= UNKNOWN_NORMAL or errors[i] >= 0.5 * np.pi:
            continue
        # The measured normal turns to u + u x w; its part across the face's is a sine at most.
        least = 0
        for k in range(1, 3):
            if abs(normals[f, k]) < abs(normals[f, least]):
                least = k
        for k in range(3):
            side[k] = 1.0 * (k == least)
        cross(normals[f], side, first)
        length = np.sqrt(_along(first, first))
        for k in range(3):
            first[k] /= length
        cross(normals[f], first, second)
        for tangent in range(TANGENTS):
            angle = 2.0 * np.pi * tangent / TANGENTS
            for k in range(3):
                direction[k] = np.cos(angle) * first[k] + np.sin(angle) * second[k]
            # direction . (u x w) = (direction x u) . w
            cross(direction, u[i], side)
            for k in range(3):
                rows[count, k] = side[k] / radius
                rows[count, 3 + k] = 0.0
            limits[count] = np.sin(errors[i]) + 0.5 * turn * turn - _along(direction, u[i])
            count += 1
    return count


@borrowing
def farthest(objective, rows, limits, count, most, space):
    """How far a polytope reaches along a direction, by the dual simplex method.

    The bound is one by weak duality at every step, so that it holds whenever the method stops.

    Args:
        objective: (6,) the direction.
        rows: (m, 6) of the inequalities, of which ``count`` count.
        limits: (m,) likewise.
        count: how many.
        most: no step along an axis is longer, metres.
        space: active rows (6,), the inverse of their matrix (6, 6), multipliers (6,), a vertex
            (6,), a row's multipliers (6,).

    Returns:
        The reach, metres; minus infinity if the polytope is empty.
    """
    active, inverse, multipliers, vertex, shares = space
    # The box's own rows are count + 2 k for -e_k and count + 2 k + 1 for e_k.
    for k in range(6):
        positive = objective[k] >= 0.0
        active[k] = count + 2 * k + (1 if positive else 0)
        for j in range(6):
            inverse[k, j] = 0.0
        inverse[k, k] = 1.0 if positive else -1.0
        multipliers[k] = abs(objective[k])
    bound = 0.0
    for _ in range(PIVOTS):
        bound = 0.0
        for j in range(6):
            limit = most if active[j] >= count else limits[active[j]]
            bound += max(multipliers[j], 0.0) * limit
            for k in range(6):
                if j == 0:
                    vertex[k] = 0.0
                vertex[k] += inverse[k, j] * limit
        entering, worst = -1, EXACT * most
        for r in range(count):
            excess = -limits[r]
            for k in range(6):
                excess += rows[r, k] * vertex[k]
            if excess > worst:
                entering, worst = r, excess
        for k in range(6):
            if abs(vertex[k]) - most > worst:
                entering = count + 2 * k + (1 if vertex[k] > 0.0 else 0)
                worst = abs(vertex[k]) - most
        if entering < 0:
            return bound
        leaving, ratio = -1, np.inf
        for j in range(6):
            shares[j] = 0.0
            for k in range(6):
                if entering >= count:
                    unit = 1.0 if (entering - count) & 1 else -1.0
                    entry = unit if (entering - count) >> 1 == k else 0.0
                else:
                    entry = rows[entering, k]
                shares[j] += entry * inverse[k, j]
            if shares[j] > 1e-9 and multipliers[j] < ratio * shares[j]:
                leaving, ratio = j, multipliers[j] / shares[j]
        if leaving < 0:
            return -np.inf
        for j in range(6):
            multipliers[j] = ratio if j == leaving else multipliers[j] - ratio * shares[j]
        for k in range(6):
            inverse[k, leaving] /= shares[leaving]
        for j in range(6):
            if j != leaving:
                for k in range(6):
                    inverse[k, j] -= shares[j] * inverse[k, leaving]
        active[leaving] = entering
    return bound


@njit(cache=True)
def simplex_space():
    """Work space for `farthest`."""
    return np.empty(6, np.int64), np.empty((6, 6)), np.empty(6), np.empty(6), np.empty(6)


@njit(cache=True)
def box_of(axes, rows, limits, count, most, space):
    """How far a polytope reaches along directions, there and back.

    Args:
        axes: (k, 6) unit directions.
        rows: see `farthest`, as are the others.
        limits: likewise.
        count: likewise.
        most: likewise.
        space: likewise.

    Returns:
        (k, 2) the least and the largest step along each.
    """
    objective = np.empty(6)
    found = np.empty((len(axes), 2))
    for a in range(len(axes)):
        for side in range(2):
            sign = 2.0 * side - 1.0
            for k in range(6):
                objective[k] = sign * axes[a, k]
            found[a, side] = sign * farthest(objective, rows, limits, count, most, space)
    return found


@borrowing
def _cut(planes, heights, number, corners, height):
    """Cut corners off a polyhedron with a new plane, which is planes[number - 1]; how many stay.

    Corners of a solid in three dimensions, of which the first three planes' are not kept track:
    those on the new plane are met by trying all pairs of the others with it.
    """
    new = number - 1
    kept = 0
    for c in range(height):
        along = 0.0
        for k in range(3):
            along += planes[new, k] * corners[c, k]
        if along <= heights[new]:
            for k in range(3):
                corners[kept, k] = corners[c, k]
            kept += 1
    a0, a1, a2 = planes[new, 0], planes[new, 1], planes[new, 2]
    for i in range(new):
        b0, b1, b2 = planes[i, 0], planes[i, 1], planes[i, 2]
        x, y, z = a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0
        for j in range(i):
            c0, c1, c2 = planes[j, 0], planes[j, 1], planes[j, 2]
            volume = x * c0 + y * c1 + z * c2
            if abs(volume) < 1e-9:
                continue
            # Cramer's rule, by vector products of the three planes.
            p0, p1, p2 = b1 * c2 - b2 * c1, b2 * c0 - b0 * c2, b0 * c1 - b1 * c0
            q0, q1, q2 = c1 * a2 - c2 * a1, c2 * a0 - c0 * a2, c0 * a1 - c1 * a0
            u = (heights[new] * p0 + heights[i] * q0 + heights[j] * x) / volume
            v = (heights[new] * p1 + heights[i] * q1 + heights[j] * y) / volume
            w = (heights[new] * p2 + heights[i] * q2 + heights[j] * z) / volume
            inside = True
            for k in range(new):
                if k in (i, j):
                    continue
                over = planes[k, 0] * u + planes[k, 1] * v + planes[k, 2] * w - heights[k]
                if over > 1e-9 * abs(heights[k]):
                    inside = False
                    break
            if inside and kept < len(corners):
                corners[kept, 0], corners[kept, 1], corners[kept, 2] = u, v, w
                kept += 1
    return kept


@njit(cache=True)
def all_within(first, axes, box, allowed, rows, limits, count, most, space):
    """Whether three of the six motions together are nowhere longer in a polytope than is allowed.

    The largest length of a convex set's points is sought from outside: its shadow on the three
    motions is held in a polyhedron, whose farthest corner says where to cut next (H. Tuy's outer
    approximation of a convex maximum). Each cut is a linear program: either it reaches beyond what
    is allowed, or it takes that corner away.

    Args:
        first: 0 for rotations, 3 for shifts.
        axes: (3, 3) orthonormal directions among them.
        box: (3, 2) how far the polytope reaches along these.
        allowed: metres.
        rows: see `farthest`, as are the others.
        limits: likewise.
        count: likewise.
        most: likewise.
        space: likewise.
    """
    for a in range(3):
        if max(-box[a, 0], box[a, 1]) > allowed:
            return False
    planes, heights = np.empty((6 + CUTS, 3)), np.empty(6 + CUTS)
    corners, objective = np.empty((MOST_CORNERS, 3)), np.zeros(6)
    number = 0
    for a in range(3):
        for side in range(2):
            sign = 2.0 * side - 1.0
            for k in range(3):
                planes[number, k] = sign * axes[a, k]
            heights[number] = sign * box[a, side]
            number += 1
    height = 0
    for corner in range(8):
        for k in range(3):
            corners[height, k] = 0.0
            for a in range(3):
                corners[height, k] += axes[a, k] * box[a, (corner >> a) & 1]
        height += 1
    for _ in range(CUTS):
        longest, where = -1.0, -1
        for c in range(height):
            length = 0.0
            for k in range(3):
                length += corners[c, k] * corners[c, k]
            if length > longest:
                longest, where = length, c
        longest = np.sqrt(max(longest, 0.0))
        if longest <= allowed:
            return True
        for k in range(3):
            planes[number, k] = corners[where, k] / longest
            objective[first + k] = planes[number, k]
        heights[number] = farthest(objective, rows, limits, count, most, space)
        if heights[number] > allowed:
            return False
        number += 1
        height = _cut(planes, heights, number, corners, height)
        if height == len(corners):
            return False
    return False


@njit(cache=True)
def strain(faces, contacts, model, rotation, translation):
    """The largest reading of a pose, in bounds; arguments as in `pose_kernels.settle`."""
    count = len(faces)
    work = workspace(count)
    readings, x, u = work[0], work[3][0], work[3][1]
    carry(count, contacts[0], contacts[1], rotation, translation, x, u)
    worst = read(count, faces, faces, x, u, model, contacts, readings)
    exact, _ = worst_on_pieces(count, faces, faces, x, model, contacts, readings)
    return max(worst, exact)
