"""The model test: it keeps every interpretation that some pose satisfies, and only those."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import trimesh
from helpers.fitting import Fitter
from helpers.sensing import CUBE, HOLED, INCH, L_BLOCK, SMALL, feel, sense_grid, touch_faces
from helpers.witnesses import face_with_normal, witness_of
from numpy.typing import NDArray
from oracles.checker import Oracle, check
from oracles.geometry import angle_between
from oracles.samples import STAND_INS
from scipy.spatial.transform import RigidTransform

from palpate.assets import STAND_IN_NAMES
from palpate.recognizer import Constraints, Contacts, PairTables, Polyhedron
from palpate.recognizer.tree.tree import prune

ROWS = ((np.pi / 12, 0.01), (np.pi / 10, 0.01), (np.pi / 8, 0.05), (np.pi / 8, 0.1))
"""Bounds on normals (radians) and positions (inches)."""


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
    np.testing.assert_allclose(apart, 0.002, rtol=2e-9)
    np.testing.assert_allclose(angle_between(contacts.normals, touches.normals), 0.3, atol=1e-8)


@pytest.mark.parametrize("row", ROWS, ids=lambda row: f"pi:{np.pi / row[0]:.0f}-{row[1]}in")
@pytest.mark.parametrize("name", STAND_IN_NAMES)
def test_the_true_interpretation_is_never_rejected_and_gets_a_pose(
    name: str, row: tuple[float, float]
) -> None:
    model, test = STAND_INS[name], Fitter(STAND_INS[name])
    rng = np.random.default_rng([3, STAND_IN_NAMES.index(name), ROWS.index(row)])
    proven = 0
    for case in range(36):
        touches = sense_grid(model, rng, *((3, 9) if case % 2 else (10, 20)))
        contacts = feel(touches, rng, row[1] * INCH, row[0], at_bounds=case % 3 == 0)
        poses = test.run(touches.faces[None], contacts)
        assert len(poses) == 1, f"case {case}: the truth was rejected"
        if poses.proven[0]:
            proven += 1
            assert check(model, witness_of(poses, 0), contacts, touches.faces).passed
    assert proven >= 34


@pytest.mark.parametrize("count", [1, 2, 3])
def test_very_few_contacts_keep_the_truth_too(count: int) -> None:
    rng, proven = np.random.default_rng([4, count]), 0
    for model in (*SMALL.values(), STAND_INS["stapler"]):
        test = Fitter(model)
        for case in range(40):
            faces = rng.integers(model.face_count, size=count).tolist()
            touches = touch_faces(model, rng, faces)
            contacts = feel(touches, rng, 0.001, 0.3, at_bounds=case % 2 == 0)
            poses = test.run(touches.faces[None], contacts)
            assert len(poses) == 1
            if poses.proven[0]:
                proven += 1
                assert check(model, witness_of(poses, 0), contacts, touches.faces).passed
    assert proven > 150


def test_fewer_contacts_keep_all_that_more_of_them_keep() -> None:
    rng, test, tables = np.random.default_rng(20), Fitter(L_BLOCK), PairTables.of(L_BLOCK)
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
    test, proven = Fitter(L_BLOCK), 0
    for _ in range(25):
        touches = touch_faces(L_BLOCK, rng, rng.integers(8, size=5).tolist())
        contacts = feel(touches, rng, 0.001, normal_error)
        poses = test.run(touches.faces[None], contacts)
        assert len(poses) == 1
        if poses.proven[0]:
            proven += 1
            assert check(L_BLOCK, witness_of(poses, 0), contacts, touches.faces).passed
    assert proven > 20


@pytest.mark.parametrize("edge", [0.0, 1e-9, 1e-15])
def test_normals_spread_evenly_about_a_face_at_the_edge_of_their_cone_fit_it(edge: float) -> None:
    # Their mean is the face's normal, so the best rotation uses the whole allowance for misfit.
    rng = np.random.default_rng(6)
    test = Fitter(CUBE)
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


@pytest.mark.parametrize("edge", [0.0, 1e-15, -1e-15, -1e-12])
def test_an_allowance_for_misfit_that_is_used_up_exactly_breaks_nothing(edge: float) -> None:
    # As above on two faces, which leaves a single rotation; then one reading too far out.
    rng, test, half_angle = np.random.default_rng(6), Fitter(CUBE), 0.3
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
    test, rng = Fitter(model), np.random.default_rng(7)
    for case in range(20):
        touches = sense_grid(model, rng, 5, 12)
        contacts = feel(touches, rng, 5e-4 * scale, 0.3, at_bounds=case % 2 == 0)
        poses = test.run(touches.faces[None], contacts)
        assert len(poses) == 1
        assert poses.proven[0]
        assert check(model, witness_of(poses, 0), contacts, touches.faces).passed


@pytest.mark.parametrize("name", STAND_IN_NAMES)
def test_every_proven_pose_meets_every_bound(name: str) -> None:
    model, rng = STAND_INS[name], np.random.default_rng(8)
    tables, test = PairTables.of(model), Fitter(model)
    checked = 0
    for case in range(6):
        touches = sense_grid(model, rng, 4, 12)
        contacts = feel(touches, rng, (0.1, 0.01)[case % 2] * INCH, np.pi / 8)
        candidates = prune(tables, contacts, budget=3000).faces
        poses = test.run(candidates, contacts)
        rows = np.flatnonzero(poses.proven)
        for row in rng.permutation(rows)[:25]:
            assert check(model, witness_of(poses, row), contacts, poses.faces[row]).passed
            checked += 1
    assert checked > 10


def test_kept_interpretations_keep_their_order_and_the_rest_is_gone() -> None:
    rng = np.random.default_rng(9)
    touches = touch_faces(L_BLOCK, rng, [0, 3, 5, 6])
    contacts = feel(touches, rng, 1e-4, 0.05)
    wrong = np.array([[0, 0, 0, 0]], np.int32)
    poses = Fitter(L_BLOCK).run(np.vstack([wrong, touches.faces[None], wrong]), contacts)
    np.testing.assert_array_equal(poses.faces, touches.faces[None])
    assert len(poses.take(np.array([], np.intp))) == 0
    assert len(Fitter(L_BLOCK).run(wrong, contacts)) == 0


def verdicts(
    model: Polyhedron, seed: int, wanted: int
) -> list[tuple[Contacts, NDArray[np.int32], bool]]:
    """Interpretations near the line between possible and not, with whether the test keeps them."""
    rng, tables, test = np.random.default_rng(seed), PairTables.of(model), Fitter(model)
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
    cases = verdicts(model, seed=100 + seed, wanted=60)
    rejected = [(contacts, faces) for contacts, faces, keeps in cases if not keeps]
    assert len(rejected) == 60
    for contacts, faces in rejected:
        assert not Oracle(model, contacts, faces).finds_a_pose(rng, 40)
