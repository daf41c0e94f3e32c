"""Compiled families: poses that span what an interpretation leaves open."""

from __future__ import annotations

import numpy as np

from ..compiling import borrowing, kernel
from ..poses.motions.motion_kernels import move
from ..poses.witness_kernels import WITNESS, seek_witness


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
    seeking,
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
        seeking: that nothing else is known, and work space, see `witness_kernels.seek_witness`.

    Returns:
        How many poses were written.
    """
    most, ways = len(rotations), len(motions)
    places = np.zeros((most, ways), np.int64)
    new_place = np.empty(ways, np.int64)
    along = np.empty(6)
    turned = np.empty((3, 3))
    shifted = np.empty(3)
    rotations[0] = rotation
    translations[0] = translation
    nothing, space = seeking
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
            found_one = seek_witness(
                *(faces, faces, contacts, model, nothing, False, turned, shifted, space)
            )
            # At the family's end it brings it back to where it came from: no new pose.
            moved = _moved(rotations[at], translations[at], turned, shifted, model)
            if found_one == WITNESS and moved > 0.5 * step:
                places[found] = new_place
                rotations[found] = turned
                translations[found] = shifted
                found += 1
        at += 1
    return found
