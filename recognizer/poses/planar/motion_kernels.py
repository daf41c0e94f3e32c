"""Compiled poses of the plane: how they place contacts, and the least-squares fit to edges.

A pose is an angle and the place ``z`` of the object's centroid in the world. It turns a contact
``p`` into ``x = R^T (p - z)``, from the centroid and along the object's axes. A small motion, a
rotation ``w`` and a shift ``s`` about the centroid, changes x by ``-w J x - s``, with J a quarter
turn, and the direction of its normal by ``-w``. Rotations are scaled by the object's radius, so
that all three steps are lengths.

An outline, as the kernels read it, is a tuple: first points of its edges (e, 2), from the centroid;
unit vectors along them (e, 2); lengths (e,); directions of the outward normals (e,), radians; the
radius, half the diameter. Contacts are a tuple: positions (n, 2); directions of the measured
normals (n,), radians; bounds (n,) and (n,).
"""

from __future__ import annotations

import numpy as np

from ...compiling import inlined, kernel
from ...models.planar_kernels import wrap

EXACT = 1e-9
"""How far beyond its bound a reading of a witness may be, as a share of the bound: rounding."""


@inlined
def nearest_on_edge(x, y, edge, outline):
    """From the nearest point of an edge to a point: the vector, and how far along the edge."""
    starts, tangents, lengths = outline[0], outline[1], outline[2]
    a, b = x - starts[edge, 0], y - starts[edge, 1]
    along = a * tangents[edge, 0] + b * tangents[edge, 1]
    share = min(max(along, 0.0), lengths[edge])
    return a - share * tangents[edge, 0], b - share * tangents[edge, 1], along


@kernel
def meets(faces, contacts, outline, angle, place):
    """Whether a pose puts every reading within its bound, but for rounding."""
    points, directions, position_error, normal_error = contacts
    cosine, sine = np.cos(angle), np.sin(angle)
    for i in range(len(points)):
        p0, p1 = points[i, 0] - place[0], points[i, 1] - place[1]
        g0, g1, _ = nearest_on_edge(
            cosine * p0 + sine * p1, cosine * p1 - sine * p0, faces[i], outline
        )
        if np.sqrt(g0 * g0 + g1 * g1) > position_error[i] * (1.0 + EXACT):
            return False
        if normal_error[i] < np.pi:
            off = abs(wrap(directions[i] - angle - outline[3][faces[i]]))
            if off > normal_error[i] * (1.0 + EXACT):
                return False
    return True


@kernel
def _add(row, residual, weight, system, gradient):
    for a in range(3):
        gradient[a] += weight * residual * row[a]
        for b in range(3):
            system[a, b] += weight * row[a] * row[b]


@kernel
def assemble(bounded, faces, contacts, outline, angle, place, system, gradient):
    """Normal equations of the least-squares misfit at one pose; returns the misfit.

    Each contact counts its height above the line of its edge, how far beyond its bound it lies
    past an end of the edge, and the difference of its normal, each by its variance.

    Args:
        bounded: whether lying past an end counts. It holds a fit to the edges, but only from one
            side, so it isn't information about the pose.
        faces: (n,) the edge of each contact.
        contacts: see the module.
        outline: see the module.
        angle: radians.
        place: (2,) the centroid in the world, metres.
        system: (3, 3) written in place.
        gradient: (3,) written in place.
    """
    points, directions, position_error, normal_error = contacts
    tangents, lengths, radius = outline[1], outline[2], outline[4]
    cosine, sine = np.cos(angle), np.sin(angle)
    row = np.empty(3)
    system[:] = 0.0
    gradient[:] = 0.0
    cost = 0.0
    for i in range(len(points)):
        f = faces[i]
        p0, p1 = points[i, 0] - place[0], points[i, 1] - place[1]
        x, y = cosine * p0 + sine * p1, cosine * p1 - sine * p0
        g0, g1, along = nearest_on_edge(x, y, f, outline)
        t0, t1 = tangents[f, 0], tangents[f, 1]
        # A point uniform in a disc has variance bound^2 / 4 along either axis.
        weight = 4.0 / (position_error[i] * position_error[i])
        # The outward normal is the edge's direction turned clockwise: n = (t1, -t0).
        height = t1 * g0 - t0 * g1
        # n . (-w J x) with J x = (-y, x).
        row[0], row[1], row[2] = (t1 * y + t0 * x) / radius, -t1, t0
        _add(row, height, weight, system, gradient)
        cost += weight * height * height
        past = max(-along, along - lengths[f]) - position_error[i]
        if bounded and past > 0.0:
            away = 1.0 if along > 0.0 else -1.0
            row[0], row[1], row[2] = away * (t0 * y - t1 * x) / radius, -away * t0, -away * t1
            _add(row, past, weight, system, gradient)
            cost += weight * past * past
        if normal_error[i] < np.pi:
            # An angle uniform within its bound has variance bound^2 / 3.
            weight = 3.0 / (normal_error[i] * normal_error[i])
            off = wrap(directions[i] - angle - outline[3][f])
            gradient[0] -= weight * off / radius
            system[0, 0] += weight / (radius * radius)
            cost += weight * off * off
    return cost


