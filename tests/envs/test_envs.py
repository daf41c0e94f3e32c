"""The environment: Gymnasium's contract, the scene against geometry, noise inside its bounds."""

from __future__ import annotations

import hashlib
import pickle
from dataclasses import replace

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from helpers.episodes import CUT_SHORT, digest, play
from helpers.processes import printed_by

import palpate.envs
from palpate.envs.probe_env import ProbeEnv
from palpate.envs.scene.placement import AcrossPlane
from palpate.envs.scene.scene import OBJECT, PLANE, ProbeScene
from palpate.envs.sensors.noise import SensorNoise, uniform_in_ball, uniform_in_cone
from palpate.envs.sensors.ray_sensor import RaySensor
from palpate.envs.sensors.touch import ProbeCommand, triad
from palpate.envs.truth import Truth
from palpate.policies import make_policy
from palpate.recognizer import Polyhedron, pose_difference
from palpate.recognizer.models.rays import cast_rays
from palpate.scripts.benchmark.playing import task_of

gymnasium.register_envs(palpate.envs)

SMALL = ("housing-34", "simple-hand")
READY = RaySensor(SensorNoise(position_error=1e-3, normal_error=0.1), 0.4)

every_ball = pytest.mark.parametrize("sensor", ["ball", "finger"])


def small_env() -> ProbeEnv:
    """Normals nearer than the default's: few hypotheses, which takes the recogniser less long."""
    return ProbeEnv(SMALL, max_probes=6, normal_error=0.1)


@pytest.fixture(scope="module")
def env() -> ProbeEnv:
    return small_env()


@pytest.fixture(scope="module")
def housing(env) -> Polyhedron:
    return env.library[0]


def test_the_environment_keeps_gymnasiums_contract():
    made = gymnasium.make("palpate/Probe-v0", library=SMALL, max_probes=6)
    check_env(made.unwrapped, skip_render_check=True)


@every_ball
def test_the_environment_keeps_the_contract_with_balls_too(sensor):
    made = gymnasium.make(
        "palpate/Probe-v0", library=SMALL[1:], sensor=sensor, max_probes=3, limits=CUT_SHORT
    )
    check_env(made.unwrapped, skip_render_check=True)


@every_ball
def test_a_copy_by_pickle_plays_the_same_episode_to_the_bit(sensor):
    env = ProbeEnv(SMALL[1:], sensor=sensor, max_probes=4, limits=CUT_SHORT)
    first = digest(env, 0)
    copy = pickle.loads(pickle.dumps(env))
    assert digest(copy, 0) == digest(env, 0) == first
    assert digest(copy, 1) == digest(env, 1) != first


@every_ball
def test_what_balls_touch_is_recognised_with_the_truth_among_it(sensor):
    env = ProbeEnv(SMALL[1:], sensor=sensor, position_error=1e-4, normal_error=0.05)
    assert env.recognizer.features("simple-hand").edge_count > 0
    env.reset(seed=0)
    *_, info = env.step(np.random.default_rng(0).uniform(-1, 1, 3))
    truth = Truth.of(env.library, info)
    assert len(env.contacts) == 3
    assert env.belief is not None
    errors = [
        pose_difference(truth.model, h.pose, truth.T_world_object)
        for h in env.belief.hypotheses
        if h.determined
    ]
    free = [h for h in env.belief.hypotheses if not h.determined]
    assert free or min(error.rotation for error in errors) < 0.05


def test_a_ready_sensor_is_taken_as_it_is():
    env = ProbeEnv(SMALL[1:], sensor=READY, max_probes=3, limits=CUT_SHORT)
    assert env.sensors == (READY,)
    for observation in play(env, 0, 3)[0]:
        assert env.observation_space.contains(observation)
    assert set(env.contacts.position_error) <= {1e-3}
    assert set(env.contacts.normal_error) <= {0.1}


