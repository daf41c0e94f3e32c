"""Beside Gymnasium's own tools: every environment with every sensor, copied, spawned, wrapped."""

from __future__ import annotations

import copy
import hashlib
import pickle

import gymnasium
import numpy as np
import pytest
import trimesh
from gymnasium.utils.env_checker import check_env
from gymnasium.wrappers import RecordEpisodeStatistics
from helpers.digests import bytes_of
from helpers.episodes import CUT_SHORT
from helpers.processes import printed_by
from oracles.solids import scaled

import palpate.envs
from palpate.assets import mesh_path
from palpate.envs import ENV_ID, FINGER_ENV_ID, PLANAR_ENV_ID, REST_ENV_ID
from palpate.envs.collision.collision import worked_out_parts
from palpate.envs.probe_env import ProbeEnv
from palpate.envs.scene.drop import DropScene
from palpate.envs.truth import Truth
from palpate.recognizer import Polyhedron

gymnasium.register_envs(palpate.envs)

IDS = (ENV_ID, REST_ENV_ID, FINGER_ENV_ID, PLANAR_ENV_ID)
ONE = {"library": ("simple-hand",)}
SETTINGS = {
    "ray": (ENV_ID, {**ONE, "use_free_space": True}),
    "gaussian": (ENV_ID, {**ONE, "distribution": "gaussian", "placement": "dropped"}),
    "ball": (ENV_ID, {**ONE, "sensor": "ball"}),
    "ball-dropped": (ENV_ID, {**ONE, "sensor": "ball", "placement": "dropped"}),
    "range": (ENV_ID, {**ONE, "sensor": "range", "placement": "resting"}),
    "range-grid": (ENV_ID, {**ONE, "sensor": "range-grid"}),
    "rest": (REST_ENV_ID, {"library": ("housing-34", "simple-hand")}),
    "rest-dropped": (REST_ENV_ID, {**ONE, "placement": "dropped"}),
    "finger": (FINGER_ENV_ID, ONE),
    "finger-dropped": (FINGER_ENV_ID, {**ONE, "placement": "dropped", "distribution": "gaussian"}),
    "planar": (PLANAR_ENV_ID, {}),
}
every_id = pytest.mark.parametrize("env_id", IDS)
every_setting = pytest.mark.parametrize("name", SETTINGS)


def make(name):
    env_id, arguments = SETTINGS[name]
    return gymnasium.make(env_id, max_probes=6, limits=CUT_SHORT, **arguments).unwrapped


def quick(env_id):
    """Arguments with which an environment takes little time."""
    return {"max_probes": 3, "limits": CUT_SHORT, **({} if env_id == PLANAR_ENV_ID else ONE)}


def actions(env, seed, count):
    return np.random.default_rng([seed, 9]).uniform(-1, 1, (count, *env.action_space.shape))


def step_digest(env, told):
    """Of what a step gave, of what it touched, of the whole belief and of the random stream."""
    held = [
        (h.object_name, h.T_world_object, h.pose.as_matrix(), h.weight, h.interpretations)
        for h in (env.belief.hypotheses if env.belief else ())
    ]
    state = repr(env.np_random.bit_generator.state)
    return hashlib.sha256(bytes_of([list(told), env.touches[-1:], held, state])).hexdigest()


def step_digests(env, seed, steps=3):
    digests = [step_digest(env, env.reset(seed=seed))]
    return digests + [step_digest(env, env.step(action)) for action in actions(env, seed, steps)]


def session():
    """Digests of two episodes in each setting, by name."""
    return {name: [step_digests(env := make(name), 0), step_digests(env, 1)] for name in SETTINGS}


@pytest.fixture(scope="module")
def played():
    return session()


@every_setting
def test_an_episode_is_the_same_to_the_bit_whatever_was_played_before(name, played):
    env = make(name)
    assert [step_digests(env, 1), step_digests(env, 1), step_digests(env, 0)] == [
        played[name][row] for row in (1, 1, 0)
    ]
    assert played[name][0] != played[name][1]


@every_setting
def test_a_copy_goes_on_in_the_middle_of_an_episode_to_the_bit(name, played):
    """Three ways to copy; the second step is the last that they share."""
    env = make(name)
    for seed in (0, 1):
        env.reset(seed=seed)
        *before, last = actions(env, seed, 3)
        for action in before:
            env.step(action)
        env.render_mode = None
        copies = [pickle.loads(pickle.dumps(env)), copy.deepcopy(env)]
        copies.append(pickle.loads(pickle.dumps(copies[0])))
        # What one does is nothing to another.
        for one in (*copies, env):
            assert step_digest(one, one.step(last)) == played[name][seed][-1]
        assert len({step_digest(one, one.reset()) for one in (*copies, env)}) == 1


def test_another_process_plays_the_same_episodes_to_the_bit(played):
    program = "from test_gymnasium import session; print(repr(session()))"
    assert printed_by(program, beside=__file__).strip() == repr(played)


@every_id
def test_the_contract_is_kept_without_a_display(env_id):
    made = gymnasium.make(env_id, **quick(env_id)).unwrapped
    check_env(made, skip_render_check=made.render_mode is None)


@pytest.mark.filterwarnings("ignore:.*unconventional shape")  # which its own extractor flattens
@every_id
def test_stable_baselines_finds_nothing_wrong(env_id):
    checker = pytest.importorskip("stable_baselines3.common.env_checker")
    checker.check_env(gymnasium.make(env_id, **quick(env_id)).unwrapped)


