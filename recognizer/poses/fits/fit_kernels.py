"""Compiled least squares: the pose that fits normals, plane offsets and face bounds jointly."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...compiling import borrowing, kernel
from ...contacts.reading_kernels import ARC, NO_CONE, carry, read
from ...models.polygon_kernels import CORNER, INSIDE
from ..motions.motion_kernels import add_row, move, slope_row, solve


class FitSpace(NamedTuple):
    """Work space of a fit to n contacts."""

    readings: Any
    """See `reading_kernels.read`."""
    x: NDArray[np.float64]
    """(n, 3) contacts in the object's frame, ..."""
    u: NDArray[np.float64]
    """... (n, 3) and their normals."""
    vectors: tuple[NDArray[np.float64], ...]
    """(6,) and four of (3,)."""


@kernel
def fit_space(count):
    """Work space of a fit to so many contacts."""
    readings = (
        np.empty((count, 3)),
        np.empty(count),
        np.empty(count),
        np.zeros(count, np.int64),
        np.zeros(count, np.int64),
        np.zeros(count),
        np.zeros((count, 3)),
    )
    vectors = (np.empty(6), np.empty(3), np.empty(3), np.empty(3), np.empty(3))
    return FitSpace(readings, np.empty((count, 3)), np.empty((count, 3)), vectors)


@borrowing
def _along_edge(corners, first, along):
    """The unit vector from an edge's first corner to its second, into the head of ``along``."""
    square = 0.0
    for k in range(3):
        along[k] = corners[first + 1, k] - corners[first, k]
        square += along[k] * along[k]
    for k in range(3):
        along[k] /= np.sqrt(square)


@borrowing
def assemble_fit(bounded, count, faces, x, u, model, contacts, readings, system, gradient, vectors):
    """Normal equations of the least-squares misfit at one pose; returns the misfit.

    Each contact counts its height above the plane of its face, how far beyond its bound it lies
    outside the face's hull, and the difference of its normal, each by its variance. On an edge or
    a vertex every distance counts.

    Args:
        bounded: whether lying outside a face, or beyond the end of an edge, counts. It holds a fit
            to them, but only from one side, so it isn't information about the pose.
        count: how many contacts count.
        faces: (n,) the feature of each contact, -1 for none.
        x: (n, 3) contacts, object frame.
        u: (n, 3) measured normals, object frame.
        model: see `pose.KernelModel`.
        contacts: likewise.
        readings: see `reading_kernels.read`, which must have run.
        system: (6, 6) lower triangle written in place.
        gradient: (6,) written in place.
        vectors: of `FitSpace`.
    """
    normals, start, centre, radius = model[0], model[3], model[5], model[6]
    _, _, reaches, chords, sines = contacts
    gaps, lengths, heights, regions, kinds, misses, directions = readings
    corners = model[4]
    row, along, turn, arm, direction = vectors
    system[:] = 0.0
    gradient[:] = 0.0
    cost = 0.0
    for i in range(count):
        f = faces[i]
        if f < 0:
            continue
        m = normals[f]
        bound = reaches[i]
        # A point uniform in a ball has variance bound^2 / 5 along any axis.
        weight = 5.0 / (bound * bound)
        for k in range(3):
            arm[k] = x[i, k] - centre[k]
        height = heights[i]
        solid = start[f + 1] - start[f] > 2
        if solid or regions[i] != CORNER:
            slope_row(m, arm, radius, turn, row)
            add_row(row, height, weight, system, gradient)
            cost += weight * height * height
        if not solid and regions[i] == CORNER:
            cost += weight * lengths[i] * lengths[i]
            one_sided = not bounded and start[f + 1] - start[f] == 2
            if one_sided:
                _along_edge(corners, start[f], along)
            for k in range(3):
                direction[:] = 0.0
                direction[k] = 1.0
                gap = gaps[i, k]
                if one_sided:
                    for a in range(3):
                        direction[a] -= along[k] * along[a]
                        gap -= along[k] * along[a] * gaps[i, a]
                slope_row(direction, arm, radius, turn, row)
                add_row(row, gap, weight, system, gradient)
        elif regions[i] != INSIDE and (bounded or not solid):
            squared = lengths[i] * lengths[i] - height * height
            outside = np.sqrt(max(squared, 0.0))
            excess = outside - bound if solid else outside
            if outside > 0.0 and excess > 0.0:
                for k in range(3):
                    direction[k] = (gaps[i, k] - height * m[k]) / outside
                slope_row(direction, arm, radius, turn, row)
                add_row(row, excess, weight, system, gradient)
                cost += weight * excess * excess
        if kinds[i] == NO_CONE:
            continue
        bound = sines[i] if kinds[i] == ARC else chords[i]
        # A direction uniform in a narrow cone has variance bound^2 / 4 about either axis.
        weight = 4.0 / (bound * bound)
        miss = misses[i]
        cost += weight * miss * miss
        e0, e1, e2 = directions[i, 0], directions[i, 1], directions[i, 2]
        u0, u1, u2 = u[i, 0], u[i, 1], u[i, 2]
        turn[0], turn[1], turn[2] = e1 * u2 - e2 * u1, e2 * u0 - e0 * u2, e0 * u1 - e1 * u0
        for a in range(3):
            gradient[a] += weight * miss * turn[a] / radius
            for b in range(a + 1):
                if kinds[i] == ARC:
                    system[a, b] += weight * turn[a] * turn[b] / (radius * radius)
                else:
                    system[a, b] -= weight * u[i, a] * u[i, b] / (radius * radius)
            if kinds[i] != ARC:
                system[a, a] += weight / (radius * radius)
    return cost


