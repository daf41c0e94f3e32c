"""Compiled best fits: the pose nearest to the least squares among those within all bounds."""

from __future__ import annotations

import numpy as np

from ...compiling import borrowing, kernel
from ...contacts.reading_kernels import carry, meets_all, read
from ..motions.motion_kernels import move, turn_between
from .fit_kernels import assemble_fit, fit_pose

FIT_STEPS = 20
HALVINGS = 7
"""Of the way from a witness to a best fit that is none."""
EXACT = 1e-9
"""By how much a witness may exceed a bound, as a share of it: rounding."""


@borrowing
def _is_witness(count, faces, contacts, model, rotation, translation, space):
    """Whether a pose is within all bounds, on concave faces as they are."""
    x, u, spare = space.x, space.u, space.vectors[3]
    carry(count, contacts[0], contacts[1], rotation, translation, x, u)
    return meets_all(count, faces, x, u, model, contacts, EXACT, spare)


@kernel
def finish(count, faces, contacts, model, rotation, translation, space, information):
    """Move a witness to the best fit, or as far towards it as stays within the bounds, in place.

    Returns:
        The misfit of that pose, of which the information is written in place.
    """
    step, trial_shift, shifted = np.empty(6), np.empty(3), np.empty(3)
    fitted, trial = np.empty((3, 3)), np.empty((3, 3))
    centre, radius = model[5], model[6]
    fitted[:] = rotation
    shifted[:] = translation
    fit_pose(count, faces, contacts, model, FIT_STEPS, fitted, shifted, space)
    if _is_witness(count, faces, contacts, model, fitted, shifted, space):
        rotation[:] = fitted
        translation[:] = shifted
    else:
        # Where a witness was found says nothing; what is nearest to the best fit does.
        turn_between(rotation, fitted, step)
        for k in range(3):
            step[k] *= radius
            step[3 + k] = 0.0
            for a in range(3):
                away = shifted[a] - translation[a]
                for b in range(3):
                    away += (fitted[a, b] - rotation[a, b]) * centre[b]
                step[3 + k] += rotation[a, k] * away
        for _ in range(HALVINGS):
            for a in range(6):
                step[a] *= 0.5
            move(rotation, translation, step, centre, radius, trial, trial_shift)
            if _is_witness(count, faces, contacts, model, trial, trial_shift, space):
                rotation[:] = trial
                translation[:] = trial_shift
    return weigh(count, faces, contacts, model, rotation, translation, space, information)


@kernel
def weigh(count, faces, contacts, model, rotation, translation, space, information):
    """The least-squares misfit of a pose, and its information about small motions, in place."""
    readings, x, u, vectors = space.readings, space.x, space.u, space.vectors
    system, gradient = np.empty((6, 6)), np.empty(6)
    carry(count, contacts[0], contacts[1], rotation, translation, x, u)
    read(count, faces, faces, x, u, model, contacts, readings)
    cost = assemble_fit(
        True, count, faces, x, u, model, contacts, readings, system, gradient, vectors
    )
    assemble_fit(False, count, faces, x, u, model, contacts, readings, system, gradient, vectors)
    for a in range(6):
        for b in range(6):
            information[a, b] = system[max(a, b), min(a, b)]
    return cost