@every_id
def test_vectors_play_what_single_environments_play(env_id):
    envs = gymnasium.make_vec(env_id, num_envs=2, vectorization_mode="sync", **quick(env_id))
    singles = [gymnasium.make(env_id, **quick(env_id)) for _ in range(2)]
    seen, _ = envs.reset(seed=3)
    alone = [env.reset(seed=seed)[0] for env, seed in zip(singles, (3, 4), strict=True)]
    for action in (None, *actions(singles[0].unwrapped, 0, 2)):
        if action is not None:
            seen, rewards, *_ = envs.step(np.array([action, action], np.float32))
            alone = [env.step(action.astype(np.float32))[0] for env in singles]
            assert rewards.tolist() == [-1.0, -1.0]
        for key, values in seen.items():
            assert np.array_equal(values, np.stack([one[key] for one in alone]))
    envs.close()


def test_spawned_processes_play_what_single_environments_play():
    """One process an environment, of all ids that share their spaces."""
    arguments = quick(REST_ENV_ID)

    def maker(env_id):
        return lambda: gymnasium.make(f"palpate.envs:{env_id}", **arguments)

    ids = (REST_ENV_ID, FINGER_ENV_ID)
    envs = gymnasium.vector.AsyncVectorEnv([maker(one) for one in ids], context="spawn")
    singles = [maker(one)() for one in ids]
    envs.reset(seed=5)
    for seed, env in enumerate(singles, 5):
        env.reset(seed=seed)
    (action,) = actions(singles[0].unwrapped, 0, 1).astype(np.float32)
    seen, *_ = envs.step(np.array([action, action]))
    alone = [env.step(action)[0] for env in singles]
    for key, values in seen.items():
        assert np.array_equal(values, np.stack([one[key] for one in alone]))
    envs.close()


@every_id
def test_statistics_are_those_of_the_episode(env_id):
    env = RecordEpisodeStatistics(gymnasium.make(env_id, **quick(env_id)))
    env.reset(seed=0)
    steps, over, info = 0, False, {}
    while not over:
        _, _, terminated, truncated, info = env.step(0.0 * env.action_space.sample() + 1.0)
        steps, over = steps + 1, terminated or truncated
    assert (info["episode"]["l"], info["episode"]["r"]) == (steps, -steps)


def block(*sides):
    return Polyhedron.from_mesh(trimesh.creation.box(sides), name="block")


def contacts_on(model, **arguments):
    """How many contacts two short episodes make; every observation is in its space.

    The first probe of each is aimed at the plane below the object's middle, so that rays meet what
    is as thin as a needle too.
    """
    env = ProbeEnv((model,), limits=CUT_SHORT, max_probes=4, **arguments)
    contacts = 0
    for seed in range(2):
        _, info = env.reset(seed=seed)
        pose = Truth.of(env.library, info).T_world_object
        aimed = np.append(pose.apply(model.centroid)[:2] / env.half_width, 0.0)
        for action in (aimed, *(0.5 * actions(env, seed, 3))):
            observation, *_ = env.step(action)
            assert env.observation_space.contains(observation)
            assert all(np.isfinite(value).all() for value in observation.values())
        contacts += len(env.contacts)
    return contacts


@pytest.mark.parametrize("sensor", ["ray", "ball", "range-grid"])
@pytest.mark.parametrize("placement", ["across", "dropped"])
@pytest.mark.parametrize("diameter", [1.0001e-3, 9.9999])
def test_the_smallest_and_the_largest_objects_are_touched(diameter, placement, sensor):
    radius = {"radius": 0.02 * diameter} if sensor == "ball" else {}
    model = scaled("simple-hand", diameter)
    error = 1e-3 * diameter
    arguments = {"sensor": sensor, "placement": placement, "position_error": error, **radius}
    assert contacts_on(model, **arguments) > 2


@pytest.mark.parametrize("sensor", ["ray", "ball", "finger"])
@pytest.mark.parametrize("sides", [(0.1, 0.08, 1e-5), (0.1, 1e-4, 1e-4), (7.0, 7.0, 1e-3)])
@pytest.mark.parametrize("placement", ["resting", "dropped"])
def test_flat_and_needle_like_objects_are_touched(sides, placement, sensor):
    assert contacts_on(block(*sides), sensor=sensor, placement=placement) > 0


@pytest.mark.parametrize("diameter", [0.9999e-3, 10.001])
def test_objects_beyond_these_sizes_are_refused_before_anything_is_played(diameter):
    fine = Polyhedron.from_mesh(mesh_path("simple-hand"), name="simple-hand")
    with pytest.raises(ValueError, match=r"scaled.*from 0.001 to 10 m. Are the units metres"):
        ProbeEnv((fine, scaled("simple-hand", diameter)))


def test_a_needle_too_thin_to_be_dropped_is_refused():
    needle = block(0.1, 1e-5, 1e-5)
    with pytest.raises(ValueError, match="block is too thin to be dropped"):
        ProbeEnv((needle,), placement="dropped").reset(seed=0)
    # Placed without a drop it can be probed.
    contacts_on(needle, placement="resting", sensor="ball")


def test_a_needle_comes_to_rest_on_its_side():
    needle = block(0.1, 1e-4, 1e-4)
    rng = np.random.default_rng(0)
    scene = DropScene(needle, worked_out_parts(needle).parts)
    assert abs(scene.drop(rng).face.normal[0]) < 1e-6


@pytest.mark.parametrize("sensor", ["ray", "ball"])
def test_bounds_may_be_as_wide_as_the_object(sensor):
    model = scaled("simple-hand", 0.1)
    assert contacts_on(model, sensor=sensor, position_error=0.1, normal_error=np.pi / 2) > 2
