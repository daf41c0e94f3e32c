"""The planar environment: Gymnasium's contract, and the truth kept."""

from __future__ import annotations

import inspect
import pickle
from itertools import pairwise

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from helpers.episodes import digest, play
from oracles.outlines import OUTLINES
from scipy.spatial.transform import Rotation

import palpate.envs
from palpate.envs.planar import planar_env
from palpate.envs.planar.library import load_outlines
from palpate.envs.planar.planar_env import PlanarProbeEnv
from palpate.envs.planar.rays import cast_planar_rays
from palpate.envs.scene.scene import NOTHING, OBJECT
from palpate.envs.truth import Truth
from palpate.recognizer import Polygon

gymnasium.register_envs(palpate.envs)

ID = "palpate/ProbePlanar-v0"


@pytest.fixture(scope="module")
def env() -> PlanarProbeEnv:
    return PlanarProbeEnv(max_probes=30)


def test_the_environment_keeps_gymnasiums_contract():
    # Mode "human" opens a window, which a test can't; see `test_planar_picture`.
    check_env(gymnasium.make(ID, max_probes=6).unwrapped, skip_render_check=True)


def test_the_environment_is_made_by_its_name_and_takes_outlines():
    square = Polygon.from_corners(OUTLINES["l-shape"], name="mine")
    made = gymnasium.make(ID, library=[square], position_error=0.02, max_probes=2)
    observation, info = made.reset(seed=0)
    assert made.observation_space.contains(observation)
    assert info["truth"]["object"] == "mine"


def test_every_observation_lies_in_its_space_and_shares_no_memory(env):
    for seed in range(5):
        trace, _ = play(env, seed)
        for observation in trace:
            assert env.observation_space.contains(observation)
        for first, second in pairwise(trace):
            assert not any(np.shares_memory(first[key], second[key]) for key in first)


def test_the_same_seed_gives_the_same_episode_to_the_bit(env):
    other, before = PlanarProbeEnv(max_probes=30), pickle.dumps(np.random.get_state())  # noqa: NPY002
    for seed in range(3):
        assert digest(env, seed) == digest(env, seed) == digest(other, seed)
    assert digest(env, 0) != digest(env, 1)
    assert pickle.dumps(np.random.get_state()) == before  # noqa: NPY002


def test_a_pickled_environment_goes_on_where_it_was(env):
    env.reset(seed=4)
    env.step(np.array([0.1, 0.05]))
    copy = pickle.loads(pickle.dumps(env))
    for action in ([0.4, 0.0], [-0.7, 0.1]):
        one, other = (each.step(np.array(action))[0] for each in (env, copy))
        assert all(np.array_equal(one[key], other[key]) for key in one)


def truth_of(env) -> Truth:
    """Where the outline lies: it stays there until the next reset."""
    return Truth.of(env.library, env._info())


def true_edges(env):
    """(n,) the edge that each contact so far was really on."""
    truth = truth_of(env)
    outline_, pose = truth.model, truth.T_world_object
    rows = [touch for touch in env.touches if touch.outcome == OBJECT]
    starts = np.array([touch.start_world for touch in rows])
    approaches = np.array([touch.contacts.approaches[0] for touch in rows])
    return cast_planar_rays(outline_, pose, starts, approaches).edges


def is_held(env) -> bool:
    """Whether some hypothesis has the true interpretation and, if it fixes the pose, that too."""
    known, edges = truth_of(env), true_edges(env)
    truth, pose = known.model, known.T_world_object
    centroid = np.append(truth.centroid, 0.0)
    for hypothesis in env.belief.hypotheses:
        if hypothesis.object_name != truth.name:
            continue
        if (hypothesis.interpretations == edges).all(axis=1).any():
            between = (hypothesis.pose.rotation.inv() * pose.rotation).as_matrix()[:2, :2]
            turns = [np.trace(between @ turn) / 2.0 for turn in truth.symmetries]
            apart = np.linalg.norm(hypothesis.pose.apply(centroid) - pose.apply(centroid))
            most = env.recognizer.tolerance.distance(truth.diameter, env.contacts.position_error[0])
            near = np.arccos(min(max(turns), 1.0)) < np.radians(6.0) and apart < 2.0 * most
            return near or not hypothesis.determined
    return False


@pytest.mark.parametrize(
    ("position_error", "normal_error"), [(2.54e-3, np.pi / 8), (2.54e-4, np.pi / 10), (1e-3, 1.5)]
)
def test_the_truth_is_never_lost(position_error, normal_error):
    env = PlanarProbeEnv(position_error=position_error, normal_error=normal_error, max_probes=12)
    ended = 0
    for seed in range(25):
        rng = np.random.default_rng(seed)
        env.reset(seed=seed)
        terminated = truncated = False
        while not (terminated or truncated):
            *_, terminated, truncated, _ = env.step(rng.uniform(-1, 1, 2))
            assert env.belief is None or is_held(env), seed
        ended += terminated
    assert ended >= (5 if normal_error < 1.0 else 0)


