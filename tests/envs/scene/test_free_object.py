"""A free object: it stands, slides as Coulomb says, and what was felt of it stays true."""

from __future__ import annotations

import pickle

import gymnasium
import mujoco
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from helpers.episodes import CUT_SHORT
from oracles.solids import box, model
from oracles.touch_truth import faults
from scipy.spatial.transform import RigidTransform, Rotation

import palpate.envs
from palpate.assets import STAND_IN_NAMES
from palpate.envs.probe_env import ProbeEnv
from palpate.envs.scene.finger import FingerDesign
from palpate.envs.scene.free_body import STILL, displacement
from palpate.envs.scene.free_object import SINK, FreeObject
from palpate.envs.scene.placement import Resting
from palpate.envs.scene.scene import ProbeScene
from palpate.envs.sensors.evidence import Evidence
from palpate.envs.sensors.finger_sensor import FingerSensor
from palpate.envs.sensors.noise import SensorNoise
from palpate.envs.sensors.ray_sensor import RaySensor
from palpate.envs.sensors.touch import ProbeCommand, Touch
from palpate.recognizer import Polyhedron
from palpate.recognizer.models.features import all_features

gymnasium.register_envs(palpate.envs)

NOISE = SensorNoise(position_error=2.5e-4, normal_error=0.1)
PUSH = 2.0
"""Newtons; enough to move all of the stand-ins where a side is pushed."""


def slab(size: float = 0.04) -> Polyhedron:
    return Polyhedron.from_mesh(box(size, size, 0.5 * size), name="slab")


def standing(solid: Polyhedron, free: FreeObject | None = None, seed: int = 0) -> ProbeScene:
    scene = ProbeScene(solid, free=free or FreeObject())
    scene.place(Resting(offset=0.0).draw(np.random.default_rng(seed), solid))
    return scene


def pushes(scene: ProbeScene, count: int, seed: int = 0, force: float | None = PUSH):
    """Touches of a finger that pushes about one object, anywhere near where it started."""
    size = scene.model.diameter
    sensor = FingerSensor(NOISE, 2.0 * size, force_threshold=force)
    rng = np.random.default_rng(seed)
    for _ in range(count):
        x, y, yaw = rng.uniform(-1.0, 1.0, 3) * (0.3 * size, 0.3 * size, np.pi / 3.0)
        yield sensor.touch(scene, ProbeCommand(float(x), float(y), float(yaw)), rng)


@pytest.mark.parametrize("name", STAND_IN_NAMES)
def test_an_object_at_rest_stays_where_it_was_placed(name):
    """It sinks in by less than the sensor's world allows for, and not farther with time."""
    solid = model(name)
    resting, rng = Resting(offset=0.0), np.random.default_rng(1)
    scene = ProbeScene(solid, free=FreeObject())
    for _ in range(5):
        placed = resting.draw(rng, solid)
        scene.place(placed)
        now = scene.T_world_object
        assert 0.0 < displacement(solid, placed, now).distance < SINK / 2.0
        assert scene.stands(SINK)
        assert not scene.stands(1e-9)
        assert scene.settle()
        assert displacement(solid, now, scene.T_world_object).distance < 1e-7


@pytest.mark.parametrize("size", [1e-3, 0.04, 10.0 / np.sqrt(2.25)])
@pytest.mark.parametrize("density", [600.0, 8000.0])
def test_small_and_large_light_and_heavy_objects_stand(size, density):
    solid = slab(size)
    scene = standing(solid, FreeObject(mass=density * 0.5 * size**3))
    assert scene.stands(SINK)


def test_too_light_an_object_is_refused_and_the_mass_that_will_do_is_told():
    solid = slab(1e-3)
    with pytest.raises(ValueError, match=r"give at least 1\.94e-07 kg") as told:
        ProbeScene(solid, free=FreeObject(mass=1e-8))
    least = float(str(told.value).split()[-2])
    assert ProbeScene(solid, free=FreeObject(mass=least)).free


def test_an_object_that_is_let_go_over_an_edge_falls_on_a_face():
    solid = slab()
    scene = ProbeScene(solid, free=FreeObject())
    tilted = Rotation.from_euler("x", np.radians(40.0))
    lift = -float(tilted.apply(solid.vertices.copy())[:, 2].min())
    scene.place(RigidTransform.from_components([0.0, 0.0, lift + 1e-4], tilted))
    assert scene.stands(SINK)
    up = scene.T_world_object.rotation.apply(solid.normals.copy())[:, 2].max()
    assert np.arccos(min(up, 1.0)) < 1e-4


