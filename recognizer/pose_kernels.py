"""Compiled model test: from interpretations to poses and verdicts."""

from __future__ import annotations

import numpy as np
from numba import njit

from .branch_kernels import (
    FEASIBLE,
    REJECTED,
    UNDECIDED,
    align,
    middle_translation,
    rotation_at,
    search_poses,
)
from .feasibility_kernels import EXACT, seek_feasible, worst_excess
from .fit_kernels import assemble_fit, fit_pose
from .motion_kernels import move, to_object

MOST_FIT_STEPS = 20
ROUNDING = 1e-6
"""Misfit of normals, in squared bounds, that is put down to rounding."""
VAGUE = 0.6
"""Spread (radians) of a rotation from which the normals don't fix it."""


@njit(cache=True)
def _meets(faces, contacts, model, rotation, translation, x, u):
    points, measured, reaches, chords = contacts
    to_object(points, measured, rotation, translation, x, u)
    worst, _ = worst_excess(x, u, faces, faces, reaches, chords, model, True)
    return worst


@njit(cache=True)
def test_interpretations(
    interpretations,
    points,
    measured,
    position_error,
    normal_error,
    model,
    middles,
    most_boxes,
    pool,
    pass_vague,
):
    """Fit a pose to each interpretation and test whether its bounds can be met.

    Args:
        interpretations: (m, n) a face for each contact.
        points: (n, 3) positions, world frame, metres.
        measured: (n, 3) normals, world frame.
        position_error: (n,) bounds, metres.
        normal_error: (n,) bounds, radians.
        model: face normals (f, 3); plane offsets (f,); (f + 1,) the first convex piece of each
            face; (p + 1,) the first corner of each polygon, of which the first f are the faces'
            hulls and the rest their pieces; corners (c, 3); centroid (3,); radius. Object frame.
        middles: (f, 3) a point inside each face's hull.
        most_boxes: the most boxes of rotations to look at, an interpretation.
        pool: the most boxes in all; once it is empty, what no fit settles stays undecided.
        pass_vague: leave interpretations whose normals don't fix the rotation undecided at once.
            They are what the search is slowest on, and more contacts soon settle them.

    Returns:
        (m,) verdicts, (m, 3, 3) rotations, (m, 3) translations, (m,) least-squares misfits, and
        (m, 6, 6) information about small motions (see `motion_kernels`).
    """
    size = len(interpretations)
    count = len(points)
    contacts = (points, measured, position_error, normal_error)
    bounds = (points, measured, position_error, 2.0 * np.sin(0.5 * normal_error))
    verdicts = np.empty(size, np.int8)
    rotations = np.zeros((size, 3, 3))
    translations = np.zeros((size, 3))
    costs = np.zeros(size)
    informations = np.zeros((size, 6, 6))
    values = np.empty(4)
    vectors = np.empty((4, 4))
    best = np.zeros(3)
    rotation = np.empty((3, 3))
    translation = np.empty(3)
    fitted = np.empty((3, 3))
    shifted = np.empty(3)
    system = np.empty((6, 6))
    gradient = np.empty(6)
    x = np.empty((count, 3))
    u = np.empty((count, 3))
    faces = np.empty(count, np.int64)
    for m in range(size):
        faces[:] = interpretations[m]
        verdicts[m] = REJECTED
        slack, spread = align(faces, bounds, model, values, vectors)
        if slack < -ROUNDING:
            continue
        if pass_vague and spread > VAGUE:
            verdicts[m] = UNDECIDED
            continue
        # Never zero: the search divides by the size of the set of rotations this leaves.
        slack = max(slack, 0.0) + ROUNDING
        rotation_at(best, vectors, rotation)
        middle_translation(faces, points, middles, rotation, translation)
        fit_pose(faces, contacts, model, MOST_FIT_STEPS, rotation, translation)
        worst = _meets(faces, bounds, model, rotation, translation, x, u)
        if worst > EXACT and seek_feasible(faces, faces, bounds, model, 60, rotation, translation):
            worst = _meets(faces, bounds, model, rotation, translation, x, u)
        if worst <= EXACT:
            verdicts[m] = FEASIBLE
        else:
            verdicts[m], looked = search_poses(
                slack,
                values,
                vectors,
                faces,
                bounds,
                model,
                middles,
                min(most_boxes, pool),
                rotation,
                translation,
            )
            pool -= looked
            if verdicts[m] == REJECTED:
                continue
            # A better pose than just any witness: the fit nearest to it, if that is one too.
            fitted[:] = rotation
            shifted[:] = translation
            fit_pose(faces, contacts, model, MOST_FIT_STEPS, fitted, shifted)
            if verdicts[m] == UNDECIDED or (
                _meets(faces, bounds, model, fitted, shifted, x, u) <= EXACT
            ):
                rotation[:] = fitted
                translation[:] = shifted
        to_object(points, measured, rotation, translation, x, u)
        costs[m] = assemble_fit(True, x, u, faces, contacts, model, system, gradient)
        assemble_fit(False, x, u, faces, contacts, model, system, gradient)
        rotations[m] = rotation
        translations[m] = translation
        for a in range(6):
            for b in range(6):
                informations[m, a, b] = system[max(a, b), min(a, b)]
    return verdicts, rotations, translations, costs, informations


