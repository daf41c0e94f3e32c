"""The memo's own pose method: right on exact data, and its steps as a slow reading of Section 3."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from helpers.fitting import Fitter
from helpers.sensing import CUBE, HOLED, L_BLOCK, exact, feel, random_pose, sense_grid, touch_faces
from scipy.spatial.transform import RigidTransform, Rotation

from palpate.envs.library import load_library
from palpate.recognizer import Polyhedron
from palpate.scripts.memo.pose import (
    ALONG,
    CLUSTER,
    INDEPENDENT,
    PARALLEL,
    MemoRotation,
    memo_pose,
    memo_rotation,
    memo_translation,
)

MODELS = {model.name: model for model in (*load_library(), CUBE, L_BLOCK, HOLED)}
every_model = pytest.mark.parametrize("name", MODELS)


def touched(model: Polyhedron, rng: np.random.Generator, pose: RigidTransform | None = None):
    """Exact touches on 6 to 12 faces, three of them with independent normals."""
    while True:
        faces = rng.integers(model.face_count, size=rng.integers(6, 13)).tolist()
        if np.linalg.matrix_rank(model.normals[faces], tol=0.1) == 3:
            return touch_faces(model, rng, faces, pose)


def difference(pose: RigidTransform, truth: RigidTransform) -> tuple[float, float]:
    turn = (pose.rotation.inv() * truth.rotation).magnitude()
    return float(turn), float(np.linalg.norm(pose.translation - truth.translation))


def assert_same(pose: RigidTransform | None, truth: RigidTransform) -> None:
    assert pose is not None
    turn, shift = difference(pose, truth)
    assert turn < 1e-8
    assert shift < 1e-9


# --- Exact data -----------------------------------------------------------------------------


@every_model
def test_exact_contacts_give_the_exact_pose(name):
    model, rng = MODELS[name], np.random.default_rng(1)
    for _ in range(30):
        touches = touched(model, rng)
        found = memo_pose(model, touches.faces, exact(touches))
        assert_same(found, touches.T_world_object)


@pytest.mark.parametrize("degrees", [0.0, 1e-3, 1.0, 90.0, 179.0, 179.999, 180.0])
def test_exact_contacts_do_so_at_angles_where_directions_or_signs_are_singular(degrees):
    rng, model = np.random.default_rng(2), MODELS["housing"]
    for axis in (*np.eye(3), -np.eye(3)[1], *rng.normal(size=(6, 3))):
        turn = Rotation.from_rotvec(np.radians(degrees) * axis / np.linalg.norm(axis))
        truth = RigidTransform.from_components(rng.uniform(-1.0, 1.0, 3), turn)
        found = memo_pose(model, *_felt(touched(model, rng, truth)))
        assert found is not None
        angle, shift = difference(found, truth)
        # Two normals turned by very little tell a direction only up to their own rounding.
        assert angle < 1e-6
        assert shift < 1e-6


def _felt(touches):
    return touches.faces, exact(touches)


def test_the_matrix_is_the_one_of_its_direction_and_angle():
    rng = np.random.default_rng(3)
    for _ in range(50):
        vector = rng.normal(size=3)
        direction, angle = vector / np.linalg.norm(vector), float(rng.uniform(0.0, np.pi))
        expected = Rotation.from_rotvec(angle * direction).as_matrix()
        np.testing.assert_allclose(MemoRotation(direction, angle).as_matrix(), expected, atol=1e-14)


def test_the_angle_is_never_below_zero_or_above_half_a_turn():
    rng = np.random.default_rng(4)
    for _ in range(100):
        turn, normals = Rotation.random(rng=rng), rng.normal(size=(6, 3))
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        found = memo_rotation(normals, turn.apply(normals))
        assert found is not None
        assert 0.0 <= found.angle <= np.pi
        assert found.angle == pytest.approx(turn.magnitude())


def test_the_formulas_as_the_memo_prints_them_give_the_inverse():
    """Why the sine has the other sign here: with v_s = R v_m + v_0 as the memo has it."""
    rng, disagreed = np.random.default_rng(5), 0
    for _ in range(50):
        R = Rotation.random(rng=rng)
        r = R.as_rotvec() / R.magnitude()
        m = rng.normal(size=3)
        m /= np.linalg.norm(m)
        n = R.apply(m)
        below = 1.0 - (r @ n) * (r @ m)
        cosine = 1.0 - (1.0 - n @ m) / below
        sine = np.cross(r, n) @ m / below
        printed = MemoRotation(r, math.atan2(sine, cosine)).as_matrix()
        np.testing.assert_allclose(printed, R.as_matrix().T, atol=1e-9)
        mended = MemoRotation(r, math.atan2(-sine, cosine)).as_matrix()
        np.testing.assert_allclose(mended, R.as_matrix(), atol=1e-9)
        disagreed += not np.allclose(printed, mended)
    assert disagreed > 45


# --- Against a slow reading of the text -----------------------------------------------------


def slow_rotation(ms, ns):
    """Direction and angle, pair by pair."""
    directions = []
    for i, j in itertools.combinations(range(len(ms)), 2):
        across = np.cross(ms[i] - ns[i], ms[j] - ns[j])
        if np.linalg.norm(across) > PARALLEL:
            directions.append(across / np.linalg.norm(across))
    clusters = [
        [r for r in directions if min(1.0, abs(r @ middle)) >= math.cos(CLUSTER)]
        for middle in directions
    ]
    largest = max(clusters, key=len)
    direction = np.linalg.svd(np.array(largest))[2][0]
    spreads = [1.0 - (direction @ n) * (direction @ m) for m, n in zip(ms, ns, strict=True)]
    x = y = 0.0
    for m, n, below in zip(ms, ns, spreads, strict=True):
        if below >= ALONG:
            cosine = 1.0 - (1.0 - n @ m) / below
            sine = np.cross(direction, m) @ n / below
            x += cosine / math.hypot(cosine, sine)
            y += sine / math.hypot(cosine, sine)
    return Rotation.from_rotvec(math.atan2(y, x) * direction)


def slow_translation(normals, offsets, points):
    """Three planes at a time."""
    triples = list(itertools.combinations(range(len(normals)), 3))
    sizes = [abs(np.linalg.det(normals[list(triple)])) for triple in triples]
    found = []
    for triple, size in zip(map(list, triples), sizes, strict=True):
        if size >= INDEPENDENT * max(sizes):
            heights = (normals[triple] * points[triple]).sum(axis=1) - offsets[triple]
            found.append(np.linalg.solve(normals[triple], heights))
    return np.mean(found, axis=0)


@every_model
def test_noisy_contacts_give_what_the_text_says_step_by_step(name):
    model, rng = MODELS[name], np.random.default_rng(6)
    for case in range(12):
        touches = touched(model, rng)
        contacts = feel(touches, rng, 0.001, (0.2, 0.4)[case % 2])
        ms, ns = model.normals[touches.faces], contacts.normals
        rotation, found = slow_rotation(ms, ns), memo_pose(model, touches.faces, contacts)
        assert found is not None
        assert (found.rotation.inv() * rotation).magnitude() < 1e-7
        planes = rotation.apply(ms), model.offsets[touches.faces], contacts.positions
        np.testing.assert_allclose(found.translation, slow_translation(*planes), atol=1e-7)


def test_a_noisy_half_turn_is_found_though_its_angle_may_be_on_either_side():
    rng, model = np.random.default_rng(7), MODELS["complex-hand"]
    for _ in range(20):
        axis = rng.normal(size=3)
        turn = Rotation.from_rotvec(np.pi * axis / np.linalg.norm(axis))
        truth = RigidTransform.from_components(np.zeros(3), turn)
        touches = touched(model, rng, truth)
        found = memo_pose(model, touches.faces, feel(touches, rng, 1e-4, 0.05))
        assert found is not None
        # Averaged as numbers, angles just below and just above half a turn would give none at all.
        assert difference(found, truth)[0] < 0.5


def test_the_joint_fit_is_far_more_accurate_on_the_same_contacts():
    rng, model = np.random.default_rng(8), MODELS["housing"]
    test, errors = Fitter(model), []
    for _ in range(20):
        touches = sense_grid(model, rng, 12, 20)
        contacts = feel(touches, rng, 2.54e-4, np.pi / 10)
        found, fitted = (
            memo_pose(model, touches.faces, contacts),
            test.run(touches.faces[None], contacts),
        )
        assert found is not None
        turn = Rotation.from_matrix(fitted.rotations[0])
        joint = RigidTransform.from_components(fitted.translations[0], turn)
        errors.append(
            [*difference(found, touches.T_world_object), *difference(joint, touches.T_world_object)]
        )
    memo_turn, memo_shift, joint_turn, joint_shift = np.mean(errors, axis=0)
    assert joint_turn < memo_turn / 10.0
    assert joint_shift < memo_shift / 3.0


# --- Where there is no answer, and at the door ----------------------------------------------


def test_two_independent_normals_give_a_rotation_and_no_translation():
    rng = np.random.default_rng(9)
    faces = np.flatnonzero(np.abs(CUBE.normals[:, 2]) < 0.5)
    touches = touch_faces(CUBE, rng, faces.tolist(), random_pose(rng))
    ms, ns = CUBE.normals[faces], touches.normals
    found = memo_rotation(ms, ns)
    assert found is not None
    truth = touches.T_world_object.rotation.as_matrix()
    np.testing.assert_allclose(found.as_matrix(), truth, atol=1e-9)
    assert memo_translation(ns, CUBE.offsets[faces], touches.points) is None
    assert memo_pose(CUBE, touches.faces, exact(touches)) is None


def test_one_normal_gives_nothing():
    rng = np.random.default_rng(10)
    touches = touch_faces(CUBE, rng, [0, 0, 0])
    assert memo_rotation(CUBE.normals[[0, 0, 0]], touches.normals) is None
    assert memo_rotation(CUBE.normals[[0, 0, 0]], CUBE.normals[[0, 0, 0]]) is None
    assert memo_pose(CUBE, touches.faces, exact(touches)) is None
    assert memo_pose(CUBE, touches.faces[:1], exact(touches[np.array([0])])) is None


def test_a_normal_along_the_direction_tells_none_with_any_other():
    rng = np.random.default_rng(12)
    for _ in range(50):
        along, other = rng.normal(size=(2, 3))
        normals = np.array([along / np.linalg.norm(along), other / np.linalg.norm(other)])
        turn = Rotation.from_rotvec(rng.uniform(0.1, 3.0) * normals[0])
        # Rounding moves the first by a little, in any direction.
        assert memo_rotation(normals, turn.apply(normals)) is None


def test_faces_that_do_not_fit_are_refused():
    rng = np.random.default_rng(11)
    touches = touch_faces(CUBE, rng, [0, 1, 2, 3])
    with pytest.raises(ValueError, match=r"\(3,\) faces for 4 contacts"):
        memo_pose(CUBE, touches.faces[:3], exact(touches))
    for face in (-1, 6):
        with pytest.raises(ValueError, match=f"face {face}: cube has faces 0 to 5"):
            memo_pose(CUBE, np.array([0, 1, 2, face]), exact(touches))