@pytest.mark.parametrize("friction", [0.2, 0.5])
@pytest.mark.parametrize("mass", [0.02, 1.0])
def test_what_slides_comes_to_rest_where_coulomb_says(friction, mass):
    """From 0.3 m/s a body slides v² / (2 µ g) far, whatever its mass."""
    scene = standing(slab(), FreeObject(mass=mass, friction=friction))
    before = scene.T_world_object
    scene.mj_data.qvel[0] = 0.3
    scene.settle()
    gravity = -scene.mj_model.opt.gravity[2]
    centroid = scene.model.centroid
    gone = scene.T_world_object.apply(centroid) - before.apply(centroid)
    assert gone[0] == pytest.approx(0.3**2 / (2.0 * friction * gravity), rel=0.01)
    assert np.abs(gone[1:]).max() < 0.02 * gone[0]


def test_the_simulated_body_has_the_mass_that_was_asked_for():
    scene = standing(slab(), FreeObject(mass=0.3))
    body = scene.mj_model.body("object").id
    assert scene.mj_model.body_mass[body] == pytest.approx(0.3)
    inertia = 0.3 * (0.04**2 + np.array([0.02, 0.02, 0.04]) ** 2) / 12.0
    assert np.sort(scene.mj_model.body_inertia[body]) == pytest.approx(np.sort(inertia))
    by_volume = standing(slab()).mj_model.body_mass[body]
    assert by_volume == pytest.approx(1000.0 * 0.04 * 0.04 * 0.02)


@pytest.mark.parametrize("name", ["stapler", "simple-hand"])
@pytest.mark.parametrize("force", [None, PUSH])
def test_what_a_probe_reports_holds_for_where_the_object_lies_after_it(name, force):
    """Contacts within their bounds of it, and swept paths outside it."""
    scene = standing(model(name))
    features = all_features(scene.model)
    farthest = felt = 0
    for touch in pushes(scene, 8, force=force):
        assert faults(scene, touch, features) == []
        farthest = max(farthest, touch.displacement.distance)
        felt += len(touch.contacts)
    assert felt > 8
    assert farthest < 5e-6 if force is None else farthest > 1e-3


@pytest.mark.parametrize("name", ["stapler", "simple-hand"])
def test_what_was_felt_before_holds_for_where_the_object_lies_after_all(name):
    """Every contact that is kept, of any probe; and some would not, had the bounds not grown."""
    scene = standing(model(name), seed=3)
    features = all_features(scene.model)
    evidence = Evidence.none()
    broken = 0
    for touch in pushes(scene, 6, seed=1):
        evidence = evidence.after(touch, 0.1 * scene.model.diameter)
        assert faults(scene, whole(evidence, touch), features) == []
        unchanged = [whole(Evidence.none().after(one, np.inf), touch) for one in evidence.touches]
        broken += sum(bool(faults(scene, one, features)) for one in unchanged)
    assert broken > 3


def whole(evidence: Evidence, last: Touch) -> Touch:
    """All that is known, as if one probe had reported it."""
    return Touch(
        evidence.contacts,
        evidence.free_space,
        last.starts_world,
        last.ends_world,
        last.outcomes,
    )


def test_the_displacement_told_is_no_less_than_the_true_one():
    scene = standing(model("stapler"), seed=2)
    moved = 0
    before = scene.T_world_object
    for touch in pushes(scene, 8, seed=2):
        true = displacement(scene.model, before, scene.T_world_object)
        assert true.distance <= touch.displacement.distance
        assert true.turn <= touch.displacement.turn
        moved += true.distance > 1e-4
        before = scene.T_world_object
    assert moved > 2


def test_a_ray_moves_nothing():
    scene = standing(model("stapler"))
    before = scene.T_world_object
    sensor = RaySensor(NOISE, 0.3)
    touch = sensor.touch(scene, ProbeCommand(0.0, 0.0, 0.0), np.random.default_rng(0))
    assert len(touch.contacts)
    assert touch.displacement == STILL
    assert displacement(scene.model, before, scene.T_world_object) == STILL


def test_mounting_a_finger_leaves_the_object_where_it_is():
    scene = standing(model("stapler"))
    before = scene.T_world_object
    scene.mount(FingerDesign())
    assert displacement(scene.model, before, scene.T_world_object).distance == 0.0
    mujoco.mj_forward(scene.mj_model, scene.mj_data)
    scene.follow()
    assert displacement(scene.model, before, scene.T_world_object).distance < 1e-12


