"""Contacts on parallel faces: they are ruled out where, and only where, no direction will do."""

import numpy as np
import pytest
from helpers.sensing import SMALL, exact, feel, forget_normals, touch_faces
from scipy.spatial.transform import Rotation

from palpate.recognizer import Contacts, Recognizer
from palpate.recognizer.poses.fits.pose import kernel_contacts
from palpate.recognizer.poses.proofs.lean_kernels import lean_space, leans

CASES = 400
"""Of a solid."""
DIRECTIONS = 40_000
"""Spread evenly: 0.02 radians from one to the next."""
WIDER = 0.04
"""Radians by which the oracle's bounds are wider, so that it misses nothing between directions."""


def _asked(entry, contacts: Contacts, faces, rotation=None, angle: float = -1.0) -> bool:
    return bool(
        leans(
            len(contacts),
            np.asarray(faces, np.int64),
            kernel_contacts(contacts),
            contacts.normal_error,
            entry.test.model,
            entry.features.half_angles,
            np.eye(3) if rotation is None else rotation,
            angle,
            lean_space(len(contacts)),
        )
    )


def _spread_directions() -> np.ndarray:
    """A Fibonacci spiral over the sphere."""
    step = np.arange(DIRECTIONS) + 0.5
    height, turn = 1.0 - 2.0 * step / DIRECTIONS, np.pi * (1.0 + 5.0**0.5) * step
    across = np.sqrt(1.0 - height**2)
    return np.stack([across * np.cos(turn), across * np.sin(turn), height], axis=1)


def _some_direction(entry, contacts: Contacts, faces, directions, middle, angle, wider) -> bool:
    """The same by trying: bounds widened by so many radians, parallel faces of the first alone."""
    normals, offsets = entry.test.model[0][faces], entry.test.model[1][faces]
    signs = normals @ normals[0]
    group = np.abs(signs) > 0.999
    signs, heights = signs[group], (signs * offsets)[group]
    points, bounds = contacts.positions[group], contacts.position_error[group]
    cosines = directions @ (signs[:, None] * contacts.normals[group]).T
    errors = contacts.normal_error[group]
    good = (np.arccos(np.clip(cosines, -1.0, 1.0)) <= errors + wider).all(axis=1)
    good &= np.arccos(np.clip(directions @ middle, -1.0, 1.0)) <= angle + wider
    spots = directions @ points.T - heights
    slack = wider * np.linalg.norm(points - points.mean(axis=0), axis=1)
    # One height for all: the largest of the lower ends is below the smallest of the upper ones.
    low, high = (spots - bounds - slack).max(axis=1), (spots + bounds + slack).min(axis=1)
    return bool((good & (low <= high)).any())


@pytest.mark.parametrize("name", list(SMALL))
def test_the_true_faces_lean_in_the_true_cell_and_in_any(name: str) -> None:
    model = SMALL[name]
    entry = Recognizer([model]).library.solids[0]
    rng = np.random.default_rng([1, len(name)])
    for case in range(CASES):
        faces = rng.integers(0, model.face_count, rng.integers(2, 9))
        touches = touch_faces(model, rng, faces.tolist())
        bounds = rng.choice([1e-6, 4e-4, 2e-3]), rng.uniform(0.01, 0.6)
        contacts = feel(touches, rng, *bounds, at_bounds=case % 2 == 0)
        if case % 3 == 0:
            contacts = forget_normals(contacts, rng.random(len(contacts)) < 0.5)
        assert _asked(entry, contacts, touches.faces)
        angle = rng.choice([1e-6, 0.02, 0.1, 0.5, 1.5])
        axis = rng.standard_normal(3)
        off = Rotation.from_rotvec(rng.uniform(0.0, angle) * axis / np.linalg.norm(axis))
        middle = (off * touches.T_world_object.rotation).as_matrix()
        assert _asked(entry, contacts, touches.faces, middle, angle * (1.0 + 1e-9))


@pytest.mark.parametrize("name", list(SMALL))
def test_leanings_are_ruled_out_as_by_trying_all_directions(name: str) -> None:
    model = SMALL[name]
    entry = Recognizer([model]).library.solids[0]
    rng = np.random.default_rng([2, len(name)])
    directions = _spread_directions()
    answers = np.zeros((2, 2), int)
    for _ in range(CASES // 4):
        normals = model.normals
        first = normals[rng.integers(model.face_count)]
        parallel = np.flatnonzero(np.abs(normals @ first) > 0.999)
        touched = rng.choice(parallel, rng.integers(2, 7))
        touches = touch_faces(model, rng, touched.tolist())
        contacts = feel(touches, rng, 1e-3, 0.3)
        # Those that were touched, or all but one.
        faces = touched.copy()
        faces[-1] = rng.choice(parallel)
        axis = rng.standard_normal(3)
        off = Rotation.from_rotvec(rng.uniform(0.0, 0.4) * axis / np.linalg.norm(axis))
        rotation = off * touches.T_world_object.rotation
        middle, angle = rotation.as_matrix() @ normals[faces[0]], 0.2
        said = _asked(entry, contacts, faces, rotation.as_matrix(), angle)
        tried = (entry, contacts, faces, directions, middle, angle)
        if not _some_direction(*tried, WIDER):
            assert not said
            answers[0, 0] += 1
        elif _some_direction(*tried, 0.0):
            assert said
            answers[1, 1] += 1
    assert answers[0, 0] > 5
    assert answers[1, 1] > 5


def test_measurements_that_are_exact_and_the_same_rule_nothing_out() -> None:
    model = SMALL["cube"]
    entry = Recognizer([model]).library.solids[0]
    rng = np.random.default_rng(3)
    touches = touch_faces(model, rng, [0, 0, 0, 0])
    tight = exact(touches, 1e-9, 1e-9)
    assert _asked(entry, tight, touches.faces)
    twice = Contacts.join([tight, tight])
    assert _asked(entry, twice, np.concatenate([touches.faces, touches.faces]))