def test_a_sensor_may_send_fewer_rays_than_it_says():
    class Fickle:
        noise, rays, features = READY.noise, 4, "faces"

        def touch(self, scene, command, rng):
            touch = READY.touch(scene, command, rng)
            rays = int(rng.integers(1, 4))
            hit = touch.outcomes[:rays] == OBJECT
            return replace(
                touch,
                contacts=touch.contacts[: hit.sum()],
                starts_world=touch.starts_world[:rays],
                ends_world=touch.ends_world[:rays],
                outcomes=touch.outcomes[:rays],
            )

    env = ProbeEnv(SMALL[1:], sensor=Fickle(), max_probes=5, limits=CUT_SHORT)  # pyright: ignore
    observation = play(env, 3, 5)[0][-1]
    sent = sum(len(touch.outcomes) for touch in env.touches)
    assert sent < 3 * len(env.touches)
    assert observation["ray_count"][0] == sent
    assert observation["ray_outcomes"].shape == (20,)
    outcomes = np.concatenate([touch.outcomes for touch in env.touches])
    assert np.array_equal(observation["ray_outcomes"][:sent], outcomes)
    assert not observation["ray_outcomes"][sent:].any()


def test_the_recogniser_is_told_of_free_space_if_that_is_asked_for():
    plain, told = (
        ProbeEnv(SMALL[1:], max_probes=4, limits=CUT_SHORT, use_free_space=use)
        for use in (False, True)
    )
    for env, paths in ((plain, 0), (told, 12)):
        env.reset(seed=0)
        for action in ([0.1, 0.0, 0.0], [0.0, 0.1, 0.3], [-0.1, 0.0, 0.5], [1.0, 1.0, 0.0]):
            env.step(np.array(action))
        assert env.belief is not None
        assert len(env.belief.free_space) == paths


def test_the_environment_is_made_by_its_name():
    made = gymnasium.make("palpate/Probe-v0", library=SMALL, max_probes=2)
    observation, info = made.reset(seed=0)
    assert made.observation_space.contains(observation)
    assert info["truth"]["object"] in SMALL


def test_every_observation_lies_in_its_space(env):
    for seed in (0, 3, 4, 6, 7):
        for observation in play(env, seed)[0]:
            assert env.observation_space.contains(observation)


def test_two_observations_share_no_memory(env):
    first, second = play(env, 0)[0][-2:]
    assert not any(np.shares_memory(first[key], second[key]) for key in first)


def test_the_same_seed_gives_the_same_episode_to_the_bit(env):
    other = small_env()
    for seed in (0, 4, 6):
        assert digest(env, seed) == digest(env, seed) == digest(other, seed)
    assert digest(env, 0) != digest(env, 4)


def test_another_process_plays_the_same_episode_to_the_bit(env):
    program = (
        "import hashlib; from helpers.episodes import digest; from test_envs import small_env\n"
        "print(hashlib.sha256(digest(small_env(), 3)).hexdigest())"
    )
    printed = printed_by(program, beside=__file__)
    assert printed.strip() == hashlib.sha256(digest(env, 3)).hexdigest()


def test_an_episode_leaves_numpys_global_state_alone(env):
    before = pickle.dumps(np.random.get_state())  # noqa: NPY002
    play(env, 4)
    assert pickle.dumps(np.random.get_state()) == before  # noqa: NPY002


def test_a_hundred_resets_keep_nothing(env):
    import gc

    def objects() -> int:
        gc.collect()
        return len(gc.get_objects())

    for seed in range(10):
        env.reset(seed=seed)
    before = objects()
    for seed in range(100):
        env.reset(seed=seed)
    assert objects() - before < 50


def test_the_episode_ends_with_its_last_probe_at_the_latest(env):
    env.reset(seed=0)
    away = np.array([1.0, 1.0, 0.0])
    ends = [env.step(away)[3] for _ in range(6)]
    assert ends == [False] * 5 + [True]


def test_an_action_beyond_the_box_is_taken_to_its_edge(env):
    def rays(action):
        env.reset(seed=5)
        return env.step(np.array(action))[0]["ray_ends"]

    assert np.array_equal(rays([7.0, -9.0, 2.0]), rays([1.0, -1.0, 1.0]))


@pytest.mark.parametrize("action", [[0.0, 0.0], [np.nan, 0.0, 0.0], [[0.0, 0.0, 0.0]]])
def test_an_action_that_is_none_is_refused(env, action):
    env.reset(seed=0)
    with pytest.raises(ValueError, match="three finite numbers"):
        env.step(np.array(action))


