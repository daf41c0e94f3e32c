"""Branches rejected whole, and rotations refused by normals and vectors between contacts alone.

Against plain numpy, truths that no search may reject, and the model test of every interpretation.
"""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from helpers.sensing import (
    CUBE,
    HOLED,
    L_BLOCK,
    Touches,
    feel,
    forget_normals,
    touch_faces,
    touch_features,
)
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from palpate.recognizer import Contacts, Polyhedron, Recognizer
from palpate.recognizer.models.features import all_features
from palpate.recognizer.poses.fits.pose import ModelTest, kernel_contacts
from palpate.recognizer.poses.fits.search_pose_kernels import box_stack
from palpate.recognizer.poses.fits.verdict_kernels import REJECTED
from palpate.recognizer.poses.proofs.proof_kernels import workspace
from palpate.recognizer.poses.proofs.turn_kernels import note_turns, open_turns, turn_space
from palpate.recognizer.poses.search.backjump_kernels import (
    FIRST,
    due_branch,
    note_boxes,
    note_witness,
    open_branch,
    search_branch,
)

Floats = NDArray[np.float64]

MODELS = [CUBE, L_BLOCK, HOLED]
TESTS = [ModelTest(model, all_features(model)) for model in MODELS]


def draw_contacts(rng: np.random.Generator, which: int) -> tuple[Touches, Contacts]:
    """Contacts on anything of a model, noise in their bounds or on them, some without normals."""
    touches = touch_features(MODELS[which], TESTS[which].features, rng, int(rng.integers(3, 8)))
    bounds = float(rng.choice([3e-4, 3e-3])), float(rng.choice([0.02, 0.4, 1.0, 2.0]))
    contacts = feel(touches, rng, *bounds, at_bounds=rng.random() < 0.5)
    return touches, forget_normals(contacts, rng.random(len(touches)) < rng.choice([0.0, 0.4]))


def is_open(test: ModelTest, faces: NDArray[np.int64], contacts: Contacts, R: Floats, angle: float):
    """Whether `open_turns` leaves the rotations within an angle of one."""
    count, read, space = len(faces), kernel_contacts(contacts), turn_space(len(faces))
    note_turns(count, faces, read, test.model, space)
    return open_turns(count, faces, read, test.model, R, angle, space)


@pytest.mark.parametrize("which", range(3))
def test_no_rotation_near_enough_to_the_true_one_is_refused(which: int) -> None:
    rng = np.random.default_rng(which)
    for _ in range(300):
        touches, contacts = draw_contacts(rng, which)
        axis, angle = rng.normal(size=3), float(rng.choice([0.0, 0.05, 0.5, 2.0]))
        off = Rotation.from_rotvec(angle / np.linalg.norm(axis) * axis)
        R = (touches.T_world_object.rotation * off).as_matrix()
        assert is_open(TESTS[which], touches.faces.astype(np.int64), contacts, R, angle)


def plainly_open(model: Polyhedron, faces: list[int], contacts: Contacts, R: Floats, angle: float):
    """The margins of the same on faces, radians: none is below zero."""
    margins = []
    for i, f in enumerate(faces):
        m = R @ model.normals[f]
        if contacts.normal_error[i] < np.pi:
            off = np.arccos(np.clip(contacts.normals[i] @ m, -1.0, 1.0))
            margins.append(contacts.normal_error[i] + angle - off)
        for j, g in enumerate(faces):
            between = contacts.positions[j] - contacts.positions[i]
            length = np.linalg.norm(between)
            slack = contacts.position_error[i] + contacts.position_error[j]
            if i == j or length <= slack:
                continue
            on = model.vertices[np.unique(model.triangles[model.triangle_faces == g])]
            heights = (on - model.vertices[model.triangles[model.triangle_faces == f][0, 0]]) @ (
                model.normals[f]
            )
            now = np.arccos(np.clip(between @ m / length, -1.0, 1.0))
            ends = np.clip(
                [(heights.max() + slack) / length, (heights.min() - slack) / length], -1, 1
            )
            least, most = np.arccos(ends)
            margins += [now + angle - least, most + angle - now]
    return np.array(margins)


