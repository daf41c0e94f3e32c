"""The finger: guarded moves by dynamics, against plain geometry that knows no simulator."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
import trimesh
from helpers.collision_parts import parts_of
from helpers.digests import bytes_of
from oracles.checker import cone_of
from oracles.geometry import cone_angles, signed_distances
from oracles.solids import blocks, box, hull_of, model
from oracles.touch_truth import faults, touches_around
from scipy.spatial.transform import RigidTransform, Rotation

from palpate.assets import STAND_IN_NAMES
from palpate.envs.scene.finger import Finger, FingerDesign
from palpate.envs.scene.placement import AcrossPlane
from palpate.envs.scene.scene import NOTHING, OBJECT, PLANE, ProbeScene
from palpate.envs.sensors import guarded_move
from palpate.envs.sensors.ball_sweep import BallSweep
from palpate.envs.sensors.finger_sensor import FingerSensor
from palpate.envs.sensors.guarded_move import GuardedMove
from palpate.envs.sensors.noise import SensorNoise
from palpate.envs.sensors.touch import ProbeCommand, triad
from palpate.recognizer import EDGE, FACE, VERTEX, Polyhedron
from palpate.recognizer.models.features import all_features
from palpate.scripts.lab.bench.touch_cases import KINDS, ApproachSampler

RADIUS = 0.002
USUAL = SensorNoise(position_error=2.5e-4, normal_error=0.3)
TIGHT = SensorNoise(position_error=2.5e-5, normal_error=0.02)
DESIGN = FingerDesign()


def make_finger(
    name: str, noise: SensorNoise = USUAL, **options
) -> tuple[FingerSensor, ProbeScene]:
    solid = model(name)
    return FingerSensor(noise, 2.0 * solid.diameter, **options), ProbeScene(solid)


def prism_of(outline: list[list[float]]) -> trimesh.Trimesh:
    """A prism 2 cm along y over an outline in x and z, star-shaped about its first corner."""
    count = len(outline)
    corners = [[x, y, z] for y in (0.0, 0.02) for x, z in outline]
    caps = [[0, k, k + 1] for k in range(1, count - 1)]
    caps += [[count + c, count + b, count + a] for a, b, c in caps]
    sides = [(k, (k + 1) % count) for k in range(count)]
    walls = [[b, a, a + count] for a, b in sides] + [[b, a + count, b + count] for a, b in sides]
    return trimesh.Trimesh(corners, caps + walls, process=False)


@pytest.mark.parametrize("name", STAND_IN_NAMES)
def test_the_finger_stops_where_geometry_says(name):
    """Within the goal of 50 micrometres, and within what the sensor states of itself."""
    sensor, scene = make_finger(name)
    sampler, rng = ApproachSampler(scene.model, RADIUS, sensor.reach), np.random.default_rng(0)
    features = all_features(scene.model)
    first: dict[int, int] = {
        FACE: 0,
        EDGE: features.face_count,
        VERTEX: features.face_count + features.edge_count,
    }
    for kind in KINDS:
        for index in range(20):
            approach = sampler.draw(kind, index * sampler.count(kind) // 20, rng)
            assert approach is not None, f"{KINDS[kind]} {index} can't be reached"
            scene.place(approach.T_world_object)
            start, direction = approach.start_world[None], approach.direction_world[None]
            (felt,) = sensor.feel(scene, start, direction)
            swept, (stated, normal_stated) = approach.swept, sensor.own_errors(scene)
            assert felt.outcome == OBJECT
            assert felt.kind == kind
            assert np.linalg.norm(felt.position_world - swept.position_world) < stated < 5e-5
            assert np.linalg.norm(felt.normal_world - swept.normal_world) < normal_stated
            if kind == FACE:
                assert np.linalg.norm(felt.normal_world - swept.normal_world) < np.radians(0.1)
                assert np.linalg.norm(felt.position_world - swept.position_world) < 1e-6
            normal = approach.T_world_object.rotation.inv().apply(felt.normal_world)
            cone = cone_of(scene.model, first[kind] + approach.feature, features)
            assert cone_angles(normal, cone) < normal_stated


@pytest.mark.parametrize("noise", [TIGHT, USUAL])
@pytest.mark.parametrize("threshold", [None, 0.5, 2.0])
def test_what_it_reports_is_true_within_the_bounds_it_states(noise, threshold):
    """Under a threshold the tip slides on, and reports what is under it there."""
    sensor, scene = make_finger("stapler", noise, force_threshold=threshold)
    features, rng = all_features(scene.model), np.random.default_rng(1)
    met, kinds = 0, set()
    for touch in touches_around(sensor, scene, rng, 12):
        assert faults(scene, touch, features) == []
        met += len(touch.contacts)
        kinds |= set(touch.contacts.kinds.tolist())
    assert met > 8
    assert kinds >= {FACE, EDGE}


@pytest.mark.parametrize("speed", [0.002, 0.1])
def test_slow_and_fast_fingers_touch_the_same(speed):
    usual, scene = make_finger("housing")
    sensor = FingerSensor(USUAL, usual.reach, speed=speed)
    rng, met = np.random.default_rng(2), 0
    for _ in range(4):
        scene.place(AcrossPlane(offset=0.01).draw(rng, scene.model))
        x, y = rng.uniform(-0.02, 0.02, 2)
        starts, directions = triad(x, y, 0.1, sensor.reach)
        stated = sensor.own_errors(scene)[0]
        both = zip(*(s.feel(scene, starts, directions) for s in (usual, sensor)), strict=True)
        for one, other in both:
            assert one.outcome == other.outcome
            assert np.linalg.norm(one.position_world - other.position_world) < 2.0 * stated
            met += one.outcome == OBJECT
    assert met > 3


def test_the_way_through_the_air_is_as_if_it_were_simulated(monkeypatch):
    """Half the last centimetre simulated, or the last half millimetre: the same contact."""
    sensor, scene = make_finger("housing")
    scene.place(AcrossPlane(offset=0.01).draw(np.random.default_rng(3), scene.model))
    starts, directions = triad(0.0, 0.0, 0.3, sensor.reach)
    short = sensor.feel(scene, starts, directions)
    monkeypatch.setattr(guarded_move, "RUN_UP", 1000)
    for one, other in zip(short, sensor.feel(scene, starts, directions), strict=True):
        assert len(other.forces) == len(one.forces) + 900
        assert np.abs(one.position_world - other.position_world).max() < 1e-9
        assert np.abs(one.normal_world - other.normal_world).max() < 1e-6


def test_the_tip_keeps_to_its_ray_until_it_touches():
    sensor, scene = make_finger("housing")
    scene.place(AcrossPlane(offset=0.01).draw(np.random.default_rng(4), scene.model))
    scene.mount(DESIGN)
    starts, directions = triad(0.0, 0.0, 0.3, sensor.reach)
    sweep = BallSweep(scene, RADIUS)
    move = GuardedMove(scene, sweep, starts[0], directions[0], 0.02, None)
    met = sweep.first_contact(starts[0], directions[0])
    depth, contacts = move._approach(met.depth - 0.002 + 1e-6, met.depth)
    assert contacts
    assert met.depth < depth < met.depth + 6e-6
    centre = contacts[0].centre_world
    assert np.abs(centre - starts[0] - depth * directions[0]).max() < 1e-9


def test_the_trace_of_force_tells_of_approach_contact_and_retreat():
    sensor, scene = make_finger("simple-hand", force_threshold=0.5)
    gentle = FingerSensor(USUAL, sensor.reach)
    rng = np.random.default_rng(5)
    felt = 0
    for touch in touches_around(sensor, scene, rng, 6):
        assert len(touch.forces) == 3
        for outcome, trace in zip(touch.outcomes, touch.forces, strict=True):
            times, forces = trace.T
            assert np.allclose(np.diff(times), 2.5e-4)
            assert (forces >= 0.0).all()
            assert forces[:50].max() == 0.0
            assert forces[-1] == 0.0
            if outcome != NOTHING:
                assert 0.5 <= forces.max() < 0.7
                felt += 1
    assert felt > 12
    command = ProbeCommand(0.0, 0.0, 0.0)
    peaks = [trace[:, 1].max() for trace in gentle.touch(scene, command, rng).forces]
    assert 0.0 < max(peaks) < 0.5


def test_pressed_on_a_slope_the_tip_slides_but_reports_the_surface():
    """Half a newton against 2000 N/m is a quarter of a millimetre of way, down the slope."""
    solid = Polyhedron.from_mesh(box(0.04, 0.04, 0.04), name="cube")
    scene = ProbeScene(solid)
    scene.place(RigidTransform.from_components([0, 0, 0.05], Rotation.from_euler("x", 0.6)))
    starts, directions = triad(-0.02, 0.06, 0.1, 0.3)
    light = FingerSensor(USUAL, 0.3).feel(scene, starts, directions)
    pressed = FingerSensor(USUAL, 0.3, force_threshold=0.5).feel(scene, starts, directions)
    slides = 0
    for one, other in zip(light, pressed, strict=True):
        if one.outcome == other.outcome == OBJECT and one.kind == other.kind == FACE:
            slid = other.position_world - one.position_world
            slides += 5e-5 < np.linalg.norm(slid) < 2e-3
            inside = scene.T_world_object.inv().apply(other.position_world[None])
            assert abs(signed_distances(solid, inside)[0]) < 1e-7
            assert 1e-4 < other.pressed < 1e-3
    assert slides


def test_of_two_walls_met_in_one_step_the_first_is_reported():
    """The second comes two micrometres later, and a step is five."""
    mesh = blocks([[[1], [1]], [[1], [0]]], [0, 0.01, 0.03], [0, 0.01, 0.03], [0, 0.02])
    walls = parts_of(box(0.01, 0.03, 0.02), box(0.03, 0.01, 0.02))
    scene = ProbeScene(Polyhedron.from_mesh(mesh, name="corner"), walls)
    scene.place(RigidTransform.from_translation([0.0, 0.0, 0.05]))
    sensor, diagonal = FingerSensor(USUAL, 0.3), -np.array([1.0, 1.0, 0.0]) / np.sqrt(2.0)
    both = 0
    for axis in (0, 1):
        for phase in np.linspace(0.0, 5e-6, 6):
            start = np.array([0.012, 0.012, 0.06]) - (0.05 + phase) * diagonal
            start[1 - axis] += 1.5e-6
            (felt,) = sensor.feel(scene, start[None], diagonal[None])
            assert np.allclose(felt.normal_world, np.eye(3)[axis], atol=1e-6)
            sunk = felt.position_world[1 - axis] + RADIUS * felt.normal_world[1 - axis]
            both += sunk < 0.0121
    assert both == 12


def test_pressed_into_a_shallow_valley_the_tip_reports_its_surface():
    """Under the tip are two parts, and the upper one hides where the lower one is nearest."""
    slope, outline = (
        0.003,
        [[-0.02, 0.0], [0.02, 0.0], [0.02, 0.01006], [0.0, 0.01], [-0.02, 0.01006]],
    )
    left = [[-0.02, 0.0], [0.01, 0.0], [0.01, 0.01 - slope * 0.01], [-0.02, 0.01006]]
    right = [[-x, z] for x, z in left]
    solid = Polyhedron.from_mesh(prism_of(outline), name="valley")
    assert solid.face_count == 7
    scene = ProbeScene(solid, parts_of(*(hull_of(prism_of(p).vertices) for p in (left, right))))
    scene.place(RigidTransform.from_translation([0.0, 0.0, 0.05]))
    sensor = FingerSensor(USUAL, 0.3, force_threshold=2.0)
    for x in (-3e-4, -1e-4, 1e-4, 3e-4):
        start = np.array([x, 0.01, 0.1])
        (felt,) = sensor.feel(scene, start[None], np.array([[0.0, 0.0, -1.0]]))
        at = scene.T_world_object.inv().apply(felt.position_world[None])
        assert abs(signed_distances(solid, at)[0]) < 1e-7
        assert felt.kind == FACE
        assert felt.normal_world[0] == pytest.approx(-np.sign(x) * slope, abs=1e-5)


def test_a_contact_too_shallow_for_a_normal_is_none_yet():
    sensor, scene = make_finger("housing")
    scene.mount(DESIGN)
    finger, rng = Finger(scene.mj_model, scene.mj_data), np.random.default_rng(12)
    felt: Counter[float] = Counter()
    for _ in range(5):
        scene.place(AcrossPlane(offset=0.01).draw(rng, scene.model))
        (start, *_), (direction, *_) = triad(0.0, 0.0, 0.3, sensor.reach)
        sweep = BallSweep(scene, RADIUS)
        met = sweep.first_contact(start, direction)
        gap = min(sweep.closest(geom, met.centre_world)[0] for geom in scene.part_geoms) - RADIUS
        touching = met.depth - gap / (met.normal_world @ direction)
        for beyond in (0.0, 1e-16, 1e-15, 1e-13, 1e-11, 1e-9, 2e-9, 1e-8):
            tip = start + (touching + beyond) * direction
            finger.put(tip, 0.02 * direction)
            finger.step(tip)
            for contact in finger.contacts():
                assert np.linalg.norm(contact.normal_world - met.normal_world) < 1e-3
                felt[beyond] += 1
    assert felt[1e-8] == 5
    assert felt[0.0] < 5


@pytest.mark.parametrize("speed", [0.02, 0.1])
def test_nothing_is_tunnelled_through(speed):
    """A plate a tenth of a millimetre thin, struck at full speed, stops the tip on this side."""
    plate = Polyhedron.from_mesh(box(0.06, 0.06, 1e-4), name="plate")
    scene, rng = ProbeScene(plate), np.random.default_rng(6)
    scene.mount(DESIGN)
    hits = 0
    for _ in range(8):
        rotation = Rotation.random(rng=rng)
        scene.place(
            RigidTransform.from_components([0, 0, 0.02], rotation)
            * RigidTransform.from_translation([-0.03, -0.03, 0.0])
        )
        starts, directions = triad(0.0, 0.0, rng.uniform(-1, 1), 0.3)
        for start, direction in zip(starts, directions, strict=True):
            move = GuardedMove(scene, BallSweep(scene, RADIUS), start, direction, speed, None)
            felt = move.run()
            assert move.deepest < RADIUS / 2.0
            inside = scene.T_world_object.inv().apply(start)[2] > 0.0
            if felt.outcome == OBJECT and felt.kind == FACE:
                side = scene.T_world_object.rotation.inv().apply(felt.normal_world)[2]
                assert (side > 0.0) == inside or abs(side) < 0.5
                hits += 1
    assert hits > 3


def test_a_finger_that_misses_reports_the_plane():
    sensor, scene = make_finger("housing")
    scene.place(RigidTransform.from_translation([0.0, 0.0, 0.03]))
    touch = sensor.touch(scene, ProbeCommand(0.3, 0.3, 0.0), np.random.default_rng(7))
    assert (touch.outcomes == PLANE).all()
    assert len(touch.contacts) == len(touch.contacts.kinds) == 0
    assert np.allclose(touch.ends_world[:, 2], RADIUS, atol=1e-9)
    assert np.allclose(touch.free_space.ends[:, 2], RADIUS, atol=1e-9)


def test_the_same_seed_gives_the_same_touch_to_the_bit_whatever_was_touched_before():
    def touches(scene: ProbeScene) -> bytes:
        return bytes_of(list(touches_around(sensor, scene, np.random.default_rng(8), 4)))

    sensor, scene = make_finger("simple-hand", force_threshold=0.5)
    fresh = touches(scene)
    assert touches(scene) == fresh
    FingerSensor(USUAL, 0.4, speed=0.1).touch(
        scene, ProbeCommand(0.01, 0.0, 0.0), np.random.default_rng(9)
    )
    assert touches(scene) == fresh
    assert touches(ProbeScene(scene.model)) == fresh


@pytest.mark.parametrize("radius", [0.0005, 0.01])
def test_tips_of_other_sizes_touch_as_exactly_for_their_size(radius):
    sensor, scene = make_finger("housing", design=FingerDesign(radius=radius))
    sampler, rng = ApproachSampler(scene.model, radius, sensor.reach), np.random.default_rng(10)
    for kind in KINDS:
        approach = sampler.draw(kind, 3, rng)
        assert approach is not None
        scene.place(approach.T_world_object)
        start, direction = approach.start_world[None], approach.direction_world[None]
        (felt,) = sensor.feel(scene, start, direction)
        off = np.linalg.norm(felt.position_world - approach.swept.position_world)
        assert off < sensor.own_errors(scene)[0] < radius / 150.0
        assert felt.kind == kind


def test_bounds_without_room_for_what_the_finger_does_are_refused():
    scene = ProbeScene(model("housing"))
    for noise, words in (
        (SensorNoise(position_error=1e-5, normal_error=0.1), "finger with a tip of 0.002 m is"),
        (SensorNoise(position_error=1e-3, normal_error=5e-3), "normal error is 0.005 rad"),
    ):
        with pytest.raises(ValueError, match=words):
            FingerSensor(noise, 0.4).touch(scene, ProbeCommand(0, 0, 0), np.random.default_rng(0))


@pytest.mark.parametrize("field", ["radius", "mass", "stiffness", "force_limit"])
def test_mechanics_that_cannot_be_are_refused(field):
    with pytest.raises(ValueError, match=f"{field} is -1; it must be above zero"):
        FingerDesign(**{field: -1.0})