def test_a_step_before_the_first_reset_is_refused():
    with pytest.raises(gymnasium.error.ResetNeeded):
        ProbeEnv(("simple-hand",)).step(np.zeros(3))


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"object_name": "spoon"}, "'spoon'.*housing-34, simple-hand"),
        ({"position_error": 0.0}, "above zero"),
        ({"position_error": -1.0}, "above zero"),
        ({"position_error": float("nan")}, "above zero"),
        ({"normal_error": 0.0}, "above 0"),
        ({"normal_error": 2.0}, "at most pi/2"),
        ({"max_probes": 0}, "max_probes is 0"),
        ({"sensor": "sonar"}, "'sonar'; there are: ray, ball, finger"),
        ({"radius": 0.001}, "'ray' has no radius"),
        ({"sensor": "ball", "radius": 1.0}, "smaller tip"),
        ({"sensor": READY, "radius": 0.001}, "a ready sensor has its own"),
        ({"distribution": "normal"}, "'uniform' or 'gaussian'"),
        ({"library": ()}, "empty"),
        ({"library": ("spoon",)}, "spoon"),
        ({"library": "no/such/folder"}, "no/such/folder"),
    ],
)
def test_a_wrong_argument_is_named(arguments, words):
    with pytest.raises(ValueError, match=words):
        ProbeEnv(**{"library": SMALL, **arguments})


def test_bounds_below_the_simulations_rounding_are_refused():
    env = ProbeEnv(("simple-hand",), position_error=1e-9)
    env.reset(seed=0)
    with pytest.raises(ValueError, match="exact to"):
        env.step(np.zeros(3))


def test_the_object_lies_across_the_plane(housing):
    rng = np.random.default_rng(0)
    placement = AcrossPlane(offset=0.01)
    for _ in range(200):
        pose = placement.draw(rng, housing)
        heights = pose.apply(housing.vertices)[:, 2]
        sunk = -heights.min() / np.ptp(heights)
        assert 0.1 - 1e-9 <= sunk <= 0.5 + 1e-9
        assert np.linalg.norm(pose.apply(housing.centroid)[:2]) <= 0.01 + 1e-12


def test_a_triad_is_orthogonal_and_points_down():
    for yaw in np.linspace(-4, 4, 9):
        starts, directions = triad(0.3, -0.2, yaw, 0.5)
        assert np.allclose(starts + 0.5 * directions, [0.3, -0.2, 0.0], atol=1e-12)
        assert np.allclose(directions @ directions.T, np.eye(3), atol=1e-12)
        assert np.allclose(directions[:, 2], -np.sqrt(1 / 3))


def test_rays_meet_what_geometry_says_they_meet(env):
    """MuJoCo's rays against our own caster, and the plane against arithmetic."""
    rng = np.random.default_rng(1)
    met = 0
    for model in env.library:
        scene = ProbeScene(model)
        for _ in range(20):
            scene.place(AcrossPlane(offset=0.02).draw(rng, model))
            for x, y in rng.uniform(-0.08, 0.08, (10, 2)):
                starts, directions = triad(x, y, rng.uniform(-1, 1), 0.5)
                readings = scene.cast(starts, directions)
                hits = cast_rays(model, scene.T_world_object, starts, directions)
                first = hits.hit & (hits.distances < 0.5)
                met += int(first.sum())
                clear = np.abs(hits.distances - 0.5) > 1e-5
                assert np.array_equal((readings.outcomes == OBJECT)[clear], first[clear])
                assert (readings.outcomes[clear & ~first] == PLANE).all()
                sure = first & clear
                assert np.allclose(readings.ends_world[sure], hits.points_world[sure], atol=1e-6)
                assert np.allclose(
                    readings.normals_world[sure], hits.normals_world[sure], atol=1e-5
                )
                assert np.allclose(readings.ends_world[~first & clear], [x, y, 0.0], atol=1e-9)
    assert met > 200


def test_what_the_sensor_reports_is_within_the_bounds_it_states(env):
    """At bounds so tight that the simulation's own rounding would show."""
    rng = np.random.default_rng(2)
    noise = SensorNoise(position_error=1e-6, normal_error=1e-3)
    seen = 0
    for model in env.library:
        scene, sensor = ProbeScene(model), RaySensor(noise, 0.5)
        for _ in range(100):
            scene.place(AcrossPlane(offset=0.01).draw(rng, model))
            x, y = rng.uniform(-0.03, 0.03, 2)
            touch = sensor.touch(scene, ProbeCommand(x, y, 0.3), rng)
            _, directions = triad(x, y, 0.3, 0.5)
            hits = cast_rays(model, scene.T_world_object, touch.starts_world, directions)
            hit = touch.outcomes == OBJECT
            apart = np.linalg.norm(touch.contacts.positions - hits.points_world[hit], axis=1)
            lean = (touch.contacts.normals * hits.normals_world[hit]).sum(axis=1)
            # A ray through an edge may meet either face; none of these does.
            assert (apart <= noise.position_error).all()
            assert (np.arccos(np.clip(lean, -1, 1)) <= noise.normal_error).all()
            seen += len(touch.contacts)
    assert seen > 200


