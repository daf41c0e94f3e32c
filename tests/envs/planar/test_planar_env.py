"""The planar environment: Gymnasium's contract, rays against exact fractions, the truth kept."""

from __future__ import annotations

import inspect
import pickle
from fractions import Fraction
from itertools import pairwise

import gymnasium
import matplotlib.path
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from oracles import outlines as planar_oracles
from scipy.spatial.transform import RigidTransform, Rotation

import palpate.envs
from palpate.envs.pictures import view as picture_view
from palpate.envs.pictures import window
from palpate.envs.planar import planar_env
from palpate.envs.planar.library import load_outlines
from palpate.envs.planar.picture import PlanarPicture, draw_planar
from palpate.envs.planar.planar_env import PlanarProbeEnv
from palpate.envs.planar.probe import PlanarProbe
from palpate.envs.planar.rays import cast_planar_rays
from palpate.envs.scene.scene import NOTHING, OBJECT
from palpate.envs.sensors.noise import SensorNoise
from palpate.recognizer import Polygon

gymnasium.register_envs(palpate.envs)

ID = "palpate/ProbePlanar-v0"
OUTLINES = [*planar_oracles.OUTLINES, "wrench", "gator", "hand"]


def outline(name: str) -> Polygon:
    return planar_oracles.entry(name).model


def random_pose(rng: np.random.Generator, extent: float) -> RigidTransform:
    rotation = Rotation.from_rotvec([0.0, 0.0, rng.uniform(-np.pi, np.pi)])
    return RigidTransform.from_components([*rng.uniform(-extent, extent, 2), 0.0], rotation)


def unit(bearings) -> np.ndarray:
    return np.column_stack([np.cos(bearings), np.sin(bearings)])


@pytest.fixture(scope="module")
def env() -> PlanarProbeEnv:
    return PlanarProbeEnv(max_probes=30)


def play(env, seed, probes=30):
    """Observations of a random episode, and what the last step told."""
    rng = np.random.default_rng(seed)
    observation, info = env.reset(seed=seed)
    trace, ended = [observation], False
    for _ in range(probes):
        observation, _, terminated, truncated, info = env.step(rng.uniform(-1, 1, 2))
        trace.append(observation)
        ended = terminated
        if terminated or truncated:
            break
    return trace, ended, info


def digest(env, seed):
    """All bytes of an episode's observations and of its truth."""
    trace, _, info = play(env, seed)
    parts = [value.tobytes() for observation in trace for value in observation.values()]
    return b"".join(parts) + info["truth"]["pose"].tobytes()


# --- Rays --------------------------------------------------------------------------------------


def first_edge_by_fractions(corners, origin, direction):
    """The depth and the edge where a ray first meets an outline, in exact arithmetic."""
    (ox, oy), (dx, dy) = ([Fraction(float(x)) for x in row] for row in (origin, direction))
    exact = [[Fraction(float(x)) for x in corner] for corner in corners]
    best, edge = None, -1
    for k, (px, py) in enumerate(exact):
        qx, qy = exact[(k + 1) % len(exact)]
        ex, ey = qx - px, qy - py
        scale = dx * ey - dy * ex
        if scale == 0:
            continue
        depth = ((px - ox) * ey - (py - oy) * ex) / scale
        share = ((px - ox) * dy - (py - oy) * dx) / scale
        if depth >= 0 and 0 <= share <= 1 and (best is None or depth < best):
            best, edge = depth, k
    return (np.inf if best is None else float(best)), edge


@pytest.mark.parametrize("name", ["triangle", "l-shape", "comb", "wrench", "hand"])
def test_rays_meet_the_edges_that_exact_fractions_find(name):
    rng, model = np.random.default_rng(0), outline(name)
    middle, size = model.centroid, model.diameter
    origins = middle + 1.5 * size * unit(rng.uniform(-np.pi, np.pi, 40))
    towards = middle + 0.4 * size * rng.normal(size=(40, 2)) - origins
    directions = towards / np.linalg.norm(towards, axis=1, keepdims=True)
    hits = cast_planar_rays(model, RigidTransform.identity(), origins, directions)
    met = 0
    for ray in range(len(origins)):
        depth, edge = first_edge_by_fractions(model.corners, origins[ray], directions[ray])
        assert hits.edges[ray] == edge
        assert hits.distances[ray] == pytest.approx(depth, rel=1e-12)
        met += edge >= 0
    assert 10 < met < 40