def test_what_is_refused_is_what_plain_numpy_refuses() -> None:
    rng = np.random.default_rng(5)
    refused = 0
    for trial in range(600):
        model, test = MODELS[trial % 3], TESTS[trial % 3]
        faces = rng.integers(model.face_count, size=4).tolist()
        contacts = feel(touch_faces(model, rng, faces), rng, 1e-3, float(rng.choice([0.2, 0.8])))
        contacts = forget_normals(contacts, rng.random(4) < 0.5)
        R, angle = Rotation.random(rng=rng).as_matrix(), float(rng.uniform(0.0, 1.5))
        margins = plainly_open(model, faces, contacts, R, angle)
        if np.abs(margins).min() < 1e-5:
            continue
        opened = is_open(test, np.array(faces, np.int64), contacts, R, angle)
        assert opened == (margins.min() > 0.0)
        refused += not opened
    assert refused > 100


@pytest.mark.parametrize("which", range(3))
def test_no_branch_that_the_truth_is_on_is_rejected(which: int) -> None:
    rng, test = np.random.default_rng(10 + which), TESTS[which]
    for _ in range(60):
        touches, contacts = draw_contacts(rng, which)
        count, faces = len(touches), touches.faces.astype(np.int64)
        faces[rng.random(count) < 0.2] = -1
        faces[0] = touches.faces[0]
        axis, angle = rng.normal(size=3), float(rng.choice([0.1, 0.5]))
        off = Rotation.from_rotvec((1.0 - 1e-9) * angle / np.linalg.norm(axis) * axis)
        held = (touches.T_world_object.rotation * off).as_matrix()
        for cell in ((np.eye(3), -1.0), (held, angle)):
            for depth in range(1, count + 1):
                verdict, _ = search_branch(
                    depth,
                    faces,
                    kernel_contacts(contacts),
                    test.model,
                    test.features.half_angles,
                    test.middles,
                    cell,
                    200,
                    np.empty((3, 3)),
                    np.empty(3),
                    workspace(count),
                    box_stack(count),
                )
                assert verdict != REJECTED


def test_a_branch_is_due_once_its_leaves_have_taken_enough_and_never_after_a_witness() -> None:
    spent, due = np.zeros(7), np.zeros(7)
    for depth in range(7):
        open_branch(depth, spent, due)
    note_boxes(6, int(FIRST), spent)
    assert due_branch(0, 6, spent, due) == 3
    note_witness(4, due)
    assert due_branch(0, 6, spent, due) == 5
    open_branch(5, spent, due)
    assert due_branch(0, 6, spent, due) == -1


@pytest.mark.parametrize("seed", range(3))
def test_a_search_with_backjumps_keeps_what_the_model_test_of_each_interpretation_keeps(
    seed: int,
) -> None:
    # Two parallel sides and a right angle to neither: the rotation is open, and leaves are dear.
    rng, model = np.random.default_rng(20 + seed), L_BLOCK
    opposite = [
        f for f in range(model.face_count) if abs(model.normals[f] @ model.normals[0]) > 0.9
    ]
    faces = rng.choice(opposite, 4).tolist()
    contacts = feel(touch_faces(model, rng, faces), rng, 5e-4, 0.4)
    everything = np.array(list(product(range(model.face_count), repeat=4)), np.int32)
    kept = ModelTest(model, pool=10**7).run(everything, contacts)
    belief = Recognizer([model]).recognize(contacts)
    found = np.concatenate([h.interpretations for h in belief.hypotheses])
    assert kept.proven.all()
    assert all(h.proven for h in belief.hypotheses)
    assert sorted(map(tuple, found.tolist())) == sorted(map(tuple, kept.faces.tolist()))
