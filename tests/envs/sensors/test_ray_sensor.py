"""The ray sensor: exact rays, noise inside its bounds, free space that was free."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from oracles.solids import box, model
from oracles.touch_truth import faults, touches_around
from scipy.spatial.transform import RigidTransform, Rotation

from palpate.envs.scene.placement import AcrossPlane
from palpate.envs.scene.scene import NORMAL_ROUNDING, OBJECT, ProbeScene
from palpate.envs.sensors.noise import SensorNoise, uniform_in_ball, uniform_in_cone
from palpate.envs.sensors.ray_sensor import RaySensor
from palpate.envs.sensors.sensors import make_sensor
from palpate.envs.sensors.touch import ProbeCommand, triad
from palpate.recognizer import FACE, Polyhedron
from palpate.recognizer.models.rays import cast_rays

TIGHT = SensorNoise(position_error=1e-6, normal_error=1e-3)
USUAL = SensorNoise(position_error=2.5e-4, normal_error=0.3)


def rows(count: int) -> np.ndarray:
    return np.ones(count, np.int8)


def angles(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    return 2.0 * np.arcsin(np.minimum(np.linalg.norm(one - other, axis=1) / 2.0, 1.0))


@pytest.mark.parametrize("name", ["housing", "complex-hand"])
@pytest.mark.parametrize("distribution", ["uniform", "gaussian"])
@pytest.mark.parametrize("bounds", [TIGHT, USUAL])
def test_what_it_reports_is_true_within_the_bounds_it_states(name, distribution, bounds):
    noise = SensorNoise(
        position_error=bounds.position_error,
        normal_error=bounds.normal_error,
        distribution=distribution,
    )
    scene, rng = ProbeScene(model(name)), np.random.default_rng(0)
    met = 0
    for touch in touches_around(RaySensor(noise, 0.4), scene, rng, 10):
        assert faults(scene, touch) == []
        assert (touch.contacts.kinds == FACE).all()
        assert len(touch.free_space) == 3
        met += len(touch.contacts)
    assert met > 5


def test_contacts_say_from_where_they_were_touched():
    scene, rng = ProbeScene(model("stapler")), np.random.default_rng(1)
    sensor, met = RaySensor(USUAL, 0.4), 0
    for touch in touches_around(sensor, scene, rng, 20):
        hit = touch.outcomes == OBJECT
        ways = touch.ends_world - touch.starts_world
        ways /= np.linalg.norm(ways, axis=1, keepdims=True)
        # A reported end is off the ray by the noise, 0.25 mm over 0.2 m and more.
        assert np.allclose(touch.contacts.approaches, ways[hit], atol=2e-3)
        assert np.array_equal(touch.contacts.positions, touch.ends_world[hit])
        met += int(hit.sum())
    assert met > 10


def test_a_row_that_is_missed_in_the_middle_leaves_the_others_in_order():
    scene, rng = ProbeScene(model("simple-hand")), np.random.default_rng(2)
    seen = set()
    for touch in touches_around(RaySensor(TIGHT, 0.4), scene, rng, 150):
        hit = touch.outcomes == OBJECT
        seen.add(tuple(hit.tolist()))
        assert np.array_equal(touch.contacts.positions, touch.ends_world[hit])
    assert (True, False, True) in seen
    assert len(seen) == 8


def test_the_stream_of_noise_depends_on_the_probes_alone():
    scene = ProbeScene(model("housing"))
    sensor, states = RaySensor(USUAL, 0.4), []
    for x in (0.0, 5.0):
        rng = np.random.default_rng(3)
        sensor.touch(scene, ProbeCommand(x, 0.0, 0.0), rng)
        states.append(rng.bit_generator.state)
    assert states[0] == states[1]


def test_compiled_noise_is_that_of_numpy():
    """The same draws give the same noise as two functions that spell it out."""
    rng = np.random.default_rng(4)
    points = rng.normal(size=(50, 3))
    normals = np.concatenate([rng.normal(size=(41, 3)), np.eye(3), -np.eye(3), np.eye(3)])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    moved, turned = USUAL.blur(np.random.default_rng(5), rows(50), points, normals, 1e-5, 1e-2)
    twin = np.random.default_rng(5)
    shifts = uniform_in_ball(twin, 50, USUAL.position_error - 1e-5)
    leaning = uniform_in_cone(twin, normals, USUAL.normal_error - 1e-2)
    assert np.allclose(moved, points + shifts, rtol=0.0, atol=1e-15)
    assert np.allclose(turned, leaning, rtol=0.0, atol=1e-15)


def test_rows_that_touched_nothing_are_left_alone():
    points, normals = np.arange(9.0).reshape(3, 3), np.zeros((3, 3))
    normals[1, 2] = 1.0
    touched = np.array([2, 1, 3], np.int8)
    moved, turned = USUAL.blur(np.random.default_rng(6), touched, points, normals)
    assert np.array_equal(moved[[0, 2]], points[[0, 2]])
    assert not turned[[0, 2]].any()
    assert 0.0 < np.linalg.norm(moved[1] - points[1]) <= USUAL.position_error


def test_gaussian_noise_is_cut_off_at_twice_its_deviation():
    noise = SensorNoise(position_error=2.0, normal_error=0.2, distribution="gaussian")
    count, rng = 40_000, np.random.default_rng(7)
    normals = np.tile([0.6, 0.0, 0.8], (count, 1))
    moved, turned = noise.blur(rng, rows(count), np.zeros((count, 3)), normals)
    lengths, leans = np.linalg.norm(moved, axis=1), angles(turned, normals)
    assert lengths.max() <= 2.0
    assert leans.max() <= 0.2 + 1e-12
    drawn = np.random.default_rng(8).normal(size=(3 * count, 3))
    kept = drawn[np.linalg.norm(drawn, axis=1) <= 2.0]
    shares = [0.1, 0.3, 0.5, 0.7, 0.9]
    assert np.allclose(
        np.quantile(lengths, shares), np.quantile(np.linalg.norm(kept, axis=1), shares), atol=0.02
    )
    flat = 0.1 * drawn[:, :2]
    flat = np.linalg.norm(flat, axis=1)
    assert np.allclose(
        np.quantile(leans, shares), np.quantile(flat[flat <= 0.2], shares), atol=0.002
    )


def test_an_object_far_from_its_own_origin_is_as_exact():
    """Single precision is coarse there: the mesh has to be compiled from its middle."""
    mesh = box(0.06, 0.05, 0.04)
    mesh.apply_translation([300.0, -200.0, 100.0])
    solid = Polyhedron.from_mesh(mesh, name="far")
    scene, rng, seen = ProbeScene(solid), np.random.default_rng(9), 0
    for _ in range(20):
        scene.place(AcrossPlane(offset=0.01).draw(rng, solid))
        starts, directions = triad(0.0, 0.0, rng.uniform(-1, 1), 0.3)
        readings = scene.cast(starts, directions)
        hits = cast_rays(solid, scene.T_world_object, starts, directions)
        met = readings.outcomes == OBJECT
        apart = readings.ends_world[met] - hits.points_world[met]
        assert np.abs(apart).max(initial=0.0) < scene.position_rounding + 1e-9
        seen += int(met.sum())
    assert seen > 10


def test_narrow_triangles_do_not_bend_normals():
    """A needle 3 cm long and 50 nm wide leans by more than a degree once it is rounded."""
    size, needle = np.array([0.0613, 0.0517, 0.0411]), 1e-6
    corners = [
        [0, 0, 0],
        [1, 0, 0],
        [1, 1, 0],
        [0, 1, 0],
        [0, 0, 1],
        [1, 0, 1],
        [1, 1, 1],
        [0, 1, 1],
    ]
    corners += [[0.2, 0.5, 1.0], [0.8, 0.5, 1.0], [0.5, 0.5 + needle, 1.0]]
    triangles = [[0, 2, 1], [0, 3, 2], [0, 1, 5], [0, 5, 4], [1, 2, 6], [1, 6, 5]]
    triangles += [[2, 3, 7], [2, 7, 6], [3, 0, 4], [3, 4, 7], [8, 9, 10], [4, 5, 9], [4, 9, 8]]
    triangles += [[5, 6, 9], [9, 6, 10], [10, 6, 7], [8, 10, 7], [4, 8, 7]]
    # Askew in its own frame, so that no coordinate is round.
    askew = Rotation.from_euler("xyz", [0.4, 1.1, -0.7])
    mesh = trimesh.Trimesh(askew.apply(corners * size), triangles, process=False)
    solid = Polyhedron.from_mesh(mesh, name="needled")
    assert solid.face_count == 6
    scene = ProbeScene(solid)
    turn = Rotation.from_euler("xyz", [0.3, -0.2, 0.5])
    scene.place(RigidTransform.from_components([0.0, 0.0, 0.02], turn))
    places = np.column_stack(
        [np.linspace(0.3, 0.7, 200), np.full(200, 0.5 + 0.3 * needle), np.ones(200)]
    )
    up = turn.apply(askew.apply([0.0, 0.0, 1.0]))
    starts = scene.T_world_object.apply(askew.apply(places * size)) + 0.1 * up
    readings = scene.cast(starts, np.tile(-up, (200, 1)))
    assert angles(readings.normals_world, np.tile(up, (200, 1))).max() < 1e-9


@pytest.mark.parametrize(
    "name", ["housing", "housing-34", "stapler", "simple-hand", "complex-hand"]
)
def test_rounding_is_no_more_than_is_stated(name):
    solid = model(name)
    scene, rng, seen = ProbeScene(solid), np.random.default_rng(10), 0
    for _ in range(10):
        scene.place(AcrossPlane(offset=0.01).draw(rng, solid))
        x, y = rng.uniform(-0.02, 0.02, 2)
        starts, directions = triad(x, y, 0.3, 0.5)
        readings = scene.cast(starts, directions)
        hits = cast_rays(solid, scene.T_world_object, starts, directions)
        met = (readings.outcomes == OBJECT) & (hits.distances < 0.5)
        heights = (readings.ends_world[met] - hits.points_world[met]) * hits.normals_world[met]
        assert np.abs(heights.sum(axis=1)).max(initial=0.0) < scene.position_rounding
        lean = angles(readings.normals_world[met], hits.normals_world[met])
        assert lean.max(initial=0.0) < NORMAL_ROUNDING
        seen += int(met.sum())
    assert seen > 5


@pytest.mark.parametrize("command", [(np.nan, 0.0, 0.0), (0.0, np.inf, 0.0), (0.0, 0.0, -np.inf)])
def test_a_command_that_is_none_is_refused(command):
    with pytest.raises(ValueError, match="three finite numbers"):
        ProbeCommand(*command)


def test_bounds_without_room_for_noise_are_refused():
    scene = ProbeScene(model("housing"))
    for noise, words in (
        (SensorNoise(position_error=1e-9, normal_error=0.1), "position error is 1e-09 m"),
        (SensorNoise(position_error=1e-3, normal_error=1e-5), "normal error is 1e-05 rad"),
    ):
        with pytest.raises(ValueError, match=words):
            RaySensor(noise, 0.4).touch(scene, ProbeCommand(0, 0, 0), np.random.default_rng(0))


def test_an_unknown_distribution_is_named():
    with pytest.raises(ValueError, match="'normal'; it must be 'uniform' or 'gaussian'"):
        SensorNoise(position_error=1e-3, normal_error=0.1, distribution="normal")  # pyright: ignore


@pytest.mark.parametrize(
    ("name", "options", "words"),
    [
        ("sonar", {}, "'sonar'; there are: ray, ball, finger"),
        ("ray", {"radius": 0.001}, "'ray' has no radius"),
        ("ball", {"speed": 0.1}, "'ball' has no speed"),
        ("ball", {"radius": 0.3}, "radius is 0.3 m.*smaller tip"),
        ("ball", {"radius": 0.0}, "above zero"),
        ("finger", {"radius": -1.0}, "above zero"),
        ("finger", {"speed": 3.0}, "speed is 3 m/s"),
        ("finger", {"speed": 0.0}, "speed is 0 m/s"),
        ("finger", {"force_threshold": 4.0}, "at most 2.5 N"),
    ],
)
def test_a_sensor_that_cannot_be_made_says_why(name, options, words):
    with pytest.raises(ValueError, match=words):
        make_sensor(name, USUAL, 0.4, **options)


def test_rays_that_start_where_they_meet_are_refused():
    with pytest.raises(ValueError, match="reach is 0 m"):
        RaySensor(USUAL, 0.0)
