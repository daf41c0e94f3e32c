"""Several sensors in one episode: each probe says which, and all that they tell is put together."""

from __future__ import annotations

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from helpers.episodes import CUT_SHORT

import palpate.envs
from palpate.envs.probe_env import ProbeEnv
from palpate.envs.scene.scene import OBJECT
from palpate.envs.sensors.noise import SensorNoise
from palpate.envs.sensors.ray_sensor import RaySensor
from palpate.envs.truth import Truth
from palpate.recognizer import EDGE, FACE, VERTEX, pose_difference

gymnasium.register_envs(palpate.envs)


def test_the_last_number_of_an_action_chooses_the_sensor():
    env = ProbeEnv(("stapler",), sensor=("ray", "ball", "finger"), limits=CUT_SHORT)
    assert env.action_space.shape == (4,)
    env.reset(seed=0)
    used = []
    for choice in (-1.0, -0.34, -0.33, 0.33, 0.34, 1.0):
        env.step(np.array([0.0, 0.0, 0.0, choice]))
        touch = env.touches[-1]
        used.append("finger" if touch.forces else "ball" if touch.radius else "ray")
    assert used == ["ray", "ray", "ball", "ball", "finger", "finger"]


def test_contacts_of_all_sensors_make_one_belief():
    """A scan, a ball and rays: the scan alone leaves rivals that the others rule out."""
    env = ProbeEnv(
        ("stapler", "simple-hand"),
        sensor=("range", "ball", "ray"),
        position_error=1e-4,
        normal_error=0.1,
    )
    env.reset(seed=3)
    counts, info = [], {}
    for number in range(6):
        choice = (-1.0, 0.0, 1.0)[number % 3]
        observation, *_, info = env.step(np.array([0.1 * number - 0.2, 0.1, 0.1 * number, choice]))
        assert env.observation_space.contains(observation)
        counts.append(len(env.touches[-1].contacts))
    assert len(env.contacts) == sum(counts)
    assert min(counts[0] + counts[3], counts[1] + counts[4], counts[2] + counts[5]) > 0
    assert set(env.contacts.kinds.tolist()) <= {FACE, EDGE, VERTEX}
    assert env.belief is not None
    best = env.belief.hypotheses[0]
    truth = Truth.of(env.library, info)
    assert best.object_name == truth.model.name
    error = pose_difference(truth.model, best.pose, truth.T_world_object)
    assert error.rotation < 0.02
    assert error.translation < 1e-3


def test_edges_are_reckoned_with_if_any_sensor_can_touch_them():
    rays = RaySensor(SensorNoise(position_error=1e-3, normal_error=0.1), 0.4)
    mixed = ProbeEnv(("stapler",), sensor=[rays, "ball"], radius=0.003)
    alone = ProbeEnv(("stapler",), sensor=[rays])
    assert mixed.recognizer.features("stapler").edge_count > 0
    assert alone.recognizer.features("stapler").edge_count == 0
    assert alone.action_space.shape == (3,)
    mixed.reset(seed=1)
    mixed.step(np.array([0.0, 0.0, 0.0, 1.0]))
    mixed.step(np.array([0.0, 0.0, 0.0, -1.0]))
    assert [touch.radius for touch in mixed.touches] == [0.003, 0.0]
    felt = [int((touch.outcomes == OBJECT).sum()) for touch in mixed.touches]
    expected = [2.54e-4] * felt[0] + [1e-3] * felt[1]
    assert mixed.contacts.position_error.tolist() == pytest.approx(expected)


def test_an_environment_of_several_sensors_keeps_gymnasiums_contract():
    made = gymnasium.make(
        "palpate/Probe-v0",
        library=("stapler",),
        sensor=("ray", "ball"),
        max_probes=3,
        limits=CUT_SHORT,
    )
    check_env(made.unwrapped, skip_render_check=True)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"sensor": ()}, "there is no sensor"),
        ({"sensor": ("ray", "nose")}, "no sensor is called 'nose'"),
        ({"sensor": ("ray", "range"), "radius": 0.001}, "'ray, range' has no radius"),
        ({"sensor": ("ray", "ball"), "force_threshold": 1.0}, "'ray, ball' has no force_threshold"),
    ],
)
def test_a_mixture_that_cannot_be_is_refused(options, words):
    with pytest.raises(ValueError, match=words):
        ProbeEnv(("stapler",), **options)
