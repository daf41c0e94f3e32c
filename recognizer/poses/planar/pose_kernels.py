"""Compiled model test of the plane: from interpretations to poses and verdicts."""

from __future__ import annotations

import numpy as np

from ...compiling import kernel
from ...models.planar_kernels import wrap
from .motion_kernels import assemble, fit, meets, move, nearest_on_edge
from .search_kernels import search_rotations

REJECTED, FEASIBLE, UNDECIDED = 0, 1, 2
"""No pose meets the bounds; one was found that does; neither could be shown in the budget."""
MOST_FIT_STEPS = 20
MOST_DRAWS = 8
"""How often a fit that leaves the bounds is drawn half way back to the pose that meets them."""
MOST_NUDGES = 100


@kernel
def _arms(points):
    """Contacts (n, 2) from their mean, and the mean (2,)."""
    mean = np.zeros(2)
    for i in range(len(points)):
        mean += points[i] / len(points)
    return points - mean, mean


@kernel
def reject(interpretations, contacts, outline, most):
    """Verdicts on interpretations (m, n) alone, as (m,): see `search_rotations`."""
    count = len(contacts[0])
    arms, _ = _arms(contacts[0])
    arcs = np.empty((count + 1 + most, 2))
    marks = np.empty((count + 1 + most, 3), np.bool_)
    witnesses = np.empty((most, 3))
    faces = np.empty(count, np.int64)
    verdicts = np.empty(len(interpretations), np.int8)
    for m in range(len(interpretations)):
        faces[:] = interpretations[m]
        left, found = search_rotations(
            faces, contacts, arms, outline, most, 0.0, arcs, marks, witnesses
        )
        verdicts[m] = REJECTED if left == 0 else FEASIBLE if found else UNDECIDED
    return verdicts


@kernel
def _join(arcs, count):
    """Merge (k, 2) arcs that meet end to end, in place; returns how many are left."""
    order = np.argsort(arcs[:count, 0])
    arcs[:count] = arcs[:count][order]
    joined = 1
    for j in range(1, count):
        if arcs[j, 0] <= arcs[joined - 1, 1]:
            arcs[joined - 1, 1] = max(arcs[j, 1], arcs[joined - 1, 1])
        else:
            arcs[joined] = arcs[j]
            joined += 1
    # The first angle and the last are the same where a search began with the full turn.
    if joined > 1 and arcs[0, 0] + 2.0 * np.pi - arcs[joined - 1, 1] < 1e-12:
        joined -= 1
        arcs[0, 0] = arcs[joined, 0] - 2.0 * np.pi
    return joined


@kernel
def _nearest_witness(witnesses, found, low, high):
    """The witness within an arc that is nearest to its middle; -1 if there is none."""
    best, where = np.inf, -1
    for k in range(found):
        off = abs(wrap(witnesses[k, 0] - 0.5 * (low + high)))
        if off <= 0.5 * (high - low) and off < best:
            best, where = off, k
    return where


@kernel
def _place(angle, y0, y1, mean, place):
    """The centroid's place, where the contacts' mean is at ``y`` in the object's frame."""
    cosine, sine = np.cos(angle), np.sin(angle)
    place[0] = mean[0] - (cosine * y0 - sine * y1)
    place[1] = mean[1] - (sine * y0 + cosine * y1)


@kernel
def _draw_to_fit(faces, contacts, outline, low, high, angle, place):
    """From a pose within the bounds towards the fit as far as they allow; returns the angle."""
    fitted_place = place.copy()
    fitted = fit(faces, contacts, outline, MOST_FIT_STEPS, angle, fitted_place)
    turn, shift = fitted - angle, fitted_place - place
    for _ in range(MOST_DRAWS):
        # Another arc's poses are another row.
        within = low <= angle + turn <= high or high - low > 2.0 * np.pi - 1e-9
        if within and meets(faces, contacts, outline, angle + turn, place + shift):
            place += shift
            return angle + turn
        turn *= 0.5
        shift *= 0.5
    return angle


