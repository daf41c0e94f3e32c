"""Compiled model test: from an interpretation to a pose within all bounds, or a proof of none."""

from __future__ import annotations

import numpy as np

from ...compiling import borrowing, kernel
from ...contacts.reading_kernels import carry, meets_all, read
from ..motions.align_kernels import align, middle_translation
from ..motions.motion_kernels import move
from ..proofs.proof_kernels import locate, workspace
from ..proofs.region_kernels import turn_between
from .fit_kernels import assemble_fit, fit_pose
from .search_pose_kernels import box_stack, search_poses
from .verdict_kernels import BESIDE, EXACT, FEASIBLE, REJECTED, judge

LEAF_STEPS = 2
"""Steps of the first verdict; linear programs and boxes settle what it leaves open, and sooner."""
FIT_STEPS = 20
HALVINGS = 7
"""Of the way from a witness to a best fit that is none."""


@borrowing
def _is_witness(count, faces, contacts, model, rotation, translation, work):
    """Whether a pose is within all bounds, on concave faces as they are."""
    x, u, spare = work[3][0], work[3][1], work[8][2][3]
    carry(count, contacts[0], contacts[1], rotation, translation, x, u)
    return meets_all(count, faces, x, u, model, contacts, EXACT, spare)


@kernel
def finish(count, faces, contacts, model, rotation, translation, work, information):
    """Move a witness to the best fit, or as far towards it as stays within the bounds, in place.

    Returns:
        The misfit of that pose, of which the information is written in place.
    """
    _, step, trial_shift, shifted = work[5]
    fitted, trial = work[6]
    centre, radius = model[5], model[6]
    fitted[:] = rotation
    shifted[:] = translation
    fit_pose(count, faces, contacts, model, FIT_STEPS, fitted, shifted, work)
    if _is_witness(count, faces, contacts, model, fitted, shifted, work):
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
            if _is_witness(count, faces, contacts, model, trial, trial_shift, work):
                rotation[:] = trial
                translation[:] = trial_shift
    return weigh(count, faces, contacts, model, rotation, translation, work, information)


@borrowing
def weigh(count, faces, contacts, model, rotation, translation, work, information):
    """The least-squares misfit of a pose, and its information about small motions, in place."""
    readings, rows = work[0], work[3]
    x, u = rows[0], rows[1]
    system, gradient = work[4][0], work[5][0]
    carry(count, contacts[0], contacts[1], rotation, translation, x, u)
    read(count, faces, faces, x, u, model, contacts, readings)
    space = work[8][2]
    cost = assemble_fit(
        True, count, faces, x, u, model, contacts, readings, system, gradient, space
    )
    assemble_fit(False, count, faces, x, u, model, contacts, readings, system, gradient, space)
    for a in range(6):
        for b in range(6):
            information[a, b] = system[max(a, b), min(a, b)]
    return cost


@kernel
def start_pose(count, faces, contacts, model, half_angles, middles, rotation, translation):
    """The pose that the normals ask for; returns the same angle as `align_kernels.align`."""
    angle = align(count, faces, model, half_angles, contacts, rotation)
    middle_translation(count, faces, contacts[0], middles, rotation, translation)
    return angle


@borrowing
def settle(count, faces, contacts, model, ball, angle, most, rotation, translation, work, stack):
    """Judge an interpretation as far as a budget of boxes allows.

    Args:
        count: how many contacts count.
        faces: (n,) the feature of each contact, -1 for none.
        contacts: see `pose.kernel_contacts`.
        model: likewise.
        ball: (3, 3) a rotation, near the starting one, that none within the bounds is farther from
            than ...
        angle: ... this angle, radians. A smaller ball that comes to light replaces it in place.
        most: the most boxes to look at.
        rotation: (3, 3) object to world, moved in place.
        translation: (3,) likewise.
        work: see `proof_kernels.workspace`.
        stack: see `search_pose_kernels.box_stack`.

    Returns:
        REJECTED, FEASIBLE or UNDECIDED, and how many boxes were looked at.
    """
    verdict, angle, _, _ = judge(
        count,
        faces,
        faces,
        contacts,
        model,
        ball,
        angle,
        LEAF_STEPS,
        False,
        rotation,
        translation,
        work,
    )
    if verdict in (REJECTED, FEASIBLE):
        return verdict, 0
    if verdict == BESIDE:
        locate(count, faces, faces, model, contacts, rotation, ball, angle, work)
    # The ball is not about the pose that the verdict left.
    angle = min(np.pi, angle + turn_between(ball, rotation, work[5][3]))
    return search_poses(
        count, faces, contacts, model, angle, most, rotation, translation, work, stack
    )


@kernel
def test_interpretations(interpretations, contacts, model, half_angles, middles, most_boxes, pool):
    """Judge interpretations one by one.

    Args:
        interpretations: (m, n) a feature for each contact, -1 for none.
        contacts: see `pose.kernel_contacts`.
        model: likewise.
        half_angles: likewise.
        middles: likewise.
        most_boxes: the most boxes of rotations to look at, an interpretation.
        pool: the same for all together; once it is empty, what no fit settles stays undecided.

    Returns:
        (m,) verdicts, (m, 3, 3) rotations, (m, 3) translations, (m,) least-squares misfits, and
        (m, 6, 6) information about small motions (see `motion_kernels`).
    """
    size, count = interpretations.shape
    verdicts = np.empty(size, np.int8)
    rotations = np.zeros((size, 3, 3))
    translations = np.zeros((size, 3))
    costs = np.zeros(size)
    informations = np.zeros((size, 6, 6))
    work = workspace(count)
    stack = box_stack(count)
    faces = np.empty(count, np.int64)
    rotation, translation, ball = np.empty((3, 3)), np.empty(3), np.empty((3, 3))
    for m in range(size):
        faces[:] = interpretations[m]
        verdicts[m] = REJECTED
        angle = start_pose(
            count, faces, contacts, model, half_angles, middles, rotation, translation
        )
        if angle < 0.0:
            continue
        ball[:] = rotation
        verdicts[m], looked = settle(
            count,
            faces,
            contacts,
            model,
            ball,
            angle,
            min(most_boxes, pool),
            rotation,
            translation,
            work,
            stack,
        )
        pool -= looked
        if verdicts[m] == REJECTED:
            continue
        costs[m] = finish(
            count, faces, contacts, model, rotation, translation, work, informations[m]
        )
        rotations[m] = rotation
        translations[m] = translation
    return verdicts, rotations, translations, costs, informations
