"""Range sensing: the rays, the planes through patches, and bounds that hold.

True points and normals come from the recogniser's ray caster, which knows nothing of MuJoCo; true
bounds of planes from scipy's linear programs.
"""

from __future__ import annotations

import pickle

import numpy as np
import pytest
import trimesh
from oracles import solids as oracles
from scipy.optimize import linprog
from scipy.spatial.transform import RigidTransform, Rotation

from palpate.assets import STAND_IN_NAMES
from palpate.envs.scene.placement import AcrossPlane
from palpate.envs.scene.scene import OBJECT, PLANE, ProbeScene
from palpate.envs.sensors.noise import SensorNoise
from palpate.envs.sensors.patch_bounds import GRID, MIDDLE, normal_bound, possible_slopes
from palpate.envs.sensors.patches import (
    ARM,
    SIDE,
    best_of_blocks,
    fit_patches,
    patch_residuals,
    spread_out,
)
from palpate.envs.sensors.range_image import RangeView, bounded_noise
from palpate.envs.sensors.range_points import FLAT
from palpate.envs.sensors.range_sensor import (
    COARSEST,
    SHORTEST_EDGE,
    RangeGrid,
    RangeScanner,
)
from palpate.envs.sensors.touch import ProbeCommand, Sensor, Touch
from palpate.recognizer import FACE, Polyhedron, Recognizer
from palpate.recognizer.models.rays import cast_rays

NOISE = SensorNoise(position_error=2.54e-4, normal_error=np.pi / 10.0)
SPACING = (4e-4, 8e-4)

every_stand_in = pytest.mark.parametrize("name", STAND_IN_NAMES)
both_kinds = pytest.mark.parametrize("distribution", ["uniform", "gaussian"])


def scanner(model: Polyhedron, noise: SensorNoise = NOISE, **options) -> RangeScanner:
    """A scanner that sees all of a model near the origin, at a coarse grid."""
    width, reach = 1.5 * model.diameter, 2.0 * model.diameter
    options.setdefault("spacing", (width / 180.0, width / 90.0))
    return RangeScanner(noise, width=width, reach=reach, **options)


def grid(model: Polyhedron, noise: SensorNoise = NOISE, **options) -> RangeGrid:
    return RangeGrid(noise, width=1.5 * model.diameter, reach=2.0 * model.diameter, **options)


def command(rng: np.random.Generator, model: Polyhedron) -> ProbeCommand:
    x, y = rng.uniform(-0.1, 0.1, 2) * model.diameter
    return ProbeCommand(float(x), float(y), float(rng.uniform(-np.pi / 3.0, np.pi / 3.0)))


def place(scene: ProbeScene, rng: np.random.Generator, **options) -> None:
    scene.place(AcrossPlane(offset=0.1 * scene.model.diameter, **options).draw(rng, scene.model))


def truth_under(scene: ProbeScene, touch: Touch):
    """What the rays of a touch's contacts truly meet, by the recogniser's caster."""
    contacts = touch.contacts
    starts, directions = touch.starts_world[touch.outcomes == OBJECT], np.array(contacts.approaches)
    return cast_rays(scene.model, scene.T_world_object, starts, directions)


def assert_bounds_hold(scene: ProbeScene, touch: Touch) -> None:
    contacts, hits = touch.contacts, truth_under(scene, touch)
    assert hits.hit.all()
    off = np.linalg.norm(contacts.positions - hits.points_world, axis=1)
    assert (off <= contacts.position_error).all()
    sines = np.linalg.norm(np.cross(contacts.normals, hits.normals_world), axis=1)
    lean = np.arctan2(sines, (contacts.normals * hits.normals_world).sum(axis=1))
    assert (lean <= contacts.normal_error).all()


# --- Grids -----------------------------------------------------------------------------------


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


# --- Planes through patches --------------------------------------------------------------------


def test_planes_through_patches_are_those_of_least_squares():
    rng = np.random.default_rng(1)
    depths = rng.normal(size=(9, 8))
    fits = fit_patches(depths)
    for i, j in np.ndindex(5, 4):
        patch = depths[i : i + SIDE, j : j + SIDE].ravel()
        design = np.column_stack([GRID, np.ones(len(GRID))])
        plane = np.linalg.lstsq(design, patch)[0]
        assert np.allclose([*fits.slopes[i, j], fits.heights[i, j]], plane)
        residuals = patch - design @ plane
        assert np.allclose(patch_residuals(depths, fits, (i, j)).ravel(), residuals)
        assert fits.residuals[i, j] == pytest.approx(np.abs(residuals).max())


def test_a_patch_is_as_flat_as_the_worst_of_its_neighbours():
    rng = np.random.default_rng(2)
    depths = rng.normal(size=(12, 11))
    depths[0, 0] = np.nan
    fits = fit_patches(depths)
    flatness = fits.flatness
    assert np.isinf(flatness[[0, -1]]).all()
    assert np.isinf(flatness[:, [0, -1]]).all()
    assert np.isinf(flatness[1, 1])
    assert flatness[3, 4] == fits.residuals[2:5, 3:6].max()


