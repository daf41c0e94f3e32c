"""The model test: it keeps every interpretation that some pose satisfies, and only those."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import trimesh
from helpers.sensing import (
    CUBE,
    HOLED,
    INCH,
    L_BLOCK,
    SMALL,
    Touches,
    exact,
    feel,
    move,
    random_pose,
    sense_grid,
    touch_faces,
)
from numpy.typing import NDArray
from oracles import solids as oracles
from oracles.checker import Oracle, check
from oracles.geometry import angle_between
from scipy.spatial.transform import RigidTransform, Rotation

from palpate.assets import STAND_IN_NAMES
from palpate.envs.library import load_library
from palpate.recognizer import Constraints, Contacts, PairTables, Polyhedron
from palpate.recognizer.beliefs.extent_kernels import strain
from palpate.recognizer.poses.fits.fit_kernels import fit_pose
from palpate.recognizer.poses.fits.pose import ModelTest, Poses, kernel_contacts
from palpate.recognizer.poses.fits.pose_kernels import finish, weigh
from palpate.recognizer.poses.proofs.proof_kernels import workspace
from palpate.recognizer.tree.tree import prune

ROWS = ((np.pi / 12, 0.01), (np.pi / 10, 0.01), (np.pi / 8, 0.05), (np.pi / 8, 0.1))
"""Bounds on normals (radians) and positions (inches)."""

STAND_INS = {model.name: model for model in load_library()}


BAR = Polyhedron.from_mesh(oracles.box(0.3, 0.02, 0.015), name="bar")
"""Long: nothing but the ends of its flanks says where along it a contact is."""
FLANKS = np.flatnonzero(np.abs(BAR.normals[:, 0]) < 0.5).tolist()


def pose_of(poses: Poses, row: int) -> RigidTransform:
    return RigidTransform.from_components(
        poses.translations[row], Rotation.from_matrix(poses.rotations[row])
    )


def centroid_and_turn_errors(
    model: Polyhedron, pose: RigidTransform, truth: RigidTransform
) -> tuple[float, float]:
    shift = np.linalg.norm(pose.apply(model.centroid) - truth.apply(model.centroid))
    return float(shift), float((pose.rotation.inv() * truth.rotation).magnitude())


def face_with_normal(model: Polyhedron, direction: tuple[float, float, float], nth: int = 0) -> int:
    return int(np.flatnonzero(model.normals @ direction > 0.999)[nth])


# The samples themselves


def test_the_small_objects_are_what_they_are_called() -> None:
    assert [model.face_count for model in SMALL.values()] == [6, 8, 10]
    assert [len(model.symmetries) for model in SMALL.values()] == [24, 1, 4]
    assert len(HOLED.pieces.start) > len(HOLED.hulls.start)


@pytest.mark.parametrize("name", STAND_IN_NAMES)
def test_the_checker_passes_the_truth_and_fails_a_pose_one_bound_off(name: str) -> None:
    model, rng = STAND_INS[name], np.random.default_rng(1)
    for at_bounds in (False, True):
        touches = sense_grid(model, rng)
        contacts = feel(touches, rng, 0.001, 0.1, at_bounds=at_bounds)
        assert check(model, touches.T_world_object, contacts, touches.faces).passed
        far = RigidTransform.from_translation(0.0021 * touches.normals[0]) * touches.T_world_object
        assert not check(model, far, contacts, touches.faces).within[0]
        wrong = np.full_like(touches.faces, touches.faces[0])
        assert not check(model, touches.T_world_object, contacts, wrong).passed


def test_noise_at_the_bounds_is_at_the_bounds() -> None:
    rng = np.random.default_rng(2)
    touches = sense_grid(CUBE, rng, 3, 9)
    contacts = feel(touches, rng, 0.002, 0.3, at_bounds=True)
    apart = np.linalg.norm(contacts.positions - touches.points, axis=1)
    np.testing.assert_allclose(apart, 0.002, rtol=1e-9)
    np.testing.assert_allclose(angle_between(contacts.normals, touches.normals), 0.3, atol=1e-8)


# What is true survives


@pytest.mark.parametrize("row", ROWS, ids=lambda row: f"pi:{np.pi / row[0]:.0f}-{row[1]}in")
@pytest.mark.parametrize("name", STAND_IN_NAMES)
def test_the_true_interpretation_is_never_rejected_and_gets_a_pose(
    name: str, row: tuple[float, float]
) -> None:
    model, test = STAND_INS[name], ModelTest(STAND_INS[name])
    rng = np.random.default_rng([3, STAND_IN_NAMES.index(name), ROWS.index(row)])
    proven = 0
    for case in range(36):
        touches = sense_grid(model, rng, *((3, 9) if case % 2 else (10, 20)))
        contacts = feel(touches, rng, row[1] * INCH, row[0], at_bounds=case % 3 == 0)
        poses = test.run(touches.faces[None], contacts)
        assert len(poses) == 1, f"case {case}: the truth was rejected"
        if poses.proven[0]:
            proven += 1
            assert check(model, pose_of(poses, 0), contacts, touches.faces).passed
    assert proven >= 34


@pytest.mark.parametrize("count", [1, 2, 3])
def test_very_few_contacts_keep_the_truth_too(count: int) -> None:
    rng = np.random.default_rng([4, count])
    for model in (*SMALL.values(), STAND_INS["stapler"]):
        test = ModelTest(model)
        for case in range(40):
            faces = rng.integers(model.face_count, size=count).tolist()
            touches = touch_faces(model, rng, faces)
            contacts = feel(touches, rng, 0.001, 0.3, at_bounds=case % 2 == 0)
            poses = test.run(touches.faces[None], contacts)
            assert len(poses) == 1
            if poses.proven[0]:
                assert check(model, pose_of(poses, 0), contacts, touches.faces).passed


@pytest.mark.parametrize("name", STAND_IN_NAMES)
def test_a_test_without_time_keeps_the_truth_too(name: str) -> None:
    model, rng = STAND_INS[name], np.random.default_rng(19)
    hasty = ModelTest(model, boxes=1, pool=1)
    for case in range(20):
        touches = sense_grid(model, rng, 4, 12)
        contacts = feel(touches, rng, 0.05 * INCH, np.pi / 8, at_bounds=case % 2 == 0)
        for count in range(1, len(contacts) + 1, 3):
            assert len(hasty.run(touches.faces[None, :count], contacts[:count])) == 1


def test_fewer_contacts_keep_all_that_more_of_them_keep() -> None:
    rng, test, tables = np.random.default_rng(20), ModelTest(L_BLOCK), PairTables.of(L_BLOCK)
    dropped = 0
    for _ in range(10):
        touches = touch_faces(L_BLOCK, rng, rng.integers(8, size=6).tolist())
        contacts = feel(touches, rng, 0.001, 0.3)
        candidates = prune(tables, contacts, constraints=Constraints(component=False)).faces
        kept = test.run(candidates, contacts).faces
        assert len(test.run(np.ascontiguousarray(kept[:, :4]), contacts[:4])) == len(kept)
        dropped += len(candidates) - len(kept)
    assert dropped > 0


@pytest.mark.parametrize("normal_error", [np.pi, 0.9 * np.pi, np.pi / 2])
def test_a_contact_whose_normal_is_hardly_known_still_counts_by_its_position(
    normal_error: float,
) -> None:
    rng = np.random.default_rng(5)
    test = ModelTest(L_BLOCK)
    for _ in range(25):
        touches = touch_faces(L_BLOCK, rng, rng.integers(8, size=5).tolist())
        contacts = feel(touches, rng, 0.001, normal_error)
        poses = test.run(touches.faces[None], contacts)
        assert len(poses) == 1
        if poses.proven[0]:
            assert check(L_BLOCK, pose_of(poses, 0), contacts, touches.faces).passed


@pytest.mark.parametrize("edge", [0.0, 1e-9, 1e-15])
def test_normals_spread_evenly_about_a_face_at_the_edge_of_their_cone_fit_it(edge: float) -> None:
    # Their mean is the face's normal, so the best rotation uses the whole allowance for misfit.
    rng = np.random.default_rng(6)
    test = ModelTest(CUBE)
    top = face_with_normal(CUBE, (0, 0, 1))
    for count, half_angle in itertools.product((2, 3, 4, 7), (0.01, 0.3, 1.0)):
        touches = touch_faces(CUBE, rng, [top] * count)
        around = 2.0 * np.pi * np.arange(count) / count
        tilt = half_angle - edge
        in_object = np.column_stack(
            [np.sin(tilt) * np.cos(around), np.sin(tilt) * np.sin(around), [np.cos(tilt)] * count]
        )
        contacts = Contacts(
            touches.points,
            touches.T_world_object.rotation.apply(in_object),
            position_error=0.001,
            normal_error=half_angle,
        )
        assert len(test.run(touches.faces[None], contacts)) == 1


@pytest.mark.parametrize("edge", [0.0, 1e-15, -1e-15, -1e-9])
def test_an_allowance_for_misfit_that_is_used_up_exactly_breaks_nothing(edge: float) -> None:
    # As above on two faces, which leaves a single rotation; then one reading too far out.
    rng, test, half_angle = np.random.default_rng(6), ModelTest(CUBE), 0.3
    faces = [face_with_normal(CUBE, axis) for axis in ((0, 0, 1), (1, 0, 0)) for _ in range(3)]
    for _ in range(10):
        touches = touch_faces(CUBE, rng, faces)
        tilted = []
        for face in faces[::3]:
            normal, tilt = CUBE.normals[face], half_angle - edge
            across = np.roll(normal, 1)
            around = 2.0 * np.pi * np.arange(3)[:, None] / 3 + rng.random()
            tangents = np.cos(around) * across + np.sin(around) * np.cross(normal, across)
            tilted.append(np.cos(tilt) * normal + np.sin(tilt) * tangents)
        contacts = Contacts(
            touches.points,
            touches.T_world_object.rotation.apply(np.vstack(tilted)),
            position_error=0.001,
            normal_error=half_angle,
        )
        assert len(test.run(touches.faces[None], contacts)) == 1
        apart = contacts.positions.copy()
        apart[0] += 0.004 * touches.normals[0]
        apart[1] -= 0.004 * touches.normals[0]
        too_far = Contacts(apart, contacts.normals, position_error=0.001, normal_error=half_angle)
        assert len(test.run(touches.faces[None], too_far)) == 0


@pytest.mark.parametrize("scale", [1e-3, 1e3])
def test_the_size_of_an_object_does_not_matter(scale: float) -> None:
    mesh = trimesh.Trimesh(scale * HOLED.vertices, HOLED.triangles)
    model = Polyhedron.from_mesh(mesh, name="scaled")
    test, rng = ModelTest(model), np.random.default_rng(7)
    for case in range(20):
        touches = sense_grid(model, rng, 5, 12)
        contacts = feel(touches, rng, 5e-4 * scale, 0.3, at_bounds=case % 2 == 0)
        poses = test.run(touches.faces[None], contacts)
        assert len(poses) == 1
        assert poses.proven[0]
        assert check(model, pose_of(poses, 0), contacts, touches.faces).passed


# What is proven holds


@pytest.mark.parametrize("name", STAND_IN_NAMES)
def test_every_proven_pose_meets_every_bound(name: str) -> None:
    model, rng = STAND_INS[name], np.random.default_rng(8)
    tables, test = PairTables.of(model), ModelTest(model)
    checked = 0
    for case in range(6):
        touches = sense_grid(model, rng, 4, 12)
        contacts = feel(touches, rng, (0.1, 0.01)[case % 2] * INCH, np.pi / 8)
        candidates = prune(tables, contacts, budget=3000).faces
        poses = test.run(candidates, contacts)
        rows = np.flatnonzero(poses.proven)
        for row in rng.permutation(rows)[:25]:
            assert check(model, pose_of(poses, row), contacts, poses.faces[row]).passed
            checked += 1
    assert checked > 10


def test_kept_interpretations_keep_their_order_and_the_rest_is_gone() -> None:
    rng = np.random.default_rng(9)
    touches = touch_faces(L_BLOCK, rng, [0, 3, 5, 6])
    contacts = feel(touches, rng, 1e-4, 0.05)
    wrong = np.array([[0, 0, 0, 0]], np.int32)
    poses = ModelTest(L_BLOCK).run(np.vstack([wrong, touches.faces[None], wrong]), contacts)
    np.testing.assert_array_equal(poses.faces, touches.faces[None])
    assert len(poses.take(np.array([], np.intp))) == 0
    assert len(ModelTest(L_BLOCK).run(wrong, contacts)) == 0


# What is rejected is impossible: an oracle that looks for poses everywhere


def verdicts(
    model: Polyhedron, seed: int, wanted: int
) -> list[tuple[Contacts, NDArray[np.int32], bool]]:
    """Interpretations near the line between possible and not, with whether the test keeps them."""
    rng, tables, test = np.random.default_rng(seed), PairTables.of(model), ModelTest(model)
    kept, rejected = [], []
    loose = Constraints(component=False)
    while min(len(kept), len(rejected)) < wanted:
        count = int(rng.integers(3, 6))
        touches = touch_faces(model, rng, rng.integers(model.face_count, size=count).tolist())
        contacts = feel(touches, rng, 0.0025, 0.35)
        # Pulled apart or together a little, so that even the truth may have become impossible.
        middle = contacts.positions.mean(axis=0)
        stretched = Contacts(
            middle + rng.uniform(0.85, 1.2) * (contacts.positions - middle),
            contacts.normals,
            position_error=contacts.position_error,
            normal_error=contacts.normal_error,
        )
        candidates = prune(tables, stretched, constraints=loose, budget=2000).faces
        survivors = {tuple(row) for row in test.run(candidates, stretched).faces.tolist()}
        for keeps in (False, True):
            rows = [row for row in candidates if (tuple(row.tolist()) in survivors) == keeps]
            for row in rng.permutation(len(rows))[:2]:
                (kept if keeps else rejected).append((stretched, rows[row], keeps))
    return kept[:wanted] + rejected[:wanted]


@pytest.mark.parametrize("name", SMALL)
def test_no_pose_is_found_for_what_the_test_rejects_and_poses_are_for_what_it_keeps(
    name: str,
) -> None:
    model, rng = SMALL[name], np.random.default_rng(11)
    cases = verdicts(model, seed=10, wanted=10)
    found = 0
    for contacts, faces, keeps in cases:
        possible = Oracle(model, contacts, faces).finds_a_pose(rng)
        assert keeps or not possible, f"{faces} was rejected, and a pose meets its bounds"
        found += possible
    # The oracle is no straw man: it finds nearly all that there is.
    assert found >= 8


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("name", SMALL)
def test_no_pose_is_found_for_many_that_the_test_rejects(name: str, seed: int) -> None:
    model, rng = SMALL[name], np.random.default_rng(seed)
    for contacts, faces, keeps in verdicts(model, seed=100 + seed, wanted=60):
        if not keeps:
            assert not Oracle(model, contacts, faces).finds_a_pose(rng, 40)


# What a pose is


@pytest.mark.parametrize("name", STAND_IN_NAMES)
def test_moving_the_contacts_moves_the_poses(name: str) -> None:
    model, rng = STAND_INS[name], np.random.default_rng(12)
    test, tables = ModelTest(model), PairTables.of(model)
    compared = 0
    for _ in range(8):
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
            expected = motion * pose_of(before, row)
            shift, turn = centroid_and_turn_errors(model, pose_of(after, row), expected)
            assert shift < 1e-6
            assert turn < 1e-5
            compared += 1
    assert compared >= 6


@pytest.mark.parametrize("model", [*SMALL.values(), *STAND_INS.values()], ids=lambda m: m.name)
def test_exact_contacts_on_all_faces_give_the_pose_back(model: Polyhedron) -> None:
    rng, test = np.random.default_rng(13), ModelTest(model)
    for _ in range(3):
        touches = touch_faces(model, rng, list(range(model.face_count)))
        poses = test.run(touches.faces[None], exact(touches, 1e-6, 1e-3))
        assert poses.proven.all()
        shift, turn = centroid_and_turn_errors(model, pose_of(poses, 0), touches.T_world_object)
        assert shift < 1e-9
        assert turn < 1e-8
        assert poses.costs[0] < 1e-3  # a thousandth of a bound, here and there, is left


def test_the_fit_does_not_drift_along_a_free_direction() -> None:
    test, rng = ModelTest(BAR), np.random.default_rng(14)
    for case in range(60):
        faces = rng.choice(FLANKS, size=8).tolist()
        touches = touch_faces(BAR, rng, faces)
        contacts = feel(touches, rng, 0.001, np.pi / 8, at_bounds=case % 3 == 0)
        poses = test.run(touches.faces[None], contacts)
        assert poses.proven.all()
        assert check(BAR, pose_of(poses, 0), contacts, touches.faces).passed


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
            ModelTest(BAR).model,
            20,
            rotation,
            translation,
            workspace(len(contacts)),
        )
        end = RigidTransform.from_components(translation, Rotation.from_matrix(rotation))
        assert not check(BAR, start, contacts, touches.faces).passed
        assert check(BAR, end, contacts, touches.faces, tolerance=0.05).passed


def test_a_witness_ends_nearest_to_the_best_fit_wherever_it_was_found() -> None:
    rng, before, after = np.random.default_rng(12), [], []
    for case in range(300):
        model = list(SMALL.values())[case % len(SMALL)]
        test = ModelTest(model)
        touches = touch_faces(model, rng, rng.integers(0, model.face_count, 10).tolist())
        contacts = feel(touches, rng, 1e-3, 0.2)
        kernel, faces = kernel_contacts(contacts), touches.faces.astype(np.int64)
        work, information = workspace(len(contacts)), np.empty((6, 6))
        (shared,) = test.run(touches.faces[None], contacts).costs
        rotation = touches.T_world_object.rotation.as_matrix()
        translation = np.array(touches.T_world_object.translation)
        # The truth is a witness; the best fit often is none.
        question = (len(contacts), faces, kernel, test.model, rotation, translation, work)
        found = weigh(*question, information)
        cost = finish(*question, information)
        assert cost <= found * (1.0 + 1e-9)
        assert strain(faces, kernel, test.model, rotation, translation) <= 1.0 + 1e-8
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
        assert ModelTest(BAR).run(faces, contacts).proven.sum() == kept


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
        assert len(ModelTest(HOLED).run(faces[None], contacts)) == kept


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
        assert len(ModelTest(L_BLOCK).run(faces[None], exact(again, 5e-4))) == kept


def test_the_information_is_that_of_small_motions() -> None:
    # Against the second difference of a misfit written down anew.
    rng, model = np.random.default_rng(17), L_BLOCK
    touches = touch_faces(model, rng, [0, 1, 2, 3, 4, 5, 6, 7])
    contacts = exact(touches, 1e-3, 0.2)
    poses = ModelTest(model).run(touches.faces[None], contacts)
    radius, pose = model.diameter / 2.0, touches.T_world_object

    def misfit(step: NDArray[np.float64]) -> float:
        turn = Rotation.from_rotvec(step[:3] / radius)
        shift = model.centroid + step[3:] - turn.apply(model.centroid)
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