@pytest.mark.parametrize("name", OUTLINES)
def test_a_ray_is_outside_before_it_meets_an_outline_and_inside_after(name):
    rng, model = np.random.default_rng(1), outline(name)
    size = model.diameter
    pose = random_pose(rng, size)
    bearings = rng.uniform(-np.pi, np.pi, 200)
    middle = pose.apply(np.append(model.centroid, 0.0))[:2]
    starts = middle - 2.0 * size * unit(bearings)
    starts += rng.uniform(-0.4, 0.4, (200, 1)) * size * unit(bearings + np.pi / 2.0)
    hits = cast_planar_rays(model, pose, starts, unit(bearings))
    ring = pose.apply(np.column_stack([model.corners, np.zeros(model.face_count)]))[:, :2]
    solid = matplotlib.path.Path(np.concatenate([ring, ring[:1]]), closed=True)
    free = np.where(hits.hit, hits.distances, 4.0 * size)
    for share in np.linspace(0.0, 1.0 - 1e-9, 40):
        assert not solid.contains_points(starts + (share * free)[:, None] * unit(bearings)).any()
    met = hits.hit
    beyond = (hits.points_world + 1e-9 * size * unit(bearings))[met]
    # A ray that only clips a corner is out again by then; it would be a rare one.
    assert solid.contains_points(beyond).mean() > 0.99
    assert met.sum() > 50
    assert np.isnan(hits.points_world[~met]).all()
    assert np.isnan(hits.normals_world[~met]).all()
    facing = (hits.normals_world * unit(bearings))[met].sum(axis=1)
    assert (facing < 0.0).all()
    normals = model.normals[hits.edges[met]] @ pose.rotation.as_matrix()[:2, :2].T
    assert np.allclose(hits.normals_world[met], normals)


@pytest.mark.parametrize("name", ["triangle", "square", "hexagon", "70-gon"])
def test_no_ray_slips_through_a_corner(name):
    rng, model = np.random.default_rng(2), outline(name)
    for _ in range(50):
        pose = random_pose(rng, 2.0)
        ring = pose.apply(np.column_stack([model.corners, np.zeros(model.face_count)]))[:, :2]
        middle = pose.apply(np.append(model.centroid, 0.0))[:2]
        directions = (middle - ring) / np.linalg.norm(middle - ring, axis=1, keepdims=True)
        hits = cast_planar_rays(model, pose, ring - directions, directions)
        assert np.allclose(hits.distances, 1.0)


# --- The probe ---------------------------------------------------------------------------------


def test_what_the_probe_reports_is_within_its_bounds_and_fills_them():
    rng, model = np.random.default_rng(3), outline("gator")
    noise = SensorNoise(position_error=1e-3, normal_error=0.3)
    probe, far, lean = PlanarProbe(noise, 2.0 * model.diameter), [], []
    for _ in range(3000):
        pose = random_pose(rng, 0.1 * model.diameter)
        bearing, offset = rng.uniform(-np.pi, np.pi), rng.uniform(-0.3, 0.3) * model.diameter
        touch = probe.touch(model, pose, bearing, offset, rng)
        start, direction = touch.start_world, unit([bearing])
        assert np.linalg.norm(start) == pytest.approx(np.hypot(probe.reach, offset))
        hits = cast_planar_rays(model, pose, start[None], direction)
        assert (touch.outcome == OBJECT) == hits.hit[0] == (len(touch.contacts) == 1)
        if touch.outcome == NOTHING:
            assert np.allclose(touch.end_world, start + 2.0 * probe.reach * direction[0])
            continue
        assert np.allclose(touch.contacts.approaches, direction, atol=1e-15)
        assert np.array_equal(touch.end_world, touch.contacts.positions[0])
        far.append(np.linalg.norm(touch.end_world - hits.points_world[0]))
        one, other = touch.contacts.normals[0], hits.normals_world[0]
        lean.append(np.arctan2(one[0] * other[1] - one[1] * other[0], one @ other))
    assert max(far) <= 1e-3
    assert np.mean(np.array(far) < 0.5e-3) == pytest.approx(0.25, abs=0.04)
    assert np.abs(lean).max() <= 0.3
    assert np.mean(np.array(lean) < 0.15) == pytest.approx(0.75, abs=0.04)


def test_offsets_are_to_the_left_of_the_ray():
    probe = PlanarProbe(SensorNoise(position_error=1e-3, normal_error=0.1), 5.0)
    square = outline("square")
    pose = RigidTransform.identity()
    above = probe.touch(square, pose, 0.0, 0.9, np.random.default_rng(0))
    assert above.start_world == pytest.approx([-5.0, 0.9])
    assert above.outcome == OBJECT
    below = probe.touch(square, pose, np.pi, 0.9, np.random.default_rng(0))
    assert below.start_world == pytest.approx([5.0, -0.9])
    assert below.outcome == NOTHING


# --- The environment ---------------------------------------------------------------------------


def test_the_environment_keeps_gymnasiums_contract():
    # Mode "human" opens a window, which a test can't; its own tests are below.
    check_env(gymnasium.make(ID, max_probes=6).unwrapped, skip_render_check=True)


def test_the_environment_is_made_by_its_name_and_takes_outlines():
    square = Polygon.from_corners(planar_oracles.OUTLINES["l-shape"], name="mine")
    made = gymnasium.make(ID, library=[square], position_error=0.02, max_probes=2)
    observation, info = made.reset(seed=0)
    assert made.observation_space.contains(observation)
    assert info["truth"]["object"] == "mine"


def test_every_observation_lies_in_its_space_and_shares_no_memory(env):
    for seed in range(5):
        trace, _, _ = play(env, seed)
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


