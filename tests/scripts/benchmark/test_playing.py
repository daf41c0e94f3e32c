"""One episode of a benchmark: what is the same for all strategies, and when an answer is right."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from helpers.made_up_rows import made_up_row, small

from palpate.scripts.benchmark.playing import make_env, open_episode, play, task_of
from palpate.scripts.benchmark.row import GAVE_UP, SOLVED


@pytest.mark.parametrize(("sensor", "radius"), [("ray", 0.0), ("ball", 0.002), ("finger", 0.002)])
def test_a_task_has_the_probes_and_the_bounds_of_its_environment(sensor, radius):
    (setting,) = small(sensor=sensor, goal="object").settings
    env = make_env(setting)
    task = task_of(env, "object")
    assert (task.position_error, task.normal_error) == (0.00127, np.pi / 8)
    assert (task.radius, task.goal, task.library) == (radius, "object", env.library)
    env.reset(seed=0)
    action = np.array([0.3, -0.4, 0.7])
    env.step(action)
    rays = task.space.rays(action[None])
    assert np.allclose(rays.starts_world[0], env.touches[-1].starts_world, atol=1e-12)


class Wandering:
    """Goes where it is told, and wastes what randomness it is given."""

    def __init__(self, wasted: int):
        self.wasted, self.calls = wasted, 0

    def reset(self):
        self.calls = 0

    def act(self, observation, rng):
        rng.random(self.wasted)
        self.calls += 1
        return np.sin(np.array([1.0, 2.0, 3.0]) * self.calls)


def test_object_pose_first_probe_and_noise_are_the_same_whatever_the_strategy_draws():
    (setting,) = small(max_probes=5).settings
    env = make_env(setting)
    job = next(small(max_probes=5).jobs())
    rows, felt = [], []
    for wasted in (0, 17):
        rows.append(play(open_episode(env, job), Wandering(wasted), job).untimed())
        felt.append(env.contacts.positions.copy())
    assert rows[0] == rows[1]
    assert len(rows[0].hypotheses) == rows[0].probes
    assert np.array_equal(*felt)


def test_a_random_episode_is_the_one_that_the_episode_command_plays():
    from palpate.policies import make_policy

    (setting,) = small(max_probes=4).settings
    env = make_env(setting)
    job = next(small(max_probes=4, seed=3).jobs())
    row = play(open_episode(env, job), make_policy("random", task_of(env)), job)
    rng = np.random.default_rng(np.random.SeedSequence(3).spawn(1)[0])
    env.reset(seed=3)
    assert row.first_probe == tuple(rng.uniform(-1.0, 1.0, 3).astype(np.float32).tolist())
    left = []
    for action in (row.first_probe, *rng.uniform(-1.0, 1.0, (row.probes - 1, 3)).astype("f4")):
        env.step(np.asarray(action))
        left.append(len(env.belief.hypotheses) if env.belief else 0)
    assert row.hypotheses == tuple(left)


def test_an_answer_is_right_if_it_is_the_truth_and_wrong_if_it_is_another_object(monkeypatch):
    from types import SimpleNamespace

    from scipy.spatial.transform import RigidTransform

    from palpate.envs.truth import Truth
    from palpate.policies import make_policy
    from palpate.scripts.benchmark import playing

    config = small(noise=("5deg,0.01in",), max_probes=40)
    (setting,) = config.settings
    env = make_env(setting)
    policy, job = make_policy("random", task_of(env)), next(config.jobs())
    row = play(open_episode(env, job), policy, job)
    assert (row.ended, row.right) == (SOLVED, True)
    assert row.rotation_error < np.radians(3.0)
    far = SimpleNamespace(rotation=0.06, translation=0.0)
    monkeypatch.setattr(playing, "pose_difference", lambda *_: far)
    assert play(open_episode(env, job), policy, job).right is False
    knows = replace(setting, goal="object")
    knowing = replace(job, setting=knows)
    assert play(open_episode(env, knowing), policy, knowing).right is True
    spoon = Truth(replace(env.library[0], name="spoon"), RigidTransform.identity())
    assert playing._compared(env.belief, spoon) == (False, None)


def test_the_goal_object_is_reached_at_the_first_contact_where_there_is_one_object():
    from palpate.policies import make_policy

    config = small(goal="object", episodes=3)
    (setting,) = config.settings
    env = make_env(setting)
    for job in list(config.jobs())[:6:2]:
        row = play(open_episode(env, job), make_policy("random", task_of(env, "object")), job)
        assert row.ended == SOLVED
        assert row.right
        assert row.contacts_felt[-1] > 0
        assert not any(row.contacts_felt[:-1])


def test_an_episode_without_an_answer_counts_as_one_probe_more_than_may_be_sent():
    job = next(small().jobs())
    given_up = made_up_row(job, probes=99)
    assert (given_up.ended, given_up.probes, given_up.probes_to_unique) == (GAVE_UP, 20, 21)
    assert made_up_row(job, probes=20).probes_to_unique == 20


@pytest.mark.parametrize(("sensor", "placement"), [("ray", "across"), ("finger", "resting")])
def test_an_episode_that_begins_with_a_copy_goes_on_as_the_episode_itself(sensor, placement):
    from palpate.policies import make_policy
    from palpate.scripts.benchmark.workers import player

    config = small(
        objects=("simple-hand",),
        noise=("pi/10,0.05in",),
        policies=("random", "information"),
        sensor=sensor,
        placement=placement,
        episodes=2,
        max_probes=5,
    )
    (setting,) = config.settings
    env = make_env(setting)
    shared = player("")
    for job in config.jobs():
        policy = make_policy(job.policy, task_of(env))
        assert shared(job).untimed() == play(open_episode(env, job), policy, job).untimed()