@njit(cache=True)
def _moved(rotation, translation, new_rotation, new_translation, model):
    """How far a motion took the object: shift of its centroid and turn times its radius, metres."""
    centre, radius = model[5], model[6]
    shift = 0.0
    turn = 0.0
    for i in range(3):
        step = new_translation[i] - translation[i]
        for k in range(3):
            step += (new_rotation[i, k] - rotation[i, k]) * centre[k]
            turn += (new_rotation[i, k] - rotation[i, k]) ** 2
        shift += step * step
    # The Frobenius norm of the difference of two rotations is about sqrt(2) times the angle.
    return np.sqrt(shift + 0.5 * turn * radius * radius)


@njit(cache=True)
def span_family(
    faces,
    points,
    measured,
    position_error,
    normal_error,
    model,
    rotation,
    translation,
    motions,
    step,
    rotations,
    translations,
):
    """Poses that meet all bounds, a step apart along given motions, spreading from a first one.

    Args:
        faces: (n,) the face of each contact.
        points: (n, 3) positions, world frame, metres.
        measured: (n, 3) normals, world frame.
        position_error: (n,) bounds, metres.
        normal_error: (n,) bounds, radians.
        model: see `test_interpretations`.
        rotation: (3, 3) the first pose.
        translation: (3,) likewise.
        motions: (d, 6) unit small motions (see `motion_kernels`).
        step: length of a step, metres.
        rotations: (k, 3, 3) written in place; k is the most poses.
        translations: (k, 3) likewise.

    Returns:
        How many poses were written.
    """
    count, most, ways = len(points), len(rotations), len(motions)
    bounds = (points, measured, position_error, 2.0 * np.sin(0.5 * normal_error))
    places = np.zeros((most, ways), np.int64)
    new_place = np.empty(ways, np.int64)
    along = np.empty(6)
    turned = np.empty((3, 3))
    shifted = np.empty(3)
    x = np.empty((count, 3))
    u = np.empty((count, 3))
    rotations[0] = rotation
    translations[0] = translation
    found = 1
    at = 0
    while at < found and found < most:
        # Diagonals too: a narrow family may run between the axes.
        for way in range(3**ways):
            along[:] = 0.0
            rest = way
            for k in range(ways):
                new_place[k] = places[at, k] + rest % 3 - 1
                along += step * (rest % 3 - 1) * motions[k]
                rest //= 3
            known = False
            for k in range(found):
                known |= np.all(places[k] == new_place)
            if known or found == most:
                continue
            move(
                rotations[at],
                translations[at],
                along,
                model[5],
                model[6],
                turned,
                shifted,
            )
            # A curved family leaves its tangent: a nudge brings the pose back into the bounds.
            seek_feasible(faces, faces, bounds, model, 20, turned, shifted)
            # At the family's end it brings it back to where it came from: no new pose.
            moved = _moved(rotations[at], translations[at], turned, shifted, model)
            meets = _meets(faces, bounds, model, turned, shifted, x, u) <= EXACT
            if meets and moved > 0.5 * step:
                places[found] = new_place
                rotations[found] = turned
                translations[found] = shifted
                found += 1
        at += 1
    return found
