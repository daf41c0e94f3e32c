"""The strategies: where each of them sends the next probe."""

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
    contacts_on_the_bar,
    observation_of,
    pose_at,
    rivals_at_both_ends,
    task_for,
)
from helpers.pose_samples import samples_at
from oracles.geometry import triangle_distances
from scipy.spatial.transform import RigidTransform

from palpate.policies import POLICY_NAMES, make_policy
from palpate.policies.grid import RAYS, SIDE
from palpate.recognizer.models.rays import cast_rays
from palpate.recognizer.predict.prediction import PoseSamples

BLIND = ("random", "random-hit", "grid")
INFORMED = tuple(name for name in POLICY_NAMES if name not in BLIND)


def test_an_unknown_name_is_told_which_there_are():
    with pytest.raises(
        ValueError, match=r"no policy is called 'best'; there are: random, .*refine"
    ):
        make_policy("best", task_for())


@pytest.mark.parametrize("name", [name for name in POLICY_NAMES if name != "grid"])
def test_before_the_first_contact_the_probe_is_the_random_one(name):
    nothing = observation_of(PoseSamples.none((BAR,)))
    action = make_policy(name, task_for()).act(nothing, np.random.default_rng(1))
    expected = make_policy("random", task_for()).act(nothing, np.random.default_rng(1))
    np.testing.assert_array_equal(action, expected)


@pytest.mark.parametrize("name", POLICY_NAMES)
def test_the_same_stream_gives_the_same_probe_to_the_bit(name):
    observation = observation_of(
        rivals_at_both_ends(), contacts_on_the_bar(np.random.default_rng(0), 4), sent=6
    )
    before = {key: value.copy() for key, value in observation.items()}
    policy = make_policy(name, task_for())
    actions = [policy.act(observation, np.random.default_rng(7)) for _ in range(2)]
    actions.append(make_policy(name, task_for()).act(observation, np.random.default_rng(7)))
    for action in actions:
        assert action.dtype == np.float32
        assert action.shape == (3,)
        assert (np.abs(action) <= 1.0).all()
        np.testing.assert_array_equal(action, actions[0])
    for key, value in observation.items():
        np.testing.assert_array_equal(value, before[key])


@pytest.mark.parametrize("free_space", [False, True])
@pytest.mark.parametrize("name", INFORMED)
def test_the_probe_goes_to_the_end_where_two_rivals_differ(name, free_space):
    samples = rivals_at_both_ends()
    task = task_for(free_space=free_space)
    observation = observation_of(samples, contacts_on_the_bar(np.random.default_rng(0), 6), sent=6)
    for seed in range(3):
        action = make_policy(name, task).act(observation, np.random.default_rng(seed))
        rays = task.space.rays(action[None].astype(float))
        told_apart = [
            _certainly_told(rays.starts_world[0], rays.directions_world[0], *pair)
            for pair in ((pose_at(10.0), pose_at(190.0)), (pose_at(190.0), pose_at(10.0)))
        ]
        assert any(told_apart)


def _certainly_told(starts, directions, true: RigidTransform, rival: RigidTransform) -> bool:
    """Whether what is felt at one pose lies clearly off the surface of the other."""
    hits = cast_rays(BAR, true, starts, directions)
    above = hits.hit & (hits.points_world[:, 2] > 0.0)
    triangles = BAR.vertices[BAR.triangles]
    for point, normal in zip(hits.points_world[above], hits.normals_world[above], strict=True):
        inside = rival.inv().apply(point)
        turned = rival.rotation.inv().apply(normal)
        allowed = BAR.normals[BAR.triangle_faces] @ turned > np.cos(2.0 * CONE)
        if triangle_distances(inside[None], triangles[allowed]).min() > 2.0 * REACH:
            return True
    return False


@pytest.mark.parametrize("name", INFORMED)
def test_one_hypothesis_with_an_open_freedom_is_probed_where_that_is_fixed(name):
    """A family along the bar, felt on its sides and top alone: an end face has to be touched."""
    along = np.linspace(-4e-3, 4e-3, 9)
    samples = samples_at((BAR,), [pose_at(x=x) for x in along], hypotheses=np.zeros(9, int))
    rng = np.random.default_rng(1)
    points = np.array([[-10, 10, 4], [10, 10, 8], [0, -10, 5], [-20, 0, 12], [5, 3, 12]]) * MM
    normals = np.array([[0, 1, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, 1]], float)
    action = make_policy(name, task_for()).act(observation_of(samples, (points, normals)), rng)
    rays = SPACE.rays(action[None].astype(float))
    fixed = 0.0
    for pose in (pose_at(x=x) for x in along):
        hits = cast_rays(BAR, pose, rays.starts_world[0], rays.directions_world[0])
        above = hits.hit & (hits.points_world[:, 2] > 0.0)
        fixed = max(fixed, np.abs(hits.normals_world[above, 0]).max(initial=0.0))
    assert fixed > 0.9


def test_random_hit_touches_something_that_may_be_there():
    samples = samples_at((CUBE,), [pose_at(x=20 * MM, y=-15 * MM)])
    policy = make_policy("random-hit", task_for(CUBE))
    for seed in range(20):
        action = policy.act(observation_of(samples), np.random.default_rng(seed))
        rays = SPACE.rays(action[None].astype(float))
        hits = cast_rays(
            CUBE, pose_at(x=20 * MM, y=-15 * MM), rays.starts_world[0], rays.directions_world[0]
        )
        assert (hits.points_world[hits.hit, 2] > 0.0).any()


def test_the_grid_goes_through_all_its_points_and_then_turns():
    policy = make_policy("grid", task_for())
    seen = np.array(
        [
            policy.act({"ray_count": np.array([RAYS * k])}, np.random.default_rng(0))
            for k in range(2 * SIDE**2)
        ]
    )
    assert len(np.unique(seen, axis=0)) == 2 * SIDE**2
    assert len(np.unique(seen[: SIDE**2, 2])) == 1
    np.testing.assert_allclose(np.unique(seen[:, 0]), [-0.8, -0.4, 0.0, 0.4, 0.8], atol=1e-7)
    # Far apart first: the first five points are the middle and the corners.
    assert np.abs(seen[1:5, :2]).min() == pytest.approx(0.8)