def free_env(**options) -> ProbeEnv:
    given = {"max_probes": 6, "limits": CUT_SHORT, "force_threshold": PUSH, **options}
    return ProbeEnv(("stapler",), placement="resting", free=True, sensor="finger", **given)


def trace(env: ProbeEnv, seed: int) -> bytes:
    rng = np.random.default_rng(seed)
    observation, info = env.reset(seed=seed)
    parts = []
    for _ in range(4):
        parts += [value.tobytes() for value in observation.values()]
        parts += [info["truth"]["pose"].tobytes(), repr(info["displacement"]).encode()]
        observation, _, _, _, info = env.step(rng.uniform(-1.0, 1.0, 3))
    return b"".join(parts)


def test_same_seed_same_pushes_to_the_bit():
    env = free_env()
    first = trace(env, 0)
    assert trace(env, 1) != first
    assert trace(env, 0) == first
    assert trace(free_env(), 0) == first
    copy = pickle.loads(pickle.dumps(env))
    assert trace(copy, 0) == first


def test_a_copy_made_amid_an_episode_goes_on_alike():
    env = free_env()
    env.reset(seed=4)
    env.step(np.zeros(3))
    copy = pickle.loads(pickle.dumps(env))
    for action in ([0.1, 0.0, 0.3], [0.0, -0.1, 0.0]):
        one, *_, info = env.step(np.array(action))
        other, *_, copied = copy.step(np.array(action))
        assert {key: value.tobytes() for key, value in one.items()} == {
            key: value.tobytes() for key, value in other.items()
        }
        assert info["displacement"] == copied["displacement"]


def test_an_environment_of_free_objects_keeps_gymnasiums_contract():
    made = gymnasium.make(
        "palpate/Probe-v0",
        library=("stapler",),
        placement="resting",
        free=True,
        sensor="finger",
        max_probes=3,
        limits=CUT_SHORT,
    )
    check_env(made.unwrapped, skip_render_check=True)


def test_the_environment_tells_of_pushes_and_forgets_what_they_spoilt():
    env = free_env(max_probes=40)
    _, info = env.reset(seed=0)
    assert info["displacement"] == {"distance": 0.0, "turn": 0.0}
    rng = np.random.default_rng(0)
    felt, far, dropped = 0, 0.0, False
    for _ in range(12):
        observation, *_, info = env.step(rng.uniform(-0.7, 0.7, 3))
        assert env.observation_space.contains(observation)
        felt += len(env.touches[-1].contacts)
        dropped |= 0 < len(env.contacts) < felt
        far = max(far, info["displacement"]["distance"])
        if len(env.contacts):
            widest = env.contacts.position_error.max()
            assert NOISE.position_error < widest <= 0.02 * env.library[0].diameter
    assert far > 1e-3
    assert dropped


def test_the_truth_is_kept_while_the_object_is_pushed_about():
    env = ProbeEnv(
        ("stapler", "simple-hand"),
        placement="resting",
        free=True,
        sensor="finger",
        position_error=2.5e-4,
        normal_error=0.1,
        force_threshold=PUSH,
        use_free_space=True,
        max_probes=5,
    )
    whole, pushed = 0, 0.0
    for seed in range(3):
        env.reset(seed=seed)
        rng, ended = np.random.default_rng(seed), False
        while not ended:
            *_, terminated, truncated, info = env.step(rng.uniform(-1.0, 1.0, 3))
            ended = terminated or truncated
            pushed = max(pushed, info["displacement"]["distance"])
            # A search that a limit cuts short may miss the truth.
            if env.belief is not None and env.belief.complete:
                names = {hypothesis.object_name for hypothesis in env.belief.hypotheses}
                assert info["truth"]["object"] in names
                whole += 1
    assert whole >= 5
    assert pushed > 1e-3


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"free": True}, "a free object has to stand"),
        ({"mass": 1.0}, "mass is 1, but the object is held"),
        ({"friction": 1.0}, "friction is 1, but the object is held"),
        ({"placement": "resting", "free": True, "mass": 0.0}, "mass is 0 kg"),
        ({"placement": "resting", "free": True, "friction": -1.0}, "friction is -1"),
        ({"force_threshold": 1.0}, "'ray' has no force_threshold"),
        ({"sensor": "finger", "force_threshold": 9.0}, "at most 2.5 N"),
    ],
)
def test_an_object_that_cannot_be_free_is_refused(options, words):
    with pytest.raises(ValueError, match=words):
        ProbeEnv(("stapler",), **options)