@kernel
def _solve(system, gradient, damping, step):
    """Solve ``(system + damping) step = -gradient`` for three unknowns by Cholesky."""
    a = np.sqrt(system[0, 0] + damping)
    b = system[1, 0] / a
    c = system[2, 0] / a
    d = np.sqrt(max(system[1, 1] + damping - b * b, 1e-300))
    e = (system[2, 1] - b * c) / d
    f = np.sqrt(max(system[2, 2] + damping - c * c - e * e, 1e-300))
    u = -gradient[0] / a
    v = (-gradient[1] - b * u) / d
    w = (-gradient[2] - c * u - e * v) / f
    step[2] = w / f
    step[1] = (v - e * step[2]) / d
    step[0] = (u - b * step[1] - c * step[2]) / a


@kernel
def move(angle, place, step, radius, new_place):
    """Apply a small motion, rotation times the radius and shift; returns the new angle."""
    cosine, sine = np.cos(angle), np.sin(angle)
    new_place[0] = place[0] + cosine * step[1] - sine * step[2]
    new_place[1] = place[1] + sine * step[1] + cosine * step[2]
    return angle + step[0] / radius


@kernel
def fit(faces, contacts, outline, most, angle, place):
    """Damped Gauss-Newton from a starting pose; ``place`` is moved, the new angle returned.

    The damping holds the pose still along a freedom that no contact bears on, so that it does not
    drift there.

    Args:
        faces: (n,) the edge of each contact.
        contacts: see the module.
        outline: see the module.
        most: the most steps.
        angle: radians.
        place: (2,) the centroid in the world, metres, changed in place.
    """
    radius = outline[4]
    system, trial_system = np.empty((3, 3)), np.empty((3, 3))
    gradient, trial_gradient = np.empty(3), np.empty(3)
    step, trial_place = np.empty(3), np.empty(2)
    finest = 1e-3 * contacts[2].min()
    cost = assemble(True, faces, contacts, outline, angle, place, system, gradient)
    # As if half a diameter were known of every freedom: nothing beside any real bound.
    least = 1.0 / (radius * radius)
    damping = least
    for _ in range(most):
        _solve(system, gradient, damping, step)
        length = np.sqrt(step[0] * step[0] + step[1] * step[1] + step[2] * step[2])
        if length < finest:
            break
        # The linear picture holds for a fraction of a radian only.
        if length > 0.5 * radius:
            step *= 0.5 * radius / length
        trial_angle = move(angle, place, step, radius, trial_place)
        trial = assemble(
            True, faces, contacts, outline, trial_angle, trial_place, trial_system, trial_gradient
        )
        if trial <= cost:
            gain = cost - trial
            angle = trial_angle
            place[:] = trial_place
            system[:] = trial_system
            gradient[:] = trial_gradient
            cost = trial
            damping = max(least, 0.1 * damping)
            if gain < 1e-6 * cost:
                break
        else:
            damping *= 10.0
    return angle
