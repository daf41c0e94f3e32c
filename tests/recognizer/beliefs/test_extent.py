"""A single pose left: what is called determined has no pose within the bounds that differs."""

import numpy as np
import pytest
from helpers.sensing import SMALL, feel, sense_grid, touch_faces
from scipy.optimize import linprog
from scipy.spatial.transform import RigidTransform, Rotation

from palpate.recognizer import Polyhedron, Recognizer, pose_difference
from palpate.recognizer.beliefs import extent_kernels as kernels
from palpate.recognizer.beliefs import reach_kernels
from palpate.recognizer.poses.fits.pose import kernel_contacts
from palpate.recognizer.poses.simplex_kernels import farther, farthest, simplex_space

BOX = 0.02
SIDES = np.full(6, BOX)


def _polytope(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Half-spaces that hold the origin, some of them alike, some of them through it."""
    rows = rng.standard_normal((rng.integers(0, 60), 6))
    rows[::5] *= [1.0, 1.0, 1.0, 0.0, 0.0, 0.0]
    limits = rng.uniform(0.0, BOX, len(rows)) * (rng.random(len(rows)) > 0.1)
    return rows, limits


def _linprog(objective, rows, limits, low=-SIDES, high=SIDES) -> float:
    box = np.column_stack([low, high]) / BOX
    given = {"A_ub": rows, "b_ub": limits} if len(rows) else {}
    # Scaled: the solver's tolerances are meant for numbers about one.
    scaled = {"A_ub": rows, "b_ub": limits / BOX} if given else {}
    return -BOX * linprog(-objective, bounds=box, **scaled).fun


def _known(rows, limits):
    columns, space = np.vstack([rows.T, limits]), simplex_space(len(rows))
    return columns, len(rows), -SIDES, SIDES.copy(), space


def test_reaches_are_those_of_a_library_of_linear_programs():
    rng = np.random.default_rng(0)
    for _ in range(150):
        rows, limits = _polytope(rng)
        objective = rng.standard_normal(6) * (rng.random(6) < 0.7)
        reach = farthest(objective, *_known(rows, limits))
        assert reach == pytest.approx(_linprog(objective, rows, limits), abs=1e-8)


def test_a_reach_from_where_the_last_program_ended_is_that_from_the_start():
    rng, beyond = np.random.default_rng(3), 0
    for _ in range(100):
        known = _known(*_polytope(rng))
        columns, _, low, high, _ = known
        last = np.inf
        for _ in range(8):
            objective = rng.standard_normal(6) * (rng.random(6) < 0.7)
            reach = farther(objective, *known)
            assert reach == pytest.approx(
                _linprog(objective, columns[:6].T, columns[6], low, high), abs=1e-8
            )
            beyond += reach > last
            last = reach
            # A box shrunk to what holds the polytope, as a search shrinks it.
            axis = np.eye(6)[rng.integers(6)]
            high -= axis * (high - np.minimum(farther(axis, *known) + 1e-9, high))
            low += axis * (np.maximum(-farther(-axis, *known) - 1e-9, low) - low)
    assert beyond > 100


def test_inequalities_that_all_of_a_box_meets_say_nothing():
    rng, dropped = np.random.default_rng(2), 0
    for _ in range(100):
        rows, limits = _polytope(rng)
        limits += rng.uniform(0.0, 8.0 * BOX, len(limits))
        objective = rng.standard_normal(6)
        low, high = np.full(6, -BOX), np.full(6, BOX)
        reach = farthest(objective, *_known(rows, limits))
        columns = np.empty((7, len(rows)))
        left = reach_kernels.take_needed(rows, limits, len(rows), low, high, columns)
        dropped += len(rows) - left
        known = columns[:6, :left].T, columns[6, :left]
        assert farthest(objective, *_known(*known)) == pytest.approx(reach, abs=1e-8)
    assert dropped > 300


def test_a_polytope_that_is_empty_reaches_nowhere():
    rows = np.array([[1.0, 0, 0, 0, 0, 0], [-1.0, 0, 0, 0, 0, 0]])
    assert farthest(np.ones(6), *_known(rows, np.array([-0.01, 0.005]))) == -np.inf


@pytest.mark.parametrize("first", [0, 3], ids=["rotations", "shifts"])
def test_three_motions_are_within_what_is_allowed_if_no_direction_reaches_beyond(first):
    rng = np.random.default_rng([1, first])
    directions = rng.standard_normal((60, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    answers = []
    for _ in range(25):
        rows, limits = _polytope(rng)
        axes = np.zeros((3, 6))
        axes[:, first : first + 3] = Rotation.random(rng=rng).as_matrix()
        box = reach_kernels.box_of(axes, *_known(rows, limits))
        objectives = np.zeros((len(directions), 6))
        objectives[:, first : first + 3] = directions
        reach = max(_linprog(one, rows, limits) for one in objectives)
        block = axes[:, first : first + 3].copy()
        for allowed in (0.9 * reach, 1.3 * reach):
            within = reach_kernels.all_within(first, block, box, allowed, *_known(rows, limits))
            # Sixty directions see nearly how far it reaches, and never farther.
            assert within == (allowed > reach)
            answers.append(within)
    assert 0 < sum(answers) < len(answers)


def _test_of(model: Polyhedron):
    return Recognizer([model]).library.solids[0].kernel


@pytest.mark.parametrize("name", list(SMALL))
def test_every_pose_within_the_bounds_satisfies_the_linear_ones(name):
    model = SMALL[name]
    test, radius = _test_of(model), model.diameter / 2.0
    rng = np.random.default_rng([2, len(name)])
    close = 0
    for _ in range(150):
        touches = touch_faces(model, rng, rng.integers(0, model.face_count, 8).tolist())
        contacts = feel(touches, rng, rng.choice([1e-4, 1e-3]), 0.4, at_bounds=True)
        # The truth is within the bounds; ask from another pose, a turn and a shift away.
        turn = rng.uniform(0.0, 0.1)
        axis = rng.standard_normal(3)
        T = Rotation.from_rotvec(turn * axis / np.linalg.norm(axis))
        shift = rng.uniform(-0.002, 0.002, 3)
        centre = model.centroid
        moved = RigidTransform.from_components(centre + shift - T.apply(centre.copy()), T)
        start = touches.T_world_object * moved.inv()
        x = start.inv().apply(contacts.positions.copy())
        u = start.rotation.inv().apply(contacts.normals.copy())
        rows, limits = np.empty((400, 6)), np.empty(400)
        faces = touches.faces.astype(np.int64)
        count = kernels.contact_rows(
            faces,
            kernel_contacts(contacts),
            contacts.normal_error,
            test.model,
            test.features.half_angles,
            x,
            u,
            turn + 1e-12,
            rows,
            limits,
            tuple(np.empty((5, 3))),
        )
        step = np.concatenate([T.as_rotvec() * radius, T.inv().apply(shift)])
        excess = rows[:count] @ step - limits[:count]
        assert (excess <= 1e-9).all()
        close += int((excess > -1e-5).sum())
    assert close > 0


@pytest.mark.parametrize("name", ["L-block", "holed"])
def test_poses_found_by_wandering_within_the_bounds_are_as_a_determined_one(name):
    model = SMALL[name]
    recognizer = Recognizer([model])
    test, tolerance = _test_of(model), recognizer.tolerance
    rng = np.random.default_rng([3, len(name)])
    determined, farthest = 0, 0.0
    for _ in range(12):
        touches = sense_grid(model, rng)
        contacts = feel(touches, rng, 4e-4, 0.3)
        belief = recognizer.recognize(contacts)
        if not belief.unique:
            continue
        determined += 1
        (only,) = belief.hypotheses
        allowed = tolerance.distance(model.diameter, 4e-4)
        for faces in only.interpretations:
            for pose in _wander(test.model, model, only.pose, faces, contacts, rng):
                off = pose_difference(model, pose, only.pose)
                assert off.rotation <= tolerance.rotation
                assert off.translation <= allowed
                farthest = max(farthest, float(off.rotation) / tolerance.rotation)
    assert determined > 3
    assert farthest > 0.3


def _wander(kernel_model, model, pose, faces, contacts, rng):
    """Poses within the bounds, each a small random motion from the last."""
    kernel = kernel_contacts(contacts)
    faces = faces.astype(np.int64)
    here = pose.rotation.as_matrix(), np.array(pose.translation)
    if kernels.strain(faces, kernel, kernel_model, *here) > 1.0 + 1e-9:
        return  # faces as a symmetry of the object has them
    for _ in range(600):
        size = 10.0 ** rng.uniform(-4.0, -1.5)
        centre = pose.apply(model.centroid)
        T = Rotation.from_rotvec(size * rng.standard_normal(3))
        shift = size * 0.02 * rng.standard_normal(3)
        motion = RigidTransform.from_components(centre + shift - T.apply(centre), T)
        tried = motion * pose
        R, t = tried.rotation.as_matrix(), np.array(tried.translation)
        if kernels.strain(faces, kernel, kernel_model, R, t) <= 1.0:
            pose = tried
            yield pose


@pytest.mark.parametrize("seed", [2016, 2030])
def test_episodes_that_once_ended_with_a_pose_too_far_off_end_with_a_right_one(seed):
    from palpate.policies import make_policy
    from palpate.scripts.benchmark.config import BenchmarkConfig
    from palpate.scripts.benchmark.playing import make_env, open_episode, play, task_of

    config = BenchmarkConfig(
        policies=("information" if seed == 2016 else "minimax",),
        objects=("housing-34",),
        noise=("pi/8,0.05in",),
        episodes=1,
        seed=seed,
    )
    env, (job,) = make_env(config.settings[0]), config.jobs()
    row = play(open_episode(env, job), make_policy(job.policy, task_of(env)), job)
    assert row.solved
    assert row.right