@kernel
def test_interpretations(interpretations, contacts, outline, most, resolution):
    """Find the poses of each interpretation: one for every arc of rotations it can have.

    Args:
        interpretations: (m, n) an edge for each contact.
        contacts: see `planar_motion_kernels`.
        outline: likewise.
        most: the most rotations to look at, an interpretation.
        resolution: how closely to look for gaps between arcs, radians.

    Returns:
        (k,) the interpretation of each pose, in order; (k, 2) the arc of rotations it stands for;
        (k,) angle; (k, 2) place of the centroid, metres; (k,) least-squares misfit; (k, 3, 3)
        information about small motions (see `planar_motion_kernels`); (k,) whether it meets all
        bounds. An interpretation without any pose is rejected.
    """
    count = len(contacts[0])
    arms, mean = _arms(contacts[0])
    arcs = np.empty((count + 1 + most, 2))
    marks = np.empty((count + 1 + most, 3), np.bool_)
    witnesses = np.empty((most, 3))
    faces = np.empty(count, np.int64)
    place = np.empty(2)
    gradient = np.empty(3)
    room, rows = max(64, len(interpretations)), 0
    sources = np.empty(room, np.int64)
    numbers = np.empty((room, 6))
    informations = np.empty((room, 3, 3))
    proven = np.empty(room, np.bool_)
    for m in range(len(interpretations)):
        faces[:] = interpretations[m]
        left, found = search_rotations(
            faces, contacts, arms, outline, most, resolution, arcs, marks, witnesses
        )
        for j in range(_join(arcs, left) if left else 0):
            low, high = arcs[j, 0], arcs[j, 1]
            where = _nearest_witness(witnesses, found, low, high)
            if where >= 0:
                # Witnesses are at angles of the search, an arc may be a turn before them.
                middle = 0.5 * (low + high)
                angle = middle + wrap(witnesses[where, 0] - middle)
                _place(angle, witnesses[where, 1], witnesses[where, 2], mean, place)
                angle = _draw_to_fit(faces, contacts, outline, low, high, angle, place)
            else:
                angle = 0.5 * (low + high)
                _place(angle, 0.0, 0.0, mean, place)
                angle = fit(faces, contacts, outline, MOST_FIT_STEPS, angle, place)
            if rows == room:
                room *= 2
                sources = np.concatenate((sources, sources))
                numbers = np.concatenate((numbers, numbers))
                informations = np.concatenate((informations, informations))
                proven = np.concatenate((proven, proven))
            system = informations[rows]
            cost = assemble(True, faces, contacts, outline, angle, place, system, gradient)
            assemble(False, faces, contacts, outline, angle, place, system, gradient)
            sources[rows] = m
            numbers[rows, 0], numbers[rows, 1] = low, high
            numbers[rows, 2], numbers[rows, 3] = angle, cost
            numbers[rows, 4:] = place
            proven[rows] = where >= 0 and meets(faces, contacts, outline, angle, place)
            rows += 1
    return (
        sources[:rows],
        numbers[:rows, :2].copy(),
        numbers[:rows, 2].copy(),
        numbers[:rows, 4:].copy(),
        numbers[:rows, 3].copy(),
        informations[:rows],
        proven[:rows],
    )


@kernel
def _nudge(faces, contacts, outline, angle, place):
    """Shift a pose back into the bounds, the worst first: projections onto convex sets.

    Not reaching them proves nothing.
    """
    points, _, reaches, _ = contacts
    cosine, sine = np.cos(angle), np.sin(angle)
    for _ in range(MOST_NUDGES):
        worst, s0, s1 = 0.0, 0.0, 0.0
        for i in range(len(points)):
            p0, p1 = points[i, 0] - place[0], points[i, 1] - place[1]
            g0, g1, _ = nearest_on_edge(
                cosine * p0 + sine * p1, cosine * p1 - sine * p0, faces[i], outline
            )
            distance = np.sqrt(g0 * g0 + g1 * g1)
            # A little more than to the bound itself, which would be reached in the limit only.
            excess = distance - 0.999 * reaches[i]
            if distance > reaches[i] and excess > worst:
                worst = excess
                s0, s1 = g0 * excess / distance, g1 * excess / distance
        if worst == 0.0:
            return
        place[0] += cosine * s0 - sine * s1
        place[1] += sine * s0 + cosine * s1


@kernel
def span_family(faces, contacts, outline, angle, place, motions, step, angles, places):
    """Poses that meet all bounds, a step apart along given motions, spreading from a first one.

    Args:
        faces: (n,) the edge of each contact.
        contacts: see `planar_motion_kernels`.
        outline: likewise.
        angle: of the first pose.
        place: (2,) its centroid, metres.
        motions: (d, 3) unit small motions (see `planar_motion_kernels`).
        step: length of a step, metres.
        angles: (k,) written in place; k is the most poses.
        places: (k, 2) likewise.

    Returns:
        How many poses were written.
    """
    most, ways, radius = len(angles), len(motions), outline[4]
    lattice = np.zeros((most, ways), np.int64)
    node = np.empty(ways, np.int64)
    along = np.empty(3)
    moved = np.empty(2)
    angles[0] = angle
    places[0] = place
    found = 1
    at = 0
    while at < found and found < most:
        # Diagonals too: a narrow family may run between the axes.
        for way in range(3**ways):
            along[:] = 0.0
            rest = way
            for k in range(ways):
                node[k] = lattice[at, k] + rest % 3 - 1
                along += step * (rest % 3 - 1) * motions[k]
                rest //= 3
            known = False
            for k in range(found):
                known |= np.all(lattice[k] == node)
            if known or found == most:
                continue
            turned = move(angles[at], places[at], along, radius, moved)
            # A curved family leaves its tangent: a nudge brings the pose back into the bounds.
            _nudge(faces, contacts, outline, turned, moved)
            # At the family's end it brings it back to where others are: no new pose.
            nearest = np.inf
            for k in range(found):
                turn = radius * (turned - angles[k])
                shift0, shift1 = moved[0] - places[k, 0], moved[1] - places[k, 1]
                nearest = min(nearest, turn * turn + shift0 * shift0 + shift1 * shift1)
            new = nearest > 0.25 * step * step
            if new and meets(faces, contacts, outline, turned, moved):
                lattice[found] = node
                angles[found] = turned
                places[found] = moved
                found += 1
        at += 1
    return found
