"""Cells of rotations: what is dropped on the way to fine ones holds no pose within the bounds."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from sensing import SMALL, feel, forget_normals, touch_faces

from palpate.recognizer import Contacts, Recognizer
from palpate.recognizer.cell_search_kernels import passing_cells
from palpate.recognizer.mask_kernels import pair_readings
from palpate.recognizer.pose import kernel_contacts

FINEST = 0.2
MOST = 200_000
EVERY = 25
"""Cases of a solid."""


@pytest.mark.parametrize("known", [False, True], ids=["no-normals", "some-normals"])
@pytest.mark.parametrize("name", list(SMALL))
def test_some_cell_holds_the_true_rotation_with_the_true_face_of_the_first_contact(
    name: str, known: bool
) -> None:
    model = SMALL[name]
    entry = Recognizer([model])._solids[0]
    rng = np.random.default_rng([5, len(name), known])
    dropped = 0
    for _ in range(EVERY):
        faces = rng.integers(0, model.face_count, rng.integers(3, 7))
        touches = touch_faces(model, rng, faces.tolist())
        contacts = feel(touches, rng, 4e-4, 0.3)
        forgotten = rng.random(len(contacts)) < 0.5 if known else np.ones(len(contacts), bool)
        contacts = forget_normals(contacts, forgotten)
        rotations, angles, firsts = _cells(entry, contacts)
        off = (touches.T_world_object.rotation.inv() * Rotation.from_matrix(rotations)).magnitude()
        face = int(touches.faces[0])
        has = (firsts[:, face >> 6] >> np.uint64(face & 63)) & np.uint64(1) == 1
        # A cell is a cube in the ball of its angle: of those around the truth one is its own.
        assert ((off <= angles) & has).any()
        dropped += int((~has).sum())
    assert dropped > 0


def _cells(entry, contacts: Contacts):
    """As a search of all features of the solid asks for them."""
    readings = np.empty((len(contacts), len(contacts), 9))
    pair_readings(kernel_contacts(contacts), contacts.normal_error, readings)
    return passing_cells(
        kernel_contacts(contacts),
        contacts.normal_error,
        entry.test.model,
        entry.features.half_angles,
        entry.packed,
        entry.by_kind[contacts.kinds],
        0,
        Recognizer([entry.model]).constraints.bits,
        readings,
        FINEST,
        MOST,
    )
