"""Compiled extents of a pose set: how far any pose within the bounds is from a given one.

About a pose, bounds are inequalities that are linear in a small motion, up to a remainder that is
quadratic in its turn and is given to them as room. What is left is a polytope that holds all poses
of an interpretation near that pose, and linear programs say how far it reaches.
"""

from __future__ import annotations

import numpy as np

from ..compiling import borrowing, kernel
from ..contacts.reading_kernels import UNKNOWN_NORMAL, carry, read, worst_on_pieces
from ..poses.fits.fit_kernels import fit_space
from ..poses.motions.motion_kernels import cross, move, perpendicular, slope_row, to_object
from ..poses.simplex_kernels import simplex_space
from .reach_kernels import all_within, box_of, take_needed

TANGENTS = 8
"""Half-planes about a cone of normals."""
ROWS_OF_ONE = 2 * 3 + TANGENTS
"""Inequalities of a contact, but for one for each corner of its feature's hull."""
WIDEST = 4.0
"""The box that motions are looked at in, in what is allowed."""
HALVINGS = 6
"""Of a step, if a pose at its end breaks a bound."""
WITNESS = 1.0 + 1e-9
"""What a witness's largest reading may be, in bounds."""


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
        contacts: see `pose.kernel_contacts`.
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
                slope_row(direction, arm, radius, first, rows[count])
                limits[count] = room
                count += 1
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
                slope_row(direction, arm, radius, first, rows[count])
                limits[count] = room
                count += 1
        if half_angles[f] > 0.0 or chords[i] >= UNKNOWN_NORMAL or errors[i] >= 0.5 * np.pi:
            continue
        # The measured normal turns to u + u x w; its part across the face's is a sine at most.
        first[0], first[1], first[2] = perpendicular(normals[f, 0], normals[f, 1], normals[f, 2])
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


@kernel
def strain(faces, contacts, model, rotation, translation):
    """The largest reading of a pose, in bounds; arguments as in `finish_kernels.finish`."""
    count = len(faces)
    space = fit_space(count)
    readings, x, u = space.readings, space.x, space.u
    carry(count, contacts[0], contacts[1], rotation, translation, x, u)
    worst = read(count, faces, faces, x, u, model, contacts, readings)
    exact, _ = worst_on_pieces(count, faces, faces, x, model, contacts, readings)
    return max(worst, exact)


@kernel
def look_around(
    interpretations,
    contacts,
    errors,
    model,
    half_angles,
    pose,
    turn,
    axes,
    allowed,
    more_rows,
    more_limits,
):
    """How far the poses of some interpretations reach from a pose, and whether all are near it.

    Args:
        interpretations: (m, n) features.
        contacts: see `pose.kernel_contacts`, as are errors, model and half_angles.
        errors: likewise.
        model: likewise.
        half_angles: likewise.
        pose: (4, 4) object to world.
        turn: the largest rotation that the inequalities hold for, radians.
        axes: (6, 6) directions among the rotations, three, then among the shifts.
        allowed: (2,) the longest rotation (times the radius) and shift, metres.
        more_rows: (k, 6) inequalities that hold beside those of the contacts, ...
        more_limits: (k,) ... and their limits.

    Returns:
        (6, 2) the least and largest step along each axis, infinite if no pose is near; and whether
        all of them are as near as is allowed.
    """
    count, most_corners = interpretations.shape[1], 0
    for f in range(len(half_angles)):
        most_corners = max(most_corners, model[3][f + 1] - model[3][f])
    size = count * (ROWS_OF_ONE + most_corners) + len(more_rows)
    rows, limits, columns = np.empty((size, 6)), np.empty(size), np.empty((7, size))
    space, of_one = simplex_space(size), np.empty((5, 3))
    vectors = (of_one[0], of_one[1], of_one[2], of_one[3], of_one[4])
    x, u = np.empty((count, 3)), np.empty((count, 3))
    rotation, translation = pose[:3, :3].copy(), pose[:3, 3].copy()
    to_object(contacts[0], contacts[1], rotation, translation, x, u)
    widest = np.full(6, WIDEST * allowed.max())
    box, alike, near = np.empty((6, 2)), True, 0
    box[:, 0], box[:, 1] = np.inf, -np.inf
    faces = np.empty(count, np.int64)
    for m in range(len(interpretations)):
        faces[:] = interpretations[m]
        found = contact_rows(
            faces, contacts, errors, model, half_angles, x, u, turn, rows, limits, vectors
        )
        for r in range(len(more_rows)):
            rows[found + r], limits[found + r] = more_rows[r], more_limits[r]
        found = take_needed(rows, limits, found + len(more_rows), -widest, widest, columns)
        one = box_of(axes, columns, found, -widest, widest, space)
        if not np.isfinite(one).all():
            continue  # none of its poses is near: those of a symmetry are
        near += 1
        box[:, 0] = np.minimum(box[:, 0], one[:, 0])
        box[:, 1] = np.maximum(box[:, 1], one[:, 1])
        for part in range(2):
            first = 3 * part
            alike = alike and all_within(
                first,
                axes[first : first + 3, first : first + 3].copy(),
                one[first : first + 3],
                allowed[part],
                columns,
                found,
                -widest,
                widest,
                space,
            )
    if near == 0:
        box[:, 0], box[:, 1] = -np.inf, np.inf
    return box, alike and near > 0


@kernel
def move_within(interpretation, contacts, model, pose, step):
    """Move a pose by a step, or by less of it, to where it meets all bounds of its contacts.

    Args:
        interpretation: (n,) features.
        contacts: see `pose.kernel_contacts`, as is the model.
        model: likewise.
        pose: (4, 4) object to world.
        step: (6,) rotation about the object's centroid, times its radius, and shift.

    Returns:
        (4, 4) the pose, and which share of the step was taken, zero if none.
    """
    faces = interpretation.astype(np.int64)
    rotation, translation = pose[:3, :3].copy(), pose[:3, 3].copy()
    turned, shifted = np.empty((3, 3)), np.empty(3)
    share = 1.0
    for _ in range(HALVINGS):
        move(rotation, translation, share * step, model[5], model[6], turned, shifted)
        if strain(faces, contacts, model, turned, shifted) <= WITNESS:
            moved = np.eye(4)
            moved[:3, :3], moved[:3, 3] = turned, shifted
            return moved, share
        share *= 0.5
    return pose.copy(), 0.0
