"""Compiled check of rotations alone: whether any within an angle of one can meet the bounds.

A turn by no more than an angle takes a direction no farther than that angle, so what it makes with
a fixed direction changes by no more. So normals farther from their cones than their bound and that
angle say no; and so do two contacts whose vector, over the plane of either one's feature, reaches
neither low nor high enough to lead from one feature to the other, up to both bounds. The check
costs far less than a verdict, which rejects the same and more.
"""

from __future__ import annotations

import numpy as np

from ...compiling import borrowing, kernel
from ...contacts.reading_kernels import ARC, NO_CONE, UNKNOWN_NORMAL, nearest_in_cone

ROUNDING = 1e-6
"""Angle (radians) put down to rounding: an arc cosine loses half the digits at its ends."""


@kernel
def turn_space(count):
    """Work space of `open_turns`: angles allowed, vectors between contacts, and directions."""
    return np.empty((count, count, 2)), np.empty((count, count, 3)), np.empty(3), np.empty(3)


@borrowing
def _extent(direction, corners, first, last):
    """The least and the most that any corner of a polygon has along a direction."""
    least, most = np.inf, -np.inf
    for c in range(first, last):
        along = direction[0] * corners[c, 0] + direction[1] * corners[c, 1]
        along += direction[2] * corners[c, 2]
        least, most = min(least, along), max(most, along)
    return least, most


@borrowing
def note_turns(count, faces, contacts, model, space):
    """Note what angles the vectors between contacts may make with the normals of their features.

    Args:
        count: how many contacts count.
        faces: (n,) the feature of each contact, -1 for none.
        contacts: see `pose.kernel_contacts`.
        model: likewise.
        space: see `turn_space`, written in place.
    """
    angles, vectors = space[0], space[1]
    points, reaches = contacts[0], contacts[2]
    normals, start, corners = model[0], model[3], model[4]
    for i in range(count):
        f = faces[i]
        if f < 0:
            continue
        m = normals[f]
        low, high = _extent(m, corners, start[f], start[f + 1])
        for j in range(count):
            g = faces[j]
            if g < 0 or j == i:
                continue
            length = 0.0
            for k in range(3):
                vectors[i, j, k] = points[j, k] - points[i, k]
                length += vectors[i, j, k] ** 2
            length = np.sqrt(length)
            angles[i, j, 0], angles[i, j, 1] = 0.0, np.pi
            if length <= reaches[i] + reaches[j]:
                continue
            for k in range(3):
                vectors[i, j, k] /= length
            least, most = _extent(m, corners, start[g], start[g + 1])
            slack = reaches[i] + reaches[j]
            angles[i, j, 0] = np.arccos(min(1.0, max(-1.0, (most - low + slack) / length)))
            angles[i, j, 1] = np.arccos(min(1.0, max(-1.0, (least - high - slack) / length)))


@borrowing
def open_turns(count, faces, contacts, model, rotation, angle, space):
    """Whether a rotation within an angle (radians) of one may meet the bounds, see `note_turns`."""
    allowed, vectors, u, direction = space
    _, measured, _, chords, sines = contacts
    normals, cone_start, cone_normals = model[0], model[7], model[8]
    wide = angle + ROUNDING
    for i in range(count):
        f = faces[i]
        if f < 0 or chords[i] >= UNKNOWN_NORMAL:
            continue
        for k in range(3):
            u[k] = 0.0
            for a in range(3):
                u[k] += rotation[a, k] * measured[i, a]
        kind, miss = nearest_in_cone(u, cone_normals, cone_start[f], cone_start[f + 1], direction)
        if kind == NO_CONE:
            continue
        if kind == ARC:
            if np.arcsin(min(1.0, miss)) > np.arcsin(sines[i]) + wide and sines[i] < 1.0:
                return False
        elif 2.0 * np.arcsin(min(1.0, 0.5 * miss)) > 2.0 * np.arcsin(0.5 * chords[i]) + wide:
            return False
    for i in range(count):
        f = faces[i]
        if f < 0:
            continue
        # The normal, in the world frame.
        for a in range(3):
            u[a] = 0.0
            for k in range(3):
                u[a] += rotation[a, k] * normals[f, k]
        for j in range(count):
            if faces[j] < 0 or j == i or (allowed[i, j, 0] <= 0.0 and allowed[i, j, 1] >= np.pi):
                continue
            along = u[0] * vectors[i, j, 0] + u[1] * vectors[i, j, 1] + u[2] * vectors[i, j, 2]
            between = np.arccos(min(1.0, max(-1.0, along)))
            if between + wide < allowed[i, j, 0] or between - wide > allowed[i, j, 1]:
                return False
    return True
