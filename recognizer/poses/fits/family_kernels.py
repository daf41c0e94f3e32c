"""Compiled families: poses that span what an interpretation leaves open."""

from __future__ import annotations

import numpy as np

from ...compiling import borrowing, kernel
from ...contacts.reading_kernels import carry, read, worst_on_pieces
from ..motions.motion_kernels import move
from ..proofs.proof_kernels import workspace
from .feasibility_kernels import seek_feasible
from .verdict_kernels import EXACT


@borrowing
def _meets(count, faces, contacts, model, rotation, translation, x, u, readings):
    carry(count, contacts[0], contacts[1], rotation, translation, x, u)
    worst = read(count, faces, faces, x, u, model, contacts, readings)
    exact, _ = worst_on_pieces(count, faces, faces, x, model, contacts, readings)
    return max(worst, exact) <= 1.0 + EXACT


@borrowing
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


@kernel
def span_family(
    faces,
    contacts,
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
        faces: (n,) the feature of each contact, -1 for none.
        contacts: see `pose.kernel_contacts`.
        model: likewise.
        rotation: (3, 3) the first pose.
        translation: (3,) likewise.
        motions: (d, 6) unit small motions (see `motion_kernels`).
        step: length of a step, metres.
        rotations: (k, 3, 3) written in place; k is the most poses.
        translations: (k, 3) likewise.

    Returns:
        How many poses were written.
    """
    count, most, ways = len(faces), len(rotations), len(motions)
    work = workspace(count)
    readings = work[0]
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
            seek_feasible(
                count,
                faces,
                faces,
                contacts,
                model,
                20,
                False,
                turned,
                np.pi,
                turned,
                shifted,
                work,
            )
            # At the family's end it brings it back to where it came from: no new pose.
            moved = _moved(rotations[at], translations[at], turned, shifted, model)
            meets = _meets(count, faces, contacts, model, turned, shifted, x, u, readings)
            if meets and moved > 0.5 * step:
                places[found] = new_place
                rotations[found] = turned
                translations[found] = shifted
                found += 1
        at += 1
    return found
