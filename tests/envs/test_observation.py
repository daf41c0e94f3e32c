"""The poses in the observation are those that stand for the belief."""

from __future__ import annotations

import numpy as np
import pytest

from palpate.envs.probe_env import ProbeEnv
from palpate.recognizer.predict.pose_samples import sample_belief

SMALL = ("housing-34", "simple-hand")
KEYS = {
    "objects": "objects",
    "hypotheses": "hypotheses",
    "positions": "positions",
    "quaternions": "rotations",
    "weights": "weights",
    "position_spread": "position_spread",
    "rotation_spread": "rotation_spread",
}
"""Names of the samples' arrays in the observation, and of what they show."""


@pytest.fixture(scope="module")
def env() -> ProbeEnv:
    return ProbeEnv(SMALL, max_probes=6, normal_error=0.1, samples_shown=50)


def test_before_the_first_contact_there_are_no_samples(env):
    observation, _ = env.reset(seed=0)
    assert observation["sample_count"][0] == 0
    assert all(not observation[f"sample_{name}"].any() for name in KEYS)


def test_the_observation_shows_the_samples_of_the_belief_and_nothing_else(env):
    env.reset(seed=1)
    rng = np.random.default_rng(1)
    shown = 0
    for _ in range(6):
        observation, _, ended, _, _ = env.step(rng.uniform(-0.4, 0.4, 3))
        assert env.observation_space.contains(observation)
        if env.belief is None:
            continue
        samples = sample_belief(env.belief, env.library, 50)
        count = observation["sample_count"][0]
        assert count == len(samples) <= 50
        for name, what in KEYS.items():
            rows = observation[f"sample_{name}"]
            np.testing.assert_array_equal(rows[:count], getattr(samples, what))
            assert not rows[count:].any()
        shown += 1
        if ended:
            break
    assert shown > 1


def test_a_new_episode_forgets_the_samples_of_the_last(env):
    env.reset(seed=2)
    rng = np.random.default_rng(2)
    counts = [env.step(rng.uniform(-0.4, 0.4, 3))[0]["sample_count"][0] for _ in range(6)]
    assert counts[-1] > 0
    assert env.reset(seed=2)[0]["sample_count"][0] == 0


def test_room_for_no_sample_is_refused():
    with pytest.raises(ValueError, match="samples_shown is 0"):
        ProbeEnv(SMALL, samples_shown=0)
