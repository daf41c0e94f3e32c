"""Range sensing: the rays, and contacts whose bounds hold."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from helpers.digests import bytes_of
from helpers.range_views import (
    NOISE,
    assert_bounds_hold,
    command,
    grid,
    place,
    scanner,
    truth_under,
)
from oracles import solids as oracles
from scipy.spatial.transform import RigidTransform, Rotation

from palpate.assets import STAND_IN_NAMES
from palpate.envs.scene.scene import OBJECT, PLANE, ProbeScene
from palpate.envs.sensors.noise import SensorNoise
from palpate.envs.sensors.range_image import RangeView, bounded_noise
from palpate.envs.sensors.range_sensor import COARSEST, RangeGrid, RangeScanner
from palpate.envs.sensors.touch import ProbeCommand, Sensor
from palpate.recognizer import FACE, Polyhedron, Recognizer
from palpate.recognizer.models.rays import cast_rays

every_stand_in = pytest.mark.parametrize("name", STAND_IN_NAMES)
both_kinds = pytest.mark.parametrize("distribution", ["uniform", "gaussian"])


@every_stand_in
@both_kinds
def test_what_a_grid_reports_is_within_its_bounds(name, distribution):
    rng, solid = np.random.default_rng(0), oracles.model(name)
    noise = SensorNoise(position_error=1e-6, normal_error=1e-3, distribution=distribution)
    scene, sensor, seen = ProbeScene(solid), grid(solid, noise), 0
    for _ in range(20):
        place(scene, rng)
        touch = sensor.touch(scene, command(rng, solid), rng)
        assert_bounds_hold(scene, touch)
        seen += len(touch.contacts)
    assert seen > 80


def test_a_grid_is_three_square_lattices_that_run_against_each_other():
    solid = oracles.model("housing-34")
    sensor = grid(solid, spacing=0.01)
    scene, rng = ProbeScene(solid), np.random.default_rng(0)
    scene.place(RigidTransform.identity())
    touch = sensor.touch(scene, ProbeCommand(0.01, -0.02, 0.3), rng)
    count = round(1.5 * solid.diameter / 0.01)
    assert len(touch.starts_world) == sensor.rays == 3 * count**2
    exact = touch.outcomes == PLANE
    paths = touch.ends_world - touch.starts_world
    directions = paths / np.linalg.norm(paths, axis=1, keepdims=True)
    frame = []
    for starts, heading, usable in zip(
        np.split(touch.starts_world, 3), np.split(directions, 3), np.split(exact, 3), strict=True
    ):
        assert np.ptp(heading[usable], axis=0).max() < 1e-9
        frame.append(heading[usable][0])
        assert np.ptp(starts @ frame[-1]) < 1e-12
        lattice = starts.reshape(count, count, 3)
        steps = [np.diff(lattice, axis=axis).reshape(-1, 3) for axis in (0, 1)]
        assert np.allclose(np.linalg.norm(np.concatenate(steps), axis=1), 0.01)
        assert np.allclose(steps[0] @ steps[1].T, 0.0, atol=1e-15)
        # The middle of the lattice looks at the point that was asked for.
        towards = np.array([0.01, -0.02, 0.0]) - starts.mean(axis=0)
        assert np.allclose(np.cross(towards, frame[-1]), 0.0, atol=1e-12)
    assert np.allclose(np.array(frame) @ np.array(frame).T, np.eye(3), atol=1e-9)
    assert (np.array(frame)[:, 2] < -0.5).all()


@every_stand_in
@both_kinds
def test_what_a_scanner_reports_is_within_its_bounds(name, distribution):
    """Two hundred scans in all, the range error at a tenth of the spacing, which is the most."""
    rng, solid = np.random.default_rng(6), oracles.model(name)
    noise = SensorNoise(
        position_error=1e-2 * solid.diameter, normal_error=0.5, distribution=distribution
    )
    scene, seen = ProbeScene(solid), 0
    spacing = 1.5 * solid.diameter / 180.0
    sensor = scanner(solid, noise, range_error=COARSEST * spacing, points=5)
    for _ in range(20):
        place(scene, rng)
        touch = sensor.touch(scene, command(rng, solid), rng)
        assert_bounds_hold(scene, touch)
        assert (touch.contacts.position_error <= noise.position_error).all()
        assert (touch.contacts.normal_error <= noise.normal_error).all()
        assert (touch.contacts.kinds == FACE).all()
        assert len(touch.contacts.kinds) == len(touch.contacts) <= 5
        seen += len(touch.contacts)
    assert seen >= 60


def test_a_scan_shows_three_independent_normals_where_the_view_has_them():
    """A box that stands on a corner is looked at along each of its diagonals."""
    solid = Polyhedron.from_mesh(oracles.box(0.05, 0.06, 0.07), name="box")
    scene, rng = ProbeScene(solid), np.random.default_rng(8)
    sensor = scanner(solid, elevation=np.pi / 2.0)
    upright = Rotation.align_vectors([[0.0, 0.0, 1.0]], [[1.0, 1.0, 1.0]])[0]
    for turn in np.linspace(0.0, 2.0, 5):
        rotation = Rotation.from_rotvec([0.0, 0.0, turn]) * upright
        scene.place(RigidTransform.from_components([0.0, 0.0, 0.02], rotation))
        contacts = sensor.touch(scene, ProbeCommand(0.0, 0.0, 0.4), rng).contacts
        assert len(contacts) == 12
        assert np.linalg.svd(contacts.normals)[1].min() > 1.0
        apart = np.linalg.norm(contacts.positions[:, None] - contacts.positions[None], axis=2)
        assert apart[~np.eye(12, dtype=bool)].min() > 0.005


@pytest.mark.parametrize("make", [grid, scanner])
def test_the_support_plane_is_never_a_contact(make):
    """Objects that hardly stand out of it, or not at all."""
    rng, solid = np.random.default_rng(9), oracles.model("housing-34")
    scene, sensor, seen = ProbeScene(solid), make(solid), 0
    for sunk in (0.6, 0.9, 0.97, 1.0):
        for _ in range(5):
            place(scene, rng, sunk=(sunk, sunk))
            touch = sensor.touch(scene, command(rng, solid), rng)
            assert_bounds_hold(scene, touch)
            assert (truth_under(scene, touch).points_world[:, 2] > 0.0).all()
            assert not (sunk == 1.0 and len(touch.contacts))
            seen += len(touch.contacts)
    assert seen > 20


@pytest.mark.parametrize("make", [grid, scanner])
def test_swept_paths_are_free_as_far_as_their_error_goes(make):
    rng, solid = np.random.default_rng(10), oracles.model("simple-hand")
    scene, sensor = ProbeScene(solid), make(solid)
    for _ in range(10):
        place(scene, rng)
        touch = sensor.touch(scene, command(rng, solid), rng)
        paths = touch.free_space
        starts = np.array(paths.starts)
        assert len(touch.contacts) <= len(paths) == len(touch.outcomes) <= sensor.rays
        assert (paths.radius == 0.0).all()
        along = paths.ends - paths.starts
        lengths = np.linalg.norm(along, axis=1, keepdims=True)
        hits = cast_rays(solid, scene.T_world_object, starts, along / lengths)
        beyond = lengths[:, 0] - hits.distances
        # So far into the object, measured square to the face that was met.
        faced = -(along / lengths * hits.normals_world)[hits.hit].sum(axis=1)
        assert (beyond[hits.hit] * faced <= 1.001 * paths.error[hits.hit]).all()
        assert hits.hit.sum() >= len(touch.contacts)


def test_contacts_belong_to_the_rays_that_met_the_object():
    rng, solid = np.random.default_rng(11), oracles.model("stapler")
    scene = ProbeScene(solid)
    for sensor in (grid(solid), scanner(solid)):
        place(scene, rng)
        touch = sensor.touch(scene, command(rng, solid), rng)
        met = touch.outcomes == OBJECT
        assert met.sum() == len(touch.contacts) > 0
        assert np.array_equal(touch.ends_world[met], touch.contacts.positions)
        directions = touch.contacts.positions - touch.starts_world[met]
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        # Across the ray a grid's noise turns it a little.
        assert np.allclose(directions, touch.contacts.approaches, atol=2e-3)


def test_the_view_is_the_one_asked_for():
    view = RangeView.towards(0.1, 0.2, bearing=0.7, elevation=0.5, reach=2.0)
    axes = np.array([view.direction_world, view.right_world, view.down_world])
    assert np.allclose(axes @ axes.T, np.eye(3), atol=1e-12)
    assert view.right_world[2] == 0.0
    assert np.allclose(view.origin_world + 2.0 * view.direction_world, [0.1, 0.2, 0.0])
    assert np.arcsin(-view.direction_world[2]) == pytest.approx(0.5)
    assert np.arctan2(*view.direction_world[1::-1]) == pytest.approx(0.7)
    # A plane's points, read along two rays, are square to the normal that its slopes give.
    slopes = np.array([0.3, -0.8])
    normal = view.normals(slopes)
    starts = view.starts(np.array([0.0, 0.01]), np.array([0.0, 0.02]))
    points = starts + (np.array([[0.0, -0.016], [0.003, -0.013]]))[..., None] * view.direction_world
    assert np.allclose((points - points[0, 0]) @ normal, 0.0, atol=1e-15)
    assert normal @ view.direction_world < 0.0


@both_kinds
def test_noise_of_readings_fills_its_bounds_and_keeps_them(distribution):
    noise = bounded_noise(np.random.default_rng(12), 20_000, 3.0, distribution)
    assert 2.9 < np.abs(noise).max() <= 3.0
    deviation = {"uniform": 3.0 / np.sqrt(3.0), "gaussian": 1.5 * 0.8796}[distribution]
    assert noise.std() == pytest.approx(deviation, rel=0.02)
    assert abs(noise.mean()) < 0.05


@pytest.mark.parametrize("make", [grid, scanner])
def test_the_same_seed_gives_the_same_touch_to_the_bit(make):
    solid = oracles.model("housing")
    scene, before = ProbeScene(solid), pickle.dumps(np.random.get_state())  # noqa: NPY002
    place(scene, np.random.default_rng(13))

    def touched(seed: int) -> bytes:
        rng = np.random.default_rng(seed)
        return bytes_of(make(solid).touch(scene, ProbeCommand(0.0, 0.0, 0.2), rng))

    assert touched(1) == touched(1) != touched(2)
    assert pickle.dumps(np.random.get_state()) == before  # noqa: NPY002


def test_the_recogniser_keeps_the_truth_after_a_scan():
    rng, solid = np.random.default_rng(14), oracles.model("housing-34")
    scene, recognizer = ProbeScene(solid), Recognizer([solid])
    for sensor in (scanner(solid), grid(solid)):
        for _ in range(4):
            place(scene, rng)
            touch = sensor.touch(scene, command(rng, solid), rng)
            belief = recognizer.recognize(touch.contacts, free_space=touch.free_space)
            faces = truth_under(scene, touch).faces
            assert any((h.interpretations == faces).all(axis=1).any() for h in belief.hypotheses)


def test_both_are_sensors():
    solid = oracles.model("housing-34")
    sensors: list[Sensor] = [grid(solid), scanner(solid)]
    assert [sensor.features for sensor in sensors] == ["faces", "faces"]
    assert sensors[1].rays < 50


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"width": 0.0}, "width is 0 m"),
        ({"reach": -1.0}, "reach is -1 m"),
        ({"reach": 0.01}, "below the plane"),
        ({"spacing": (np.nan, 1e-3)}, "spacing is nan m"),
        ({"spacing": (1e-3, 0.05)}, "too coarse"),
        ({"spacing": (1e-5, 1e-5)}, "widen the spacing"),
        ({"points": 0}, "points is 0"),
        ({"elevation": 0.0}, "elevation is 0 rad"),
        ({"elevation": 2.0}, "elevation is 2 rad"),
        ({"range_error": 0.0}, "range_error is 0 m"),
        ({"range_error": 1e-3}, "at most"),
    ],
)
def test_a_wrong_argument_of_a_scanner_is_named(options, words):
    with pytest.raises(ValueError, match=words):
        RangeScanner(NOISE, **{"width": 0.2, "reach": 0.4, **options})


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"width": np.inf}, "width is inf m"),
        ({"reach": 0.0}, "reach is 0 m"),
        ({"reach": 0.1}, "below the plane"),
        ({"spacing": 0.3}, "needs less"),
        ({"spacing": 1e-4}, "widen the spacing"),
    ],
)
def test_a_wrong_argument_of_a_grid_is_named(options, words):
    with pytest.raises(ValueError, match=words):
        RangeGrid(NOISE, **{"width": 0.2, "reach": 0.4, **options})


def test_bounds_that_no_scan_can_keep_are_refused():
    solid = oracles.model("housing-34")
    scene, rng = ProbeScene(solid), np.random.default_rng(0)
    here, tight = ProbeCommand(0.0, 0.0, 0.0), SensorNoise(position_error=1e-8, normal_error=0.3)
    for sensor in (scanner(solid, tight), grid(solid, tight)):
        with pytest.raises(ValueError, match="exact to"):
            sensor.touch(scene, here, rng)
    # So wide a view that the readings are coarser than the object.
    loose = SensorNoise(position_error=1.0, normal_error=0.5)
    coarse = RangeScanner(loose, width=40.0 * solid.diameter, reach=80.0 * solid.diameter)
    with pytest.raises(ValueError, match="has an edge of"):
        coarse.touch(scene, here, rng)


def test_a_finer_bound_on_normals_makes_the_default_range_error_smaller():
    solid = oracles.model("housing-34")
    wide = scanner(solid)
    fine = scanner(solid, SensorNoise(position_error=2.54e-4, normal_error=0.01))
    assert fine.range_error < 0.3 * wide.range_error
    scene, rng = ProbeScene(solid), np.random.default_rng(15)
    place(scene, rng)
    contacts = fine.touch(scene, ProbeCommand(0.0, 0.0, 0.0), rng).contacts
    assert len(contacts)
    assert (contacts.normal_error <= 0.01).all()