@kernel
def fit_pose(count, faces, contacts, model, most, rotation, translation, space):
    """Damped Gauss-Newton from a starting pose, in place; returns the misfit.

    The damping holds the pose still along a freedom that no contact bears on, so that it does not
    drift there.

    Args:
        count: how many contacts count.
        faces: (n,) the feature of each contact, -1 for none.
        contacts: see `pose.kernel_contacts`.
        model: likewise.
        most: the most steps.
        rotation: (3, 3) object to world.
        translation: (3,) object to world, metres.
        space: see `FitSpace`.
    """
    readings, vectors = space.readings, space.vectors
    points, normals, reaches = contacts[0], contacts[1], contacts[2]
    centre, radius = model[5], model[6]
    x = np.empty((count, 3))
    u = np.empty((count, 3))
    system = np.empty((6, 6))
    gradient = np.empty(6)
    trial_system = np.empty((6, 6))
    trial_gradient = np.empty(6)
    factor = np.zeros((6, 6))
    step = np.empty(6)
    trial_rotation = np.empty((3, 3))
    trial_translation = np.empty(3)
    finest = 1e-3 * reaches.min()
    carry(count, points, normals, rotation, translation, x, u)
    read(count, faces, faces, x, u, model, contacts, readings)
    cost = assemble_fit(
        True, count, faces, x, u, model, contacts, readings, system, gradient, vectors
    )
    # As if half a diameter were known of every freedom: nothing beside any real bound.
    least = 1.0 / (radius * radius)
    damping = least
    for _ in range(most):
        solve(system, gradient, damping, factor, step)
        length = 0.0
        for a in range(6):
            length += step[a] * step[a]
        length = np.sqrt(length)
        if length < finest:
            break
        # The linear picture holds for a fraction of a radian only.
        if length > 0.5 * radius:
            for a in range(6):
                step[a] *= 0.5 * radius / length
        move(rotation, translation, step, centre, radius, trial_rotation, trial_translation)
        carry(count, points, normals, trial_rotation, trial_translation, x, u)
        read(count, faces, faces, x, u, model, contacts, readings)
        trial = assemble_fit(
            *(True, count, faces, x, u, model, contacts, readings, trial_system, trial_gradient),
            vectors,
        )
        if trial <= cost:
            gain = cost - trial
            rotation[:] = trial_rotation
            translation[:] = trial_translation
            system[:] = trial_system
            gradient[:] = trial_gradient
            cost = trial
            damping = max(least, 0.1 * damping)
            if gain < 1e-6 * cost:
                break
        else:
            damping *= 10.0
    return cost
