"""Compiled least squares: the pose that fits normals, plane offsets and face bounds jointly."""

from __future__ import annotations

import numpy as np
from numba import njit

from .motion_kernels import add_row, cross, move, slope_row, solve, to_object
from .polygon_kernels import INSIDE, nearest_in_polygon


@njit(cache=True)
def assemble_fit(bounded, x, u, faces, contacts, model, system, gradient):
    """Normal equations of the least-squares misfit at one pose; returns the misfit.

    Each contact counts its height above the plane of its face, how far beyond its bound it lies
    outside the face's hull, and the difference of its normal, each by its variance.

    Args:
        bounded: whether lying outside a face counts. It holds a fit to the faces, but only from
            one side, so it isn't information about the pose.
        x: (n, 3) contacts, object frame.
        u: (n, 3) measured normals, object frame.
        faces: (n,) the face of each contact.
        contacts: positions, normals, position bounds, normal bounds; world frame.
        model: see `pose_kernels.test_interpretations`.
        system: (6, 6) lower triangle written in place.
        gradient: (6,) written in place.
    """
    _, _, position_error, normal_error = contacts
    normals, offsets, _, start, corners, centre, radius = model
    row = np.empty(6)
    arm = np.empty(3)
    turn = np.empty(3)
    nearest = np.empty(3)
    direction = np.empty(3)
    system[:] = 0.0
    gradient[:] = 0.0
    cost = 0.0
    for i in range(len(x)):
        f = faces[i]
        m = normals[f]
        squared, height, region = nearest_in_polygon(
            x[i], m, offsets[f], corners, start[f], start[f + 1], nearest
        )
        bound = position_error[i]
        # A point uniform in a ball has variance bound^2 / 5 along any axis.
        weight = 5.0 / (bound * bound)
        for k in range(3):
            arm[k] = x[i, k] - centre[k]
        slope_row(m, arm, radius, turn, row)
        add_row(row, height, weight, system, gradient)
        cost += weight * height * height
        if bounded and region != INSIDE:
            outside = np.sqrt(squared - height * height)
            if outside > bound:
                for k in range(3):
                    direction[k] = (x[i, k] - height * m[k] - nearest[k]) / outside
                slope_row(direction, arm, radius, turn, row)
                excess = outside - bound
                add_row(row, excess, weight, system, gradient)
                cost += weight * excess * excess
        bound = normal_error[i]
        if bound >= np.pi:
            continue
        # A direction uniform in a narrow cone has variance bound^2 / 4 about either axis.
        weight = 4.0 / (bound * bound)
        cross(u[i], m, turn)
        for a in range(3):
            gradient[a] += weight * turn[a] / radius
            cost += weight * (u[i, a] - m[a]) ** 2
            system[a, a] += weight / (radius * radius)
            for b in range(a + 1):
                system[a, b] -= weight * u[i, a] * u[i, b] / (radius * radius)
    return cost


@njit(cache=True)
def fit_pose(faces, contacts, model, most, rotation, translation):
    """Damped Gauss-Newton from a starting pose, in place; returns the misfit.

    The damping holds the pose still along a freedom that no contact bears on, so that it does not
    drift there.

    Args:
        faces: (n,) the face of each contact.
        contacts: positions, normals, position bounds, normal bounds; world frame.
        model: see `pose_kernels.test_interpretations`.
        most: the most steps.
        rotation: (3, 3) object to world.
        translation: (3,) object to world, metres.
    """
    points, normals, position_error, _ = contacts
    centre, radius = model[5], model[6]
    count = len(points)
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
    finest = 1e-3 * position_error.min()
    to_object(points, normals, rotation, translation, x, u)
    cost = assemble_fit(True, x, u, faces, contacts, model, system, gradient)
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
        to_object(points, normals, trial_rotation, trial_translation, x, u)
        trial = assemble_fit(True, x, u, faces, contacts, model, trial_system, trial_gradient)
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
