"""What probes may report at each pose, and what that leaves of the others."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.bar import (
    BAR,
    CONE,
    CUBE,
    MM,
    REACH,
    SPACE,
    observation_of,
    pose_at,
    random_outcomes,
    task_for,
)
from helpers.pose_samples import samples_at
from oracles.geometry import triangle_distances
from scipy.spatial.transform import RigidTransform, Rotation

from palpate.policies.outcomes.candidates import aimed_actions, spread_actions
from palpate.policies.outcomes.outcomes import Outcomes
from palpate.policies.outcomes.paths import agreement
from palpate.policies.outcomes.rivals import answers, leading_rows, same_answer, taken, thinned
from palpate.policies.outcomes.weighing import Budget
from palpate.recognizer import PoseTolerance, pose_difference
from palpate.recognizer.predict.prediction import MET_OBJECT


def slow_pair(outcomes: Outcomes, a: int, i: int, j: int) -> tuple[float, float]:
    """How likely pose j is left by probe a if i is true, and how far apart their reports are."""
    told, task = outcomes.predictions, outcomes.task
    left, apart = 1.0, 0.0
    for k in range(3):
        mine = told.outcomes[i, a, k] == MET_OBJECT
        other = told.outcomes[j, a, k] == MET_OBJECT
        if mine != other and (mine or task.free_space):
            return 0.0, np.inf
    for k in range(3):
        if told.outcomes[i, a, k] != MET_OBJECT or told.outcomes[j, a, k] != MET_OBJECT:
            continue
        slope = abs(told.normals_world[j, a, k] @ outcomes.rays.directions_world[a, k])
        spread = np.hypot(told.depth_spread[i, a, k], told.depth_spread[j, a, k])
        x = abs(told.depths[i, a, k] - told.depths[j, a, k]) * slope
        x /= task.position_error + slope * spread
        cone = task.normal_error + np.hypot(*outcomes.samples.rotation_spread[[i, j]])
        chord = np.linalg.norm(told.normals_world[i, a, k] - told.normals_world[j, a, k])
        y = chord / (2.0 * np.sin(cone))
        apart = max(apart, x / 2.0, y)
        if x >= 2.0 or y >= 1.0:
            left = 0.0
            continue
        # The share of a ball's slices, of area 1 - t^2, beyond a plane x - 1 from its middle ...
        slices = np.linspace(x - 1.0, 1.0, 4001)
        left *= np.trapezoid(1.0 - slices**2, slices) * 0.75
        # ... and of a disc of radius 1 that another one, 2 y away, covers.
        across = np.linspace(y, 1.0, 4001)
        left *= 4.0 * np.trapezoid(np.sqrt(1.0 - across**2), across) / np.pi
    return left, apart


@pytest.mark.parametrize("free_space", [False, True])
def test_what_is_left_is_what_a_slow_reckoning_says(free_space):
    rng = np.random.default_rng(3)
    outcomes = random_outcomes(rng, count=9, probes=12, free_space=free_space)
    count, probes = len(outcomes.samples), len(outcomes.actions)
    slow = np.array(
        [
            [[slow_pair(outcomes, a, i, j) for j in range(count)] for i in range(count)]
            for a in range(probes)
        ]
    )
    different = ~np.broadcast_to(outcomes.same, slow.shape[:3])
    np.testing.assert_allclose(outcomes.left[different], slow[..., 0][different], atol=3e-3)
    np.testing.assert_allclose(outcomes.distances[different], slow[..., 1][different], rtol=1e-4)
    assert (outcomes.left[~different] == 1.0).all()
    assert (outcomes.distances[~different] == 0.0).all()
    soft = (slow[..., 0] > 0.05) & (slow[..., 0] < 0.95) & different
    assert soft.sum() > 20  # the sample has something to compare
    # Told apart for certain is the same for both measures.
    np.testing.assert_array_equal(outcomes.distances >= 1.0, outcomes.left == 0.0)


def test_a_touch_may_be_explained_by_any_face():
    """Against distances of points from triangles, one triangle and one face at a time."""
    rng = np.random.default_rng(8)
    task = task_for()
    poses = [pose_at(0.0), pose_at(180.0), pose_at(0.0, 0.8e-3), pose_at(90.0, 2e-3)]
    samples = samples_at((BAR,), poses)
    actions = aimed_actions(SPACE, samples, 40, rng)
    quick = Outcomes.of(task, samples, actions)
    thorough = quick.thoroughly(np.arange(len(actions)))
    told = quick.predictions
    slow = np.ones_like(thorough.left, float)
    for a, i, j in np.argwhere(~np.broadcast_to(quick.same, quick.left.shape)):
        for k in np.flatnonzero(told.outcomes[i, a] == MET_OBJECT):
            start, along = quick.rays.starts_world[a, k], quick.rays.directions_world[a, k]
            point = poses[j].inv().apply(start + told.depths[i, a, k] * along)
            normal = poses[j].rotation.inv().apply(told.normals_world[i, a, k])
            best = 0.0
            for face in range(BAR.face_count):
                triangles = BAR.vertices[BAR.triangles[BAR.triangle_faces == face]]
                x = triangle_distances(point[None], triangles).min() / REACH
                y = np.linalg.norm(BAR.normals[face] - normal) / (2.0 * np.sin(CONE))
                if x < 2.0 and y < 1.0:
                    t = 1.0 - x
                    overlap = 1.0 - 2.0 / np.pi * (np.arcsin(y) + y * np.sqrt(1.0 - y**2))
                    best = max(best, 0.25 * (2.0 + 3.0 * t - t**3) * overlap)
            slow[a, i, j] *= best
    differ = np.abs(thorough.left - slow)
    # Where one face explains a good share already, no other one is looked for.
    assert (thorough.left <= slow + 3e-3).all()
    assert differ[slow < 0.1].max() < 3e-3
    assert differ.max() < 0.35
    assert ((quick.left < 0.01) & (slow > 0.5)).any()  # hidden behind the notch's step, or beside


def test_poses_within_the_tolerance_are_one_answer():
    rng = np.random.default_rng(9)
    models = (BAR, CUBE)
    tolerance = PoseTolerance()
    task = task_for(*models, tolerance=tolerance)
    poses, objects = [], []
    for k in range(24):
        turn = Rotation.from_euler(
            "xyz", [90.0 * rng.integers(4), 0.0, 90.0 * rng.integers(4)], True
        )
        wobble = Rotation.from_rotvec(rng.normal(0.0, np.radians(1.0), 3))
        shift = rng.normal(0.0, 0.7e-3, 3)
        poses.append(RigidTransform.from_components(shift, wobble * turn))
        objects.append(k % 2)
    same = same_answer(task, samples_at(models, poses, objects=objects))
    for i in range(24):
        for j in range(24):
            expected = objects[i] == objects[j]
            if expected:
                model = models[objects[i]]
                gap = pose_difference(model, poses[i], poses[j])
                near = tolerance.distance(model.diameter, REACH)
                expected = gap.rotation <= tolerance.rotation and gap.translation <= near
            assert same[i, j] == expected
    assert 24 < same.sum() < 24 * 24 / 2
    by_name = same_answer(
        task_for(*models, goal="object"), samples_at(models, poses, objects=objects)
    )
    np.testing.assert_array_equal(by_name, np.equal.outer(objects, objects))


def test_answers_group_what_is_the_same_around_the_heaviest():
    same = np.array([[1, 1, 0, 0], [1, 1, 1, 0], [0, 1, 1, 0], [0, 0, 0, 1]], bool)
    np.testing.assert_array_equal(answers(same, np.array([0.1, 0.5, 0.2, 0.2])), [0, 0, 0, 1])
    found = answers(same, np.array([0.5, 0.1, 0.2, 0.2]))
    assert found[0] == found[1] != found[2] != found[3]


def test_thinned_samples_keep_every_hypothesis_and_its_share():
    rng = np.random.default_rng(2)
    hypotheses = np.sort(rng.integers(10, size=90))
    samples = samples_at((BAR,), [pose_at()] * 90, hypotheses=hypotheses, weights=rng.random(90))
    thin = thinned(samples, 30)
    assert len(thin) == 30
    for number in range(10):
        before = samples.weights[samples.hypotheses == number].sum()
        assert thin.weights[thin.hypotheses == number].sum() == pytest.approx(before)
    lead = taken(samples, leading_rows(samples, 3))
    shares = np.bincount(hypotheses, samples.weights)
    np.testing.assert_array_equal(lead.hypotheses, np.argsort(-shares)[:3])


def test_aimed_probes_reach_the_point_they_are_aimed_at():
    samples = samples_at((BAR,), [pose_at(30.0, 5e-3), pose_at(120.0)])
    actions = aimed_actions(SPACE, samples, 50, np.random.default_rng(0))
    assert 30 < len(actions) <= 50
    assert (np.abs(actions) <= 1.0).all()
    touching = np.maximum(
        *(
            Outcomes.of(task_for(), taken(samples, np.array([row])), actions).predictions.outcomes[
                0
            ]
            == MET_OBJECT
            for row in (0, 1)
        )
    )
    assert touching.any(axis=1).all()
    anywhere = Outcomes.of(task_for(), samples, spread_actions(200, np.random.default_rng(1)))
    assert (anywhere.predictions.outcomes == MET_OBJECT).any(axis=(0, 2)).mean() < 0.98


def test_a_pose_that_rays_went_through_is_hardly_the_true_one():
    samples = samples_at((BAR,), [pose_at(10.0), pose_at(190.0)], spread=2e-4, turn=1e-3)
    observation = observation_of(samples, sent=4)
    # Down through the end that only the second has whole, and beside both, and onto both.
    for row, (x, end) in enumerate([(25 * MM, 2 * MM), (-50 * MM, 0.0), (0.0, 12 * MM)]):
        foot = pose_at(10.0).apply(np.array([x, 0.0, 0.0]))
        observation["ray_starts"][row] = foot + (0.0, 0.0, 0.1)
        observation["ray_ends"][row] = foot + (0.0, 0.0, end)
    observation["ray_starts"][3] = observation["ray_starts"][2]
    observation["ray_ends"][3] = observation["ray_ends"][2]
    np.testing.assert_allclose(agreement(task_for(), observation, samples), [1.0, 0.1])
    observation["ray_ends"][:] = observation["ray_starts"] + (0.1, 0.0, 0.0)
    # A ray that doesn't go down to the plane is none of the predictor's: it tells nothing here.
    np.testing.assert_allclose(agreement(task_for(), observation, samples), [1.0, 1.0])


def test_a_budget_weighs_fewer_probes_against_more_poses():
    budget = Budget()
    counts = [budget.probes(samples) for samples in (1, 10, 30, 64)]
    assert counts == sorted(counts, reverse=True)
    assert counts[0] == budget.most
    assert counts[-1] >= budget.fewest
    assert budget.shortlist(64) >= budget.fewest_thorough
