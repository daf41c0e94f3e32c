"""The ball sensor against plain geometry that knows no simulator."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from helpers.collision_parts import parts_of
from helpers.digests import bytes_of
from oracles.solids import blocks, box, l_block, model
from oracles.touch_truth import faults, touches_around
from scipy.spatial.transform import RigidTransform, Rotation

from palpate.assets import STAND_IN_NAMES
from palpate.envs.collision.collision import collision_parts
from palpate.envs.scene.placement import AcrossPlane
from palpate.envs.scene.scene import NOTHING, OBJECT, PLANE, ProbeScene
from palpate.envs.sensors.ball_sensor import BallSensor
from palpate.envs.sensors.noise import SensorNoise
from palpate.envs.sensors.touch import ProbeCommand, triad
from palpate.recognizer import EDGE, FACE, VERTEX, Polyhedron
from palpate.recognizer.models.features import all_features
from palpate.scripts.lab.bench.touch_cases import KINDS, ApproachSampler, depth_in_hull
from palpate.scripts.lab.sweep_oracle import SweepOracle

RADIUS = 0.002
USUAL = SensorNoise(position_error=2.5e-4, normal_error=0.3)
TIGHT = SensorNoise(position_error=1e-6, normal_error=1e-3)

every_stand_in = pytest.mark.parametrize("name", STAND_IN_NAMES)


def make_ball(name: str, noise: SensorNoise = USUAL) -> tuple[BallSensor, ProbeScene]:
    solid = model(name)
    return BallSensor(noise, 2.0 * solid.diameter, RADIUS), ProbeScene(solid)


def l_scene() -> ProbeScene:
    """An L-block 2.5 by 3 by 1.3 cm and the two boxes that it is."""
    mesh = l_block()
    mesh.apply_scale(0.01)
    solid = Polyhedron.from_mesh(mesh, name="l-block")
    return ProbeScene(solid, parts_of(box(0.01, 0.03, 0.013), box(0.025, 0.007, 0.013)))


@every_stand_in
def test_the_ball_stops_where_geometry_says(name):
    """On every face, edge and vertex in its turn, approached at random, and in notches too."""
    sensor, scene = make_ball(name)
    sampler, rng = ApproachSampler(scene.model, RADIUS, sensor.reach), np.random.default_rng(0)
    notched = 0
    for kind in KINDS:
        for index in range(40):
            approach = sampler.draw(kind, index * sampler.count(kind) // 40, rng)
            assert approach is not None, f"{KINDS[kind]} {index} can't be reached"
            scene.place(approach.T_world_object)
            start, direction = approach.start_world[None], approach.direction_world[None]
            (felt,) = sensor.feel(scene, start, direction)
            swept = approach.swept
            assert felt.outcome == OBJECT
            assert felt.kind == kind
            assert np.linalg.norm(felt.position_world - swept.position_world) < 1e-7
            assert np.linalg.norm(felt.normal_world - swept.normal_world) < 1e-4
            assert felt.free == pytest.approx(swept.depth, abs=1e-6)
            contact = approach.T_world_object.inv().apply(felt.position_world)
            notched += depth_in_hull(scene.model, contact) > 5e-4
    assert notched > 10


@every_stand_in
def test_whole_triads_stop_where_geometry_says_or_pass(name):
    sensor, scene = make_ball(name)
    oracle, rng = SweepOracle(scene.model), np.random.default_rng(1)
    outcomes = []
    for _ in range(40):
        scene.place(AcrossPlane(offset=0.01).draw(rng, scene.model))
        x, y = rng.uniform(-0.4, 0.4, 2) * scene.model.diameter
        starts, directions = triad(x, y, rng.uniform(-1.0, 1.0), sensor.reach)
        for ray, felt in enumerate(sensor.feel(scene, starts, directions)):
            swept = oracle.sweep(scene.T_world_object, starts[ray], directions[ray], RADIUS)
            plane = (RADIUS - starts[ray, 2]) / directions[ray, 2]
            assert felt.outcome == (OBJECT if swept.depth < plane else PLANE)
            assert felt.free == pytest.approx(min(swept.depth, plane), abs=1e-6)
            if felt.outcome == PLANE:
                assert felt.position_world[2] == pytest.approx(0.0, abs=1e-12)
                assert felt.normal_world.tolist() == [0.0, 0.0, 1.0]
            outcomes.append(felt.outcome)
    assert min(outcomes.count(OBJECT), outcomes.count(PLANE)) > 10


@pytest.mark.parametrize("name", ["stapler", "complex-hand"])
@pytest.mark.parametrize("noise", [TIGHT, USUAL])
def test_what_it_reports_is_true_within_the_bounds_it_states(name, noise):
    """Contacts are on what they truly lay on; no capsule is nearer to the object than it says."""
    sensor, scene = make_ball(name, noise)
    features, rng = all_features(scene.model), np.random.default_rng(2)
    kinds = set()
    for touch in touches_around(sensor, scene, rng, 12):
        assert faults(scene, touch, features) == []
        assert (touch.free_space.radius == RADIUS).all()
        assert (touch.free_space.error == noise.position_error).all()
        kinds |= set(touch.contacts.kinds.tolist())
    assert kinds >= {FACE, EDGE}


def test_a_capsule_ends_just_before_the_contact():
    """No farther than the bounds on contact and normal can be off, and never past it by more."""
    sensor, scene = make_ball("housing")
    rng = np.random.default_rng(3)
    lever = 2.0 * RADIUS * np.sin(USUAL.normal_error / 2.0)
    short = []
    for touch in touches_around(sensor, scene, rng, 40):
        directions = touch.ends_world - touch.starts_world
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        felt = sensor.feel(scene, touch.starts_world, directions)
        free = np.array([one.free for one in felt])
        reached = np.linalg.norm(touch.free_space.ends - touch.starts_world, axis=1)
        hit = touch.outcomes == OBJECT
        assert np.allclose(reached[~hit], free[~hit], atol=1e-9)
        assert (reached[hit] <= free[hit] + USUAL.position_error).all()
        assert (reached[hit] >= free[hit] - USUAL.position_error - 2.0 * lever).all()
        short += (free - reached)[hit].tolist()
    assert len(short) > 20
    assert 0.5 * lever < np.mean(short) < 1.5 * lever


def test_paths_and_ends_tell_no_more_than_the_contact_does():
    """They follow from the ray and what is reported of the contact: no exact depth leaks."""
    sensor, scene = make_ball("housing")
    rng, met = np.random.default_rng(4), 0
    for touch in touches_around(sensor, scene, rng, 20):
        hit = touch.outcomes == OBJECT
        contacts, directions = touch.contacts, touch.contacts.approaches
        centres = contacts.positions + RADIUS * contacts.normals
        starts = touch.starts_world[hit]
        depths = ((centres - starts) * directions).sum(axis=1)
        assert np.allclose(touch.ends_world[hit], starts + depths[:, None] * directions)
        met += int(hit.sum())
    assert met > 10


def test_in_a_concave_corner_the_first_of_two_walls_stops_the_ball():
    scene = l_scene()
    sensor = BallSensor(USUAL, 0.1, RADIUS)
    # The notch's walls are x = 10 mm and y = 7 mm; down and sideways into it, from above.
    scene.place(RigidTransform.from_components([0, 0, 0.05], Rotation.identity()))
    for slope, normal in ((0.5, [0.0, 1.0, 0.0]), (2.0, [1.0, 0.0, 0.0])):
        direction = np.array([-slope, -1.0, 0.0]) / np.hypot(slope, 1.0)
        start = np.array([0.012, 0.009, 0.056]) + [0.0005, 0.0005, 0.0] - 0.05 * direction
        (felt,) = sensor.feel(scene, start[None], direction[None])
        assert felt.outcome == OBJECT
        assert felt.kind == FACE
        assert np.allclose(felt.normal_world, normal, atol=1e-6)
    # Along the diagonal it meets both at once, 2 mm from each.
    direction = np.array([-1.0, -1.0, 0.0]) / np.sqrt(2.0)
    start = np.array([0.012, 0.009, 0.056]) - 0.05 * direction
    (felt,) = sensor.feel(scene, start[None], direction[None])
    assert felt.free == pytest.approx(0.05, abs=1e-8)
    assert felt.kind == FACE


def test_a_ball_wider_than_a_channel_rests_on_its_rim():
    """The channel is 1 cm wide: 6 mm of radius stick on an edge, 4 mm reach its floor."""
    cells = [[[1, 1]], [[1, 0]], [[1, 1]]]
    channel = blocks(cells, [0, 0.01, 0.02, 0.03], [0, 0.03], [0, 0.005, 0.02])
    solid = Polyhedron.from_mesh(channel, name="channel")
    wall, floor = box(0.01, 0.03, 0.02), box(0.03, 0.03, 0.005)
    scene = ProbeScene(solid, parts_of(wall, wall.copy().apply_translation([0.02, 0, 0]), floor))
    scene.place(RigidTransform.from_translation([0.0, 0.0, 0.01]))
    start, down = np.array([[0.015, 0.015, 0.2]]), np.array([[0.0, 0.0, -1.0]])
    for radius, kind, height in (
        (0.006, EDGE, 0.03 + np.sqrt(36 - 25) / 1e3),
        (0.004, FACE, 0.019),
    ):
        (felt,) = BallSensor(USUAL, 0.2, radius).feel(scene, start, down)
        assert felt.kind == kind
        assert 0.2 - felt.free == pytest.approx(height, abs=1e-7)


def test_a_ball_that_grazes_a_vertex_touches_it():
    solid = Polyhedron.from_mesh(box(0.02, 0.02, 0.02), name="cube")
    scene = ProbeScene(solid)
    scene.place(RigidTransform.from_translation([0.0, 0.0, 0.05]))
    sensor = BallSensor(USUAL, 0.2, RADIUS)
    direction = np.array([1.0, -1.0, 0.0]) / np.sqrt(2.0)
    corner, away = np.array([0.0, 0.0, 0.07]), np.array([-1.0, -1.0, 1.0]) / np.sqrt(3.0)
    for share, outcome in ((0.999, OBJECT), (1.0 + 1e-5, NOTHING)):
        start = corner + share * RADIUS * away - 0.05 * direction
        (felt,) = sensor.feel(scene, start[None], direction[None])
        assert felt.outcome == outcome
        if outcome == OBJECT:
            assert felt.kind == VERTEX
            assert felt.free == pytest.approx(0.05 - RADIUS * np.sqrt(1 - share**2), abs=1e-7)


@pytest.mark.parametrize(("size", "radius"), [(5e-4, 2e-5), (4.0, 0.002), (4.0, 0.2)])
def test_tiny_and_huge_objects_are_touched_as_exactly_as_is_stated(size, radius):
    mesh = trimesh.creation.icosahedron()
    mesh.apply_scale(size)
    solid = Polyhedron.from_mesh(mesh, name="gem")
    sensor, scene = BallSensor(USUAL, 2.0 * solid.diameter, radius), ProbeScene(solid)
    oracle, rng = SweepOracle(solid), np.random.default_rng(5)
    stated, normal_stated = sensor.own_errors(scene)
    met = 0
    for _ in range(30):
        scene.place(AcrossPlane(offset=0.1 * size).draw(rng, solid))
        x, y = rng.uniform(-0.3, 0.3, 2) * size
        starts, directions = triad(x, y, 0.1, sensor.reach)
        for ray, felt in enumerate(sensor.feel(scene, starts, directions)):
            swept = oracle.sweep(scene.T_world_object, starts[ray], directions[ray], radius)
            if felt.outcome == OBJECT and felt.kind == swept.kind == FACE:
                met += 1
                off = (felt.position_world - swept.position_world) @ swept.normal_world
                assert abs(off) < stated
                assert np.linalg.norm(felt.normal_world - swept.normal_world) < normal_stated
    assert met > 20


def test_the_same_seed_gives_the_same_touch_to_the_bit():
    def touches() -> bytes:
        sensor, scene = make_ball("simple-hand")
        return bytes_of(list(touches_around(sensor, scene, np.random.default_rng(6), 8)))

    assert touches() == touches()


def test_rays_see_the_true_mesh_and_not_the_parts_after_a_ball_was_there():
    sensor, scene = make_ball("housing")
    rng = np.random.default_rng(7)
    scene.place(AcrossPlane(offset=0.01).draw(rng, scene.model))
    starts, directions = triad(0.0, 0.0, 0.2, 0.3)
    before = scene.cast(starts, directions)
    sensor.feel(scene, starts, directions)
    after = scene.cast(starts, directions)
    assert np.array_equal(before.ends_world, after.ends_world)
    assert np.array_equal(before.normals_world, after.normals_world)


def test_a_ball_that_starts_in_the_object_is_refused():
    sensor, scene = make_ball("housing")
    scene.place(RigidTransform.from_translation([0.0, 0.0, 0.05]))
    inside = np.array([[0.0, 0.0, 0.05]])
    with pytest.raises(ValueError, match="does not start free"):
        sensor.feel(scene, inside, np.array([[0.0, 0.0, -1.0]]))


def test_bounds_without_room_for_noise_are_refused():
    scene = make_ball("housing")[1]
    for noise, words in (
        (SensorNoise(position_error=1e-8, normal_error=0.1), "a ball of 0.002 m is exact to"),
        (SensorNoise(position_error=1e-3, normal_error=1e-6), "normal error is 1e-06 rad"),
    ):
        with pytest.raises(ValueError, match=words):
            BallSensor(noise, 0.4).touch(scene, ProbeCommand(0, 0, 0), np.random.default_rng(0))


@every_stand_in
def test_the_parts_of_a_stand_in_are_its_own(name):
    found = collision_parts(model(name))
    assert found.stray <= 1e-8 * model(name).diameter
    assert len(found.parts) > 1