def test_chosen_patches_are_flat_and_do_not_overlap_within_a_block():
    rng = np.random.default_rng(3)
    fits = fit_patches(rng.normal(size=(60, 50)))
    chosen = best_of_blocks(fits, 2.2)
    assert len(chosen) > 10
    assert (fits.flatness[tuple(chosen.T)] <= 2.2).all()
    assert len(np.unique(chosen // SIDE, axis=0)) == len(chosen)
    residuals = fits.residuals[tuple(chosen.T)]
    assert (np.diff(residuals) >= 0.0).all()


def test_places_are_chosen_with_independent_normals_and_then_far_apart():
    points = np.column_stack([np.arange(10.0), np.zeros(10), np.zeros(10)])
    normals = np.tile([0.0, 0.0, 1.0], (10, 1))
    normals[4] = [0.0, 1.0, 0.0]
    normals[7] = [1.0, 0.0, 0.0]
    chosen = spread_out(points, normals, 5, lambda row: True)
    assert chosen[0] == 0
    assert set(chosen[1:3]) == {4, 7}
    assert chosen[3] == 2
    asked = []
    assert 4 not in spread_out(points, normals, 10, lambda row: bool(asked.append(row) or row != 4))
    assert sorted(asked) == list(range(10))


# --- The bound on a normal ---------------------------------------------------------------------


def quarters() -> list[np.ndarray]:
    """Masks of the readings in right angles with their corner in the middle, every half degree."""
    bearings = np.degrees(np.arctan2(GRID[:, 1], GRID[:, 0]))
    masks = {}
    for first in np.arange(0.25, 360.0, 0.5):
        mask = (bearings - first) % 360.0 <= 90.0
        mask[MIDDLE] = True
        masks[mask.tobytes()] = mask
    return list(masks.values())


def steepest_by_linear_program(low, high, towards) -> float:
    """The largest slope of a plane between two bounds, in a direction; minus infinity for none."""
    design = np.column_stack([GRID, np.ones(len(GRID))])
    upper, lower = np.isfinite(high), np.isfinite(low)
    found = linprog(
        -np.append(towards, 0.0),
        A_ub=np.concatenate([design[upper], -design[lower]]),
        b_ub=np.concatenate([high[upper], -low[lower]]),
        bounds=[(None, None)] * 3,
    )
    return -found.fun if found.status == 0 else -np.inf


def test_possible_slopes_are_those_of_linear_programs():
    rng, infinite = np.random.default_rng(4), np.full(len(GRID), np.inf)
    for _ in range(4):
        depths = rng.uniform(-1.0, 1.0, (SIDE, SIDE))
        residuals = patch_residuals(depths, fit_patches(depths), (0, 0))
        slopes = possible_slopes(residuals, 1.0)
        low, high = residuals.ravel() - 1.0, residuals.ravel() + 1.0
        middle = np.arange(len(GRID)) == MIDDLE
        cases = [(np.where(q, low, -infinite), np.where(q, high, infinite)) for q in quarters()]
        cases += [(np.where(middle, low, -infinite), high), (low, np.where(middle, high, infinite))]
        assert len(cases) == 18
        for bearing in rng.uniform(0.0, 2.0 * np.pi, 3):
            towards = np.array([np.cos(bearing), np.sin(bearing)])
            wanted = max(steepest_by_linear_program(*case, towards) for case in cases)
            assert (slopes @ towards).max() == pytest.approx(wanted, abs=1e-5)


def plane_at(slopes) -> np.ndarray:
    """(25,) a plane through zero in the middle of a patch."""
    return GRID @ slopes


def angle(slopes, others) -> float:
    u, v = np.append(slopes / np.array(SPACING), 1.0), np.append(others / np.array(SPACING), 1.0)
    return float(np.arctan2(np.linalg.norm(np.cross(u, v)), u @ v))


def surfaces(rng: np.random.Generator):
    """Patches of two to five faces: depths, and slopes of the face in the middle."""
    scale = 10.0 ** rng.uniform(-2.0, 0.5)
    own = scale * rng.normal(size=2)
    others = scale * rng.normal(size=(4, 2))
    heights = 0.3 * scale * rng.random(4)
    further = np.array([plane_at(s) for s in others])
    kind = rng.integers(3)
    if kind == 0:  # bulging: no other face is before the one in the middle, there
        return np.maximum(plane_at(own), (further - heights[:, None]).max(axis=0)), own
    if kind == 1:
        return np.minimum(plane_at(own), (further + heights[:, None]).min(axis=0)), own
    shown = quarters()[rng.integers(16)]
    return np.where(shown, plane_at(own), rng.normal(size=len(GRID)) * scale), own


def test_the_face_in_the_middle_is_within_the_bound_whatever_else_a_patch_shows():
    """Noise is at its worst: it hides the other faces as far as it can."""
    rng, error, close = np.random.default_rng(5), 1e-2, 0.0
    design = np.column_stack([GRID, np.ones(len(GRID))])
    for _ in range(500):
        depths, own = surfaces(rng)
        fitted = design @ np.linalg.lstsq(design, depths)[0]
        noise = np.clip(fitted - depths, -error, error)
        if rng.random() < 0.5:
            noise = error * rng.choice([-1.0, 1.0], len(GRID))
        read = (depths + noise).reshape(SIDE, SIDE)
        fits = fit_patches(read)
        slopes = fits.slopes[0, 0]
        bound = normal_bound(slopes, patch_residuals(read, fits, (0, 0)), SPACING, error)
        assert angle(slopes, own) <= bound
        close = max(close, angle(slopes, own) / bound)
    assert close > 0.8  # the bound is not much wider than it must be


def test_patches_that_no_noise_explains_are_unbounded():
    checkered = np.where(np.indices((SIDE, SIDE)).sum(axis=0) % 2 == 0, 10.0, -10.0)
    checkered[ARM, ARM] = 0.0
    assert normal_bound(np.zeros(2), checkered, SPACING, 1.0) == np.pi


# --- The scanner -------------------------------------------------------------------------------


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


def window_depths(solid: Polyhedron, rng: np.random.Generator, columns: int, rows: int):
    """Depths along rays straight down onto an edge or a corner of a solid, and the faces there."""
    pose = RigidTransform.from_components(np.zeros(3), Rotation.random(rng=rng))
    edge = solid.edges[rng.integers(len(solid.edges))]
    middle = pose.apply(edge[0] + rng.random() * rng.integers(2) * (edge[1] - edge[0]))
    at = middle[:2] + np.array(SPACING) * (
        np.indices((columns, rows)).reshape(2, -1).T - (columns // 2, rows // 2) + rng.random(2)
    )
    starts = np.column_stack([at, np.full(len(at), 0.5)])
    hits = cast_rays(solid, pose, starts, np.tile([0.0, 0.0, -1.0], (len(starts), 1)))
    depths = np.where(hits.hit, hits.distances, np.nan)
    normals = pose.rotation.apply(solid.normals)[hits.faces]
    return depths.reshape(columns, rows), normals.reshape(columns, rows, 3)


def test_noise_made_to_hide_edges_hides_none_that_break_the_bound():
    """Small objects, near edges and corners, at the coarsest error and the shortest edges allowed.

    The noise makes each patch with its neighbours as flat as it can.
    """
    rng, error = np.random.default_rng(7), COARSEST * min(SPACING)
    places = np.indices((SIDE + 2, SIDE + 2)).reshape(2, -1).T - ARM - 1.0
    design = np.column_stack([places, np.ones(len(places))])
    fit = design @ np.linalg.pinv(design)
    hidden = 0
    for name in [*STAND_IN_NAMES, "hull-20", "bridge", "pocketed"]:
        solid = oracles.model(name)
        lengths = np.linalg.norm(solid.edges[:, 1] - solid.edges[:, 0], axis=1)
        scale = SHORTEST_EDGE * error / lengths.min()
        small = Polyhedron.from_mesh(
            trimesh.Trimesh(scale * solid.vertices, solid.triangles, process=False), name=name
        )
        for _ in range(50):
            depths, normals = window_depths(small, rng, 40, 30)
            flatness = fit_patches(depths).flatness
            mixed = (flatness <= 1.5 * (FLAT + 1.0) * error) & (flatness > 1e-9)
            for i, j in np.argwhere(mixed):
                window = depths[i - 1 : i + SIDE + 1, j - 1 : j + SIDE + 1]
                flat = (fit @ window.ravel()).reshape(window.shape)
                read = window + np.clip(flat - window, -error, error)
                fits = fit_patches(read)
                if fits.residuals.max() > FLAT * error:
                    continue
                residuals = patch_residuals(read, fits, (1, 1))
                bound = normal_bound(fits.slopes[1, 1], residuals, SPACING, error)
                normal = normals[i + ARM, j + ARM]
                true = normal[:2] / normal[2] * SPACING
                assert angle(fits.slopes[1, 1], true) <= bound, (name, i, j)
                hidden += 1
    assert hidden > 100


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

    def digest(seed: int) -> bytes:
        touch = make(solid).touch(scene, ProbeCommand(0.0, 0.0, 0.2), np.random.default_rng(seed))
        contacts = touch.contacts
        arrays = (touch.starts_world, touch.ends_world, touch.outcomes, contacts.normals)
        return b"".join(array.tobytes() for array in (*arrays, contacts.normal_error))

    assert digest(1) == digest(1) != digest(2)
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