def test_noise_fills_its_ball_and_its_cone_evenly():
    rng = np.random.default_rng(3)
    shifts = uniform_in_ball(rng, 20_000, 2.0)
    lengths = np.linalg.norm(shifts, axis=1)
    assert lengths.max() <= 2.0
    # Shares of volume within a radius go with its cube.
    for share in (0.1, 0.5, 0.9):
        assert np.mean(lengths < 2.0 * share ** (1 / 3)) == pytest.approx(share, abs=0.015)
    assert np.abs(shifts.mean(axis=0)).max() < 0.03

    axes = np.tile([0.6, 0.0, 0.8], (20_000, 1))
    leaning = uniform_in_cone(rng, axes, 0.4)
    angles = np.arccos(np.clip((leaning * axes).sum(axis=1), -1, 1))
    assert np.allclose(np.linalg.norm(leaning, axis=1), 1.0)
    assert angles.max() <= 0.4
    for share in (0.1, 0.5, 0.9):
        edge = np.arccos(1 - share * (1 - np.cos(0.4)))
        assert np.mean(angles < edge) == pytest.approx(share, abs=0.015)


def test_too_large_an_object_is_refused_with_a_hint_at_units(housing):
    import trimesh

    large = trimesh.Trimesh(1e3 * housing.vertices, housing.triangles)
    with pytest.raises(ValueError, match="Are the units metres"):
        ProbeScene(Polyhedron.from_mesh(large, name="large"))


def test_a_folder_of_meshes_is_a_library(tmp_path):
    import trimesh

    trimesh.creation.box((0.05, 0.06, 0.07)).export(tmp_path / "block.stl")
    trimesh.creation.icosahedron().apply_scale(0.03).export(tmp_path / "gem.obj")
    env = ProbeEnv(tmp_path, object_name="gem", max_probes=3)
    assert [model.name for model in env.library] == ["block", "gem"]
    assert play(env, 0)[1]["truth"]["object"] == "gem"


def test_the_docstring_names_the_defaults_that_hold():
    import inspect

    documented = ProbeEnv.__doc__ or ""
    for name, parameter in inspect.signature(ProbeEnv).parameters.items():
        row = next(line for line in documented.splitlines() if f"| {name} |" in line)
        value = "pi / 10" if name == "normal_error" else str(parameter.default)
        assert f"| {value} |" in row, name


def test_the_random_policy_acts_in_the_box_and_by_its_generator(env):
    policy = make_policy("random", task_of(env))
    observation, _ = env.reset(seed=0)
    actions = [policy.act(observation, np.random.default_rng(7)) for _ in range(2)]
    assert np.array_equal(actions[0], actions[1])
    assert env.action_space.contains(actions[0])


@pytest.mark.parametrize("placement", ["resting", "dropped"])
def test_an_object_that_rests_stands_on_the_plane_and_is_never_lost(placement):
    env = ProbeEnv(SMALL, placement=placement, max_probes=12)
    rng, felt = np.random.default_rng(11), 0
    for seed in range(4):
        _, info = env.reset(seed=seed)
        truth = Truth.of(env.library, info)
        lowest = truth.T_world_object.apply(truth.model.vertices)[:, 2].min()
        assert abs(lowest) < 1e-9
        ended = False
        while not ended:
            _, _, unique, over, _ = env.step(rng.uniform(-1, 1, 3))
            ended = unique or over
        if env.belief is not None:
            names = {hypothesis.object_name for hypothesis in env.belief.hypotheses}
            assert truth.model.name in names
            felt += 1
    assert felt >= 3


@pytest.mark.parametrize("sensor", ["range", "range-grid"])
def test_range_sensors_are_made_by_their_names(sensor):
    env = ProbeEnv(SMALL, sensor=sensor, placement="resting", max_probes=2)
    observation = play(env, 1, 2)[0][-1]
    assert env.observation_space.contains(observation)
    assert observation["contact_count"][0] > 3


def test_a_placement_that_there_is_not_is_refused():
    with pytest.raises(ValueError, match="'across', 'resting' or 'dropped'"):
        ProbeEnv(SMALL, placement="floating")  # pyright: ignore[reportArgumentType]
