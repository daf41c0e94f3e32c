"""Cells of rotations: what is dropped on the way to fine ones holds no pose within the bounds."""

import numpy as np
import pytest
from helpers.sensing import SMALL, feel, forget_normals, touch_faces
from scipy.spatial.transform import Rotation

from palpate.recognizer import Contacts, Recognizer
from palpate.recognizer.poses.fits.pose import kernel_contacts
from palpate.recognizer.tree.cell_search_kernels import passing_cells
from palpate.recognizer.tree.mask_kernels import pair_readings
from palpate.recognizer.tree.room_kernels import DIRECTIONS, enter, feature_slabs, view_ways

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
    entry = Recognizer([model]).library.solids[0]
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


@pytest.mark.parametrize("name", list(SMALL))
def test_there_is_room_for_the_middle_of_contacts_on_their_true_faces(name: str) -> None:
    model = SMALL[name]
    slabs = feature_slabs(Recognizer([model]).library.solids[0].test.model)
    rng = np.random.default_rng([6, len(name)])
    crowded = 0
    for case in range(20 * EVERY):
        faces = rng.integers(0, model.face_count, rng.integers(2, 7))
        touches = touch_faces(model, rng, faces.tolist())
        contacts = feel(touches, rng, rng.choice([1e-6, 1e-3]), 0.3, at_bounds=case % 2 == 0)
        angle = rng.choice([1e-6, 0.05, 0.3, 1.0, 2.0, 3.1])
        axis = rng.standard_normal(3)
        off = Rotation.from_rotvec(rng.uniform(0.0, angle) * axis / np.linalg.norm(axis))
        rotation = (off * touches.T_world_object.rotation).as_matrix()
        ways = np.empty((len(contacts), len(DIRECTIONS), 2))
        view_ways(contacts.positions, contacts.position_error, rotation, angle, ways)
        open_room = np.tile([-np.inf, np.inf], (len(DIRECTIONS), 1))
        room = open_room.copy()
        assert all(enter(ways[i], slabs[f], room, room) for i, f in enumerate(touches.faces))
        room = open_room.copy()
        others = rng.integers(0, model.face_count, len(faces))
        crowded += not all(enter(ways[i], slabs[f], room, room) for i, f in enumerate(others))
    assert crowded > EVERY


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
        feature_slabs(entry.test.model),
        FINEST,
        MOST,
    )
