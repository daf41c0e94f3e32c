"""What a pose of the model test is: where contacts have it, and on no face that they are off."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.fitting import Fitter
from helpers.sensing import (
    HOLED,
    INCH,
    L_BLOCK,
    SMALL,
    Touches,
    exact,
    feel,
    move,
    sense_grid,
    touch_faces,
)
from helpers.witnesses import BAR, FLANKS, centroid_and_turn_errors, face_with_normal, witness_of
from numpy.typing import NDArray
from oracles.checker import check
from oracles.samples import STAND_INS, direction
from oracles.solids import random_pose
from scipy.spatial.transform import RigidTransform, Rotation

from palpate.assets import STAND_IN_NAMES
from palpate.recognizer import Contacts, PairTables, Polyhedron
from palpate.recognizer.beliefs.extent_kernels import strain
from palpate.recognizer.poses.fits.finish_kernels import finish, weigh
from palpate.recognizer.poses.fits.fit_kernels import fit_pose, fit_space
from palpate.recognizer.poses.fits.pose import kernel_contacts
from palpate.recognizer.poses.motions.motion_kernels import turn_between
from palpate.recognizer.tree.tree import prune


@pytest.mark.parametrize("name", STAND_IN_NAMES)
def test_moving_the_contacts_moves_the_poses(name: str) -> None:
    model, rng = STAND_INS[name], np.random.default_rng(12)
    test, tables = Fitter(model), PairTables.of(model)
    compared = 0
    for _ in range(12):
        touches = sense_grid(model, rng)
        contacts = feel(touches, rng, 0.02 * INCH, np.pi / 12)
        motion = random_pose(rng)
        moved = move(motion, contacts)
        candidates = prune(tables, contacts, budget=200).faces
        before, after = test.run(candidates, contacts), test.run(candidates, moved)
        np.testing.assert_array_equal(before.faces, after.faces)
        for row in range(len(before)):
            if np.linalg.eigvalsh(before.informations[row])[0] < 1.0 / 0.003**2:
                continue  # not determined: any witness will do
            if after.costs[row] != pytest.approx(before.costs[row], rel=1e-8):
                continue  # the best fit breaks a bound: the way towards it ended elsewhere
            expected = motion * witness_of(before, row)
            shift, turn = centroid_and_turn_errors(model, witness_of(after, row), expected)
            assert shift < 1e-6
            assert turn < 1e-5
            compared += 1
    assert compared >= 6


@pytest.mark.parametrize("model", [*SMALL.values(), *STAND_INS.values()], ids=lambda m: m.name)
def test_exact_contacts_on_all_faces_give_the_pose_back(model: Polyhedron) -> None:
    rng, test = np.random.default_rng(13), Fitter(model)
    for _ in range(3):
        touches = touch_faces(model, rng, list(range(model.face_count)))
        poses = test.run(touches.faces[None], exact(touches, 1e-6, 1e-3))
        assert poses.proven.all()
        shift, turn = centroid_and_turn_errors(model, witness_of(poses, 0), touches.T_world_object)
        assert shift < 1e-9
        assert turn < 1e-8
        assert poses.costs[0] < 1e-3  # a thousandth of a bound, here and there, is left


def test_the_fit_does_not_drift_along_a_free_direction() -> None:
    test, rng, proven = Fitter(BAR), np.random.default_rng(14), 0
    for case in range(60):
        faces = rng.choice(FLANKS, size=8).tolist()
        touches = touch_faces(BAR, rng, faces)
        contacts = feel(touches, rng, 0.001, np.pi / 8, at_bounds=case % 3 == 0)
        poses = test.run(touches.faces[None], contacts)
        if poses.proven.all():
            assert check(BAR, witness_of(poses, 0), contacts, touches.faces).passed
            proven += 1
    assert proven > 57


def test_the_fit_brings_a_pose_back_that_slid_off_its_faces() -> None:
    touches = touch_faces(BAR, np.random.default_rng(25), FLANKS * 10)
    contacts = exact(touches, 0.001, 0.1)
    for slide in (-0.1, 0.05, 0.2):
        start = touches.T_world_object * RigidTransform.from_translation([slide, 0.0, 0.0])
        rotation, translation = start.rotation.as_matrix(), start.translation.copy()
        fit_pose(
            len(contacts),
            touches.faces.astype(np.int64),
            kernel_contacts(contacts),
            Fitter(BAR).entry.kernel.model,
            20,
            rotation,
            translation,
            fit_space(len(contacts)),
        )
        end = RigidTransform.from_components(translation, Rotation.from_matrix(rotation))
        assert not check(BAR, start, contacts, touches.faces).passed
        assert check(BAR, end, contacts, touches.faces, tolerance=0.05).passed


def test_a_witness_ends_nearest_to_the_best_fit_wherever_it_was_found() -> None:
    rng, before, after = np.random.default_rng(12), [], []
    for case in range(300):
        model = list(SMALL.values())[case % len(SMALL)]
        test = Fitter(model)
        touches = touch_faces(model, rng, rng.integers(0, model.face_count, 10).tolist())
        contacts = feel(touches, rng, 1e-3, 0.2)
        kernel, faces = kernel_contacts(contacts), touches.faces.astype(np.int64)
        work, information = fit_space(len(contacts)), np.empty((6, 6))
        (shared,) = test.run(touches.faces[None], contacts).costs
        rotation = touches.T_world_object.rotation.as_matrix()
        translation = np.array(touches.T_world_object.translation)
        # The truth is a witness; the best fit often is none.
        question = (
            len(contacts),
            faces,
            kernel,
            test.entry.kernel.model,
            rotation,
            translation,
            work,
        )
        found = weigh(*question, information)
        cost = finish(*question, information)
        assert cost <= found * (1.0 + 1e-9)
        assert strain(faces, kernel, test.entry.kernel.model, rotation, translation) <= 1.0 + 1e-8
        before.append(found - shared)
        after.append(cost - shared)
    assert np.mean(np.abs(after)) < 0.5 * np.mean(np.abs(before))


def test_two_contacts_farther_apart_than_a_face_is_long_are_not_both_on_it() -> None:
    top = face_with_normal(BAR, (0, 0, 1))
    faces = np.array([[top, top]], np.int32)
    for length, kept in ((0.25, 1), (0.3, 1), (0.305, 0)):
        contacts = Contacts(
            [[0, 0, 0], [length, 0, 0]], [[0, 0, 1]] * 2, position_error=0.001, normal_error=0.1
        )
        # The face's diagonal is 0.30067; both bounds add to it.
        assert Fitter(BAR).run(faces, contacts).proven.sum() == kept


@pytest.mark.parametrize(("u", "kept"), [(0.04, 0), (0.0215, 0), (0.0205, 1), (0.01, 1)])
def test_a_contact_in_the_hole_of_a_face_is_not_on_that_face(u: float, kept: int) -> None:
    top = face_with_normal(HOLED, (0, 0, 1))
    sides = [face_with_normal(HOLED, s) for s in ((1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0))]
    # Of the two faces that look along each axis, take the outer one.
    outer = []
    for face in sides:
        alike = np.flatnonzero(HOLED.normals @ HOLED.normals[face] > 0.999)
        outer.append(int(alike[np.argmax(HOLED.offsets[alike])]))
    touches = touch_faces(HOLED, np.random.default_rng(15), [*outer, *outer, top, top, top])
    points = touches.T_world_object.inv().apply(touches.points)
    points = np.vstack([points, [[u, 0.03, 0.025]]])
    faces = np.append(touches.faces, top).astype(np.int32)
    for seed in range(3):
        pose = random_pose(np.random.default_rng(seed))
        again = Touches(pose, pose.apply(points), pose.rotation.apply(HOLED.normals[faces]), faces)
        contacts = exact(again, position_error=5e-4)
        assert len(Fitter(HOLED).run(faces[None], contacts)) == kept


def test_a_contact_in_the_notch_of_a_concave_face_is_not_on_that_face() -> None:
    top = face_with_normal(L_BLOCK, (0, 0, 1))
    hull = L_BLOCK.hulls.corners[L_BLOCK.hulls.start[top] : L_BLOCK.hulls.start[top + 1]]
    notch = np.array([0.027, 0.027, 0.03])
    ahead = np.roll(hull, -1, axis=0) - hull
    assert ((np.cross(ahead, notch - hull) @ [0, 0, 1]) > 0.0).all()  # inside the hull
    others = [face for face in range(8) if face != top]
    touches = touch_faces(L_BLOCK, np.random.default_rng(16), others * 2, RigidTransform.identity())
    faces = np.append(touches.faces, top).astype(np.int32)
    for point, kept in ((notch, 0), (np.array([0.027, 0.01, 0.03]), 1)):
        again = Touches(
            touches.T_world_object,
            np.vstack([touches.points, point]),
            L_BLOCK.normals[faces],
            faces,
        )
        assert len(Fitter(L_BLOCK).run(faces[None], exact(again, 5e-4))) == kept


def test_the_information_is_that_of_small_motions() -> None:
    # Against the second difference of a misfit written down anew.
    rng, model = np.random.default_rng(17), L_BLOCK
    touches = touch_faces(model, rng, [0, 1, 2, 3, 4, 5, 6, 7])
    contacts = exact(touches, 1e-3, 0.2)
    poses = Fitter(model).run(touches.faces[None], contacts)
    radius, pose = model.diameter / 2.0, touches.T_world_object

    def misfit(step: NDArray[np.float64]) -> float:
        turn = Rotation.from_rotvec(step[:3] / radius)
        shift = model.centroid + step[3:] - turn.apply(model.centroid.copy())
        moved = pose * RigidTransform.from_components(shift, turn)
        felt = move(moved.inv(), contacts)
        normals, offsets = model.normals[touches.faces], model.offsets[touches.faces]
        heights = (normals * felt.positions).sum(1) - offsets
        tilts = ((felt.normals - normals) ** 2).sum(1)
        return float((5.0 * heights**2 / 1e-3**2 + 4.0 * tilts / 0.2**2).sum())

    step = 1e-6
    axes = step * np.eye(6)
    expected = np.array(
        [
            [
                (misfit(a + b) - misfit(a - b) - misfit(b - a) + misfit(-a - b)) / (8.0 * step**2)
                for b in axes
            ]
            for a in axes
        ]
    )
    found = poses.informations[0]
    np.testing.assert_allclose(found, expected, atol=2e-3 * np.abs(expected).max())
    np.testing.assert_array_equal(found, found.T)


def test_the_turn_between_two_rotations_is_their_rotation_vector() -> None:
    rng, turn = np.random.default_rng(5), np.empty(3)
    for angle in (*rng.uniform(0.0, 3.1, 500), *10.0 ** rng.uniform(-12, -3, 100), 0.0, 3.1415):
        one, vector = Rotation.random(rng=rng), angle * direction(rng)
        other = one * Rotation.from_rotvec(vector)
        length = turn_between(one.as_matrix(), other.as_matrix(), turn)
        assert length == pytest.approx(angle, abs=1e-8)
        np.testing.assert_allclose(turn, vector, atol=1e-8 if angle < 3.1 else 1e-4)