def true_edges(env):
    """(n,) the edge that each contact so far was really on."""
    outline_, pose = env.true_object, env.T_world_object
    rows = [touch for touch in env.touches if touch.outcome == OBJECT]
    starts = np.array([touch.start_world for touch in rows])
    approaches = np.array([touch.contacts.approaches[0] for touch in rows])
    return cast_planar_rays(outline_, pose, starts, approaches).edges


def is_held(env) -> bool:
    """Whether some hypothesis has the true interpretation and, if it fixes the pose, that too."""
    truth, pose, edges = env.true_object, env.T_world_object, true_edges(env)
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
        Polygon.from_corners(scale * np.array(planar_oracles.OUTLINES[name], float), name=name)
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
    trace, _, _ = play(env, 7, probes=3)
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
        pose, model = env.T_world_object, env.true_object
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


def test_noise_that_is_not_uniform_is_refused():
    gaussian = SensorNoise(position_error=1e-3, normal_error=0.1, distribution="gaussian")
    with pytest.raises(ValueError, match="uniform, not 'gaussian'"):
        PlanarProbe(gaussian, 1.0)


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


# --- Pictures ----------------------------------------------------------------------------------


def test_a_picture_shows_each_thing_where_it_is():
    square = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    image = draw_planar(
        PlanarPicture(
            outline_world=square,
            rays_world=np.array([[[-9.0, 0.0], [-1.0, 0.0]], [[-9.0, 1.8], [9.0, 1.8]]]),
            ray_hits=np.array([True, False]),
            contacts_world=np.array([[-1.0, 0.0]]),
            normals_world=np.array([[-1.0, 0.0]]),
            ghosts=(),
            half_width=2.0,
            title="",
        ),
        size=400,
    )
    assert image.shape == (400, 400, 3)
    assert image.dtype == np.uint8

    def colour_at(x, y):
        # The axes fill 0.96 x 0.90 of the picture from 0.02; the world is square in their middle.
        side = 0.90 * 400 / (2.0 * 2.0 * 1.1)
        return image[round(400 - (0.47 * 400 + y * side)), round(200 + x * side)] / 255.0

    assert colour_at(0.5, 0.5) == pytest.approx(picture_view.OBJECT, abs=0.02)
    assert colour_at(-1.0, 0.0) == pytest.approx(picture_view.CONTACT, abs=0.05)
    assert colour_at(-1.6, 0.0) == pytest.approx(picture_view.RAY_HIT, abs=0.4)
    assert colour_at(0.0, 1.8) == pytest.approx(picture_view.RAY_MISSED, abs=0.3)
    assert colour_at(1.5, 1.5) == pytest.approx([1.0, 1.0, 1.0])


def test_rendering_follows_the_episode_and_is_the_same_to_the_bit():
    env, other = (PlanarProbeEnv(render_mode="rgb_array") for _ in range(2))
    frames = []
    for each in (env, other):
        each.reset(seed=1)
        frames.append([each.render()])
        for action in ([0.2, 0.0], [0.7, 0.1]):
            each.step(np.array(action))
            frames[-1].append(each.render())
    assert all(np.array_equal(a, b) for a, b in zip(*frames, strict=True))
    assert len({frame.tobytes() for frame in frames[0]}) == 3
    assert frames[0][0].shape == (600, 600, 3)
    assert PlanarProbeEnv().render() is None


def test_a_window_where_none_can_open_is_refused_with_a_word_on_what_would_do(monkeypatch):
    monkeypatch.setattr(window, "toolkit_name", lambda: None)
    with pytest.raises(gymnasium.error.DependencyNotInstalled, match="rgb_array"):
        gymnasium.make(ID, render_mode="human")


def test_matplotlibs_picture_backend_opens_no_windows():
    import matplotlib.pyplot as plt

    plt.switch_backend("agg")
    assert window.toolkit_name() is None


def test_a_window_shows_each_step_until_it_is_closed(monkeypatch):
    """On a toolkit that only counts: matplotlib's figures are real, opening them isn't."""
    import matplotlib.pyplot as plt
    from matplotlib.figure import Figure

    plt.switch_backend("agg")
    opened = []
    monkeypatch.setattr(window, "toolkit_name", lambda: "counting")
    monkeypatch.setattr(Figure, "show", lambda figure: opened.append(figure))
    env = gymnasium.make(ID, render_mode="human").unwrapped
    assert isinstance(env, PlanarProbeEnv)
    env.reset(seed=0)
    env.step(np.array([0.3, 0.0]))
    assert env.render() is None
    (figure,) = opened
    shown = np.asarray(figure.axes[0].images[0].get_array())
    env.render_mode = "rgb_array"
    drawn = env.render()
    assert drawn is not None
    assert np.array_equal(shown, drawn)
    env.render_mode = "human"
    plt.close(figure)
    env.step(np.array([0.3, 0.0]))
    assert len(opened) == 2
    copy = pickle.loads(pickle.dumps(env))
    copy.step(np.array([0.3, 0.0]))
    copy.close()
    env.close()
    env.close()
    assert not plt.get_fignums()