@pytest.mark.parametrize("scale", [1e-3, 1.0, 10.0])
def test_small_and_large_outlines_are_probed_alike(scale):
    """In their own units all episodes are the same."""
    shapes = [
        Polygon.from_corners(scale * np.array(OUTLINES[name], float), name=name)
        for name in ("triangle", "l-shape")
    ]
    env = PlanarProbeEnv(shapes, position_error=0.01 * scale, max_probes=8)
    for seed in range(5):
        rng = np.random.default_rng(seed)
        observation, _ = env.reset(seed=seed)
        for _ in range(8):
            observation, *_ = env.step(rng.uniform(-1, 1, 2))
            assert env.belief is None or is_held(env)
        counts = observation["contact_count"][0], observation["hypothesis_count"][0]
        assert counts[1] > 0
        starts = observation["ray_starts"] / scale
        assert np.abs(starts).max() < 2.1 * max(shape.diameter for shape in shapes) / scale


def test_extreme_actions_are_taken_to_the_edge_of_the_box(env):
    def last_ray(action):
        env.reset(seed=5)
        return env.step(np.array(action))[0]["ray_starts"][0]

    assert np.array_equal(last_ray([7.0, -1e300]), last_ray([1.0, -1.0]))


def test_an_outline_that_is_passed_by_leaves_the_belief_alone(env):
    env.reset(seed=0)
    observation, reward, terminated, truncated, _ = env.step(np.array([0.0, 1.0]))
    assert reward == -1.0
    assert not terminated
    assert not truncated
    assert env.belief is None
    assert observation["ray_outcomes"][0] == NOTHING
    assert observation["contact_count"][0] == observation["hypothesis_count"][0] == 0
    assert (observation["hypothesis_objects"] == -1).all()


def test_an_episode_ends_with_its_last_probe_and_may_be_stepped_on():
    env = PlanarProbeEnv(max_probes=3)
    env.reset(seed=0)
    away = np.array([0.0, 1.0])
    assert [env.step(away)[3] for _ in range(5)] == [False, False, True, True, True]
    assert env.observation_space.contains(env.step(np.array([0.3, 0.0]))[0])


def test_the_observation_shows_what_the_belief_holds(env):
    trace, _ = play(env, 7, probes=3)
    observation, belief = trace[-1], env.belief
    assert observation["hypothesis_count"][0] == len(belief.hypotheses) > 1
    assert observation["interpretation_count"][0] == belief.interpretations
    for row, hypothesis in enumerate(belief.hypotheses[:16]):
        assert env.library[observation["hypothesis_objects"][row]].name == hypothesis.object_name
        angle = observation["hypothesis_angles"][row]
        turned = Rotation.from_rotvec([0.0, 0.0, angle])
        assert (turned.inv() * hypothesis.pose.rotation).magnitude() < 1e-9
        position = observation["hypothesis_positions"][row]
        assert np.allclose(position, hypothesis.pose.translation[:2])


def test_outlines_start_where_the_description_says():
    env = PlanarProbeEnv()
    far, angles, names = [], [], set()
    for seed in range(400):
        _, info = env.reset(seed=seed)
        truth = Truth.of(env.library, info)
        pose, model = truth.T_world_object, truth.model
        far.append(np.linalg.norm(pose.apply(np.append(model.centroid, 0.0))) / env.half_width)
        assert np.array_equal(info["truth"]["pose"], pose.as_matrix())
        angles.append(pose.rotation.as_rotvec()[2])
        names.add(info["truth"]["object"])
    assert 0.18 < max(far) <= 0.2 + 1e-12
    assert np.ptp(angles) > 6.0
    assert names == {"wrench", "gator", "hand"}


@pytest.mark.parametrize("action", [[0.0], [np.nan, 0.0], [0.0, np.inf], [[0.0, 0.0]]])
def test_an_action_that_is_none_is_refused(env, action):
    env.reset(seed=0)
    with pytest.raises(ValueError, match="two finite numbers"):
        env.step(np.array(action))


def test_nothing_goes_before_the_first_reset():
    env = PlanarProbeEnv(["wrench"], render_mode="rgb_array")
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step(np.zeros(2))
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.render()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"object_name": "spoon"}, "'spoon'.*wrench, gator, hand"),
        ({"library": ["spoon"]}, "spoon"),
        ({"library": []}, "empty"),
        ({"library": "wrench"}, "sequence of names"),
        ({"position_error": 0.0}, "above zero"),
        ({"position_error": 1e-9}, "must be at least"),
        ({"normal_error": 2.0}, "at most pi/2"),
        ({"max_probes": 0}, "max_probes is 0"),
        ({"hypotheses_shown": 0}, "hypotheses_shown is 0"),
        ({"render_mode": "ansi"}, "'ansi'.*rgb_array"),
    ],
)
def test_a_wrong_argument_is_named(arguments, words):
    with pytest.raises(ValueError, match=words):
        PlanarProbeEnv(**arguments)


def test_the_docstring_names_the_defaults_that_hold():
    documented = PlanarProbeEnv.__doc__ or ""
    for name, parameter in inspect.signature(PlanarProbeEnv).parameters.items():
        row = next(line for line in documented.splitlines() if f"| {name} |" in line)
        shown = {"normal_error": "pi / 8", "position_error": "0.00254"}
        assert f"| {shown.get(name, parameter.default)} |" in row, name
    assert inspect.signature(PlanarProbeEnv).parameters["normal_error"].default == np.pi / 8
    assert planar_env.HALF_WIDTH == 0.5
    assert "half the diameter of the library's largest" in documented
    assert planar_env.PLACED == 1 / 5
    assert "a fifth of the half width" in documented
    assert [outline.name for outline in load_outlines()] == ["wrench", "gator", "hand"]
