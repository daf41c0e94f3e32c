"""Where objects are put: across the plane, placed on it by probability, or dropped on it."""

from __future__ import annotations

from functools import cache

import mujoco
import numpy as np
import pytest
import trimesh
from oracles import solids as oracles
from scipy.spatial.transform import RigidTransform, Rotation

from palpate.assets import STAND_IN_NAMES
from palpate.envs.collision.collision import worked_out_parts
from palpate.envs.collision.mass import mass_properties, volume
from palpate.envs.scene.drop import MOST_TILT, DropScene, onto_plane
from palpate.envs.scene.placement import AcrossPlane, Resting
from palpate.envs.scene.resting_faces import resting_faces
from palpate.recognizer import Polyhedron, SupportPlane
from palpate.recognizer.contacts.support import StableFace, stable_faces

SOLIDS = ("cube", "tetrahedron", "l-block", "holed", "bridge", "hull-20")


@cache
def faces_of(model: Polyhedron) -> list[StableFace]:
    return stable_faces(model)


def face_below(model: Polyhedron, pose: RigidTransform) -> int:
    """The stable face that points down most."""
    normals = np.array([face.normal for face in faces_of(model)])
    return int(pose.rotation.apply(normals)[:, 2].argmin())


def assert_stands(model: Polyhedron, pose: RigidTransform, support: SupportPlane) -> None:
    """What `SupportPlane` promises, looked at corner by corner."""
    assert support.resting
    assert support.height == 0.0
    heights = pose.apply(model.vertices)[:, 2]
    assert heights.min() >= -support.error
    face = faces_of(model)[face_below(model, pose)]
    assert np.abs(pose.apply(face.corners)[:, 2]).max() <= support.error
    # And the centre of mass is above that face.
    foot = pose.apply(oracles.mesh_of(model).center_mass)[:2]
    outline = pose.apply(face.corners)[:, :2]
    assert in_outline(outline, foot, 2e-6 * model.diameter)


def in_outline(outline: np.ndarray, point: np.ndarray, slack: float) -> bool:
    edges = np.roll(outline, -1, axis=0) - outline
    to = point - outline
    turns = edges[:, 0] * to[:, 1] - edges[:, 1] * to[:, 0]
    turns /= np.linalg.norm(edges, axis=1)
    return bool((turns <= slack).all() or (turns >= -slack).all())


# --- Probabilities --------------------------------------------------------------------------


def test_a_cube_falls_on_each_face_one_time_in_six():
    resting = resting_faces(oracles.model("cube"))
    assert len(resting.faces) == 6
    assert np.allclose(resting.shares, 1 / 6, atol=1e-12)


def test_a_tetrahedron_falls_on_each_face_one_time_in_four():
    assert np.allclose(resting_faces(oracles.model("tetrahedron")).shares, 1 / 4, atol=1e-12)


def test_a_box_falls_on_a_face_as_often_as_its_solid_angle_says():
    """The solid angle of a rectangle seen from above its middle, in closed form."""
    sides = np.array([1.0, 2.0, 3.5])
    resting = resting_faces(Polyhedron.from_mesh(oracles.box(*sides), name="box"))
    assert len(resting.faces) == 6
    for face, share in zip(resting.faces, resting.shares, strict=True):
        axis = int(np.abs(face.normal).argmax())
        away = sides[axis] / 2
        a, b = np.delete(sides, axis)
        angle = 4 * np.arctan(a * b / (2 * away * np.sqrt(4 * away**2 + a**2 + b**2)))
        assert share == pytest.approx(angle / (4 * np.pi), rel=1e-9)


@pytest.mark.parametrize("name", [*STAND_IN_NAMES, *SOLIDS])
def test_the_shares_are_those_of_an_independent_computation(name):
    """trimesh's `compute_stable_poses`, which rolls over unstable faces too."""
    model = oracles.model(name)
    resting = resting_faces(model)
    assert resting.shares.sum() == pytest.approx(1.0, abs=1e-12)
    assert len(resting.faces) == len(stable_faces(model))
    poses, shares = oracles.mesh_of(model).compute_stable_poses(sigma=0, n_samples=1, threshold=0)
    expected = np.zeros(len(resting.faces))
    for pose, share in zip(poses, shares, strict=True):
        alike = [face.normal @ -pose[2, :3] for face in resting.faces]
        assert max(alike) > 1 - 1e-9
        expected[int(np.argmax(alike))] += share
    assert np.allclose(resting.shares, expected, atol=1e-6)


def test_a_leaning_prism_never_rests_on_the_end_it_would_fall_over_from():
    """It leans so far that its centre is beyond the end's edge; the end's share goes to a side."""
    prism = oracles.box(1.0, 1.0, 3.0)
    leaning = Polyhedron.from_mesh(
        trimesh.Trimesh(prism.vertices @ [[1, 0, 0], [0, 1, 0], [0.5, 0, 1]], prism.faces),
        name="leaning",
    )
    resting = resting_faces(leaning)
    assert len(resting.faces) == 4
    assert resting.shares.sum() == pytest.approx(1.0, abs=1e-12)
    assert max(abs(face.normal[2]) for face in resting.faces) < 0.9
    # It falls onto a side that leans, so those two get the ends' shares on top of their own.
    leant = np.array([abs(face.normal[0]) > 0.5 for face in resting.faces])
    assert resting.shares[leant].sum() > resting.shares[~leant].sum()


# --- Placed ---------------------------------------------------------------------------------


@pytest.mark.parametrize("name", [*STAND_IN_NAMES, *SOLIDS])
def test_a_placed_object_stands_as_its_support_promises(name):
    model = oracles.model(name)
    placement = Resting(offset=0.3 * model.diameter)
    support = placement.support(model)
    assert support is not None
    assert support.error <= 1e-5 * model.diameter
    rng = np.random.default_rng(1)
    for _ in range(40):
        pose = placement.draw(rng, model)
        assert abs(pose.apply(model.vertices)[:, 2].min()) <= 1e-15 * model.diameter
        assert np.linalg.norm(pose.apply(model.centroid)[:2]) <= 0.3 * model.diameter * (1 + 1e-9)
        assert_stands(model, pose, support)


def test_placed_objects_stand_on_each_face_as_often_as_its_share_says():
    model = oracles.model("housing")
    resting = resting_faces(model)
    rng = np.random.default_rng(2)
    placement = Resting(offset=0.0)
    below = [face_below(model, placement.draw(rng, model)) for _ in range(1000)]
    counts = np.bincount(below, minlength=len(resting.faces))
    expected = 1000 * resting.shares
    # Chi-squared with ten degrees of freedom: above 30 once in a thousand.
    assert ((counts - expected) ** 2 / expected).sum() < 30.0


def test_the_turn_about_the_vertical_is_any():
    model = oracles.model("cube")
    rng = np.random.default_rng(3)
    turns = []
    for _ in range(500):
        pose = Resting(offset=0.0).draw(rng, model)
        level = pose.rotation.as_matrix()[:2, np.abs(pose.rotation.as_matrix()[2]) < 0.5][:, 0]
        turns.append(np.arctan2(level[1], level[0]))
    quarters = np.bincount((np.array(turns) // (np.pi / 2)).astype(int) + 2, minlength=4)
    assert quarters.min() > 90


def test_positions_fill_the_disc_evenly():
    model = oracles.model("cube")
    rng = np.random.default_rng(4)
    away = [
        np.linalg.norm(Resting(offset=2.0).draw(rng, model).apply(model.centroid)[:2])
        for _ in range(1000)
    ]
    assert max(away) <= 2.0 + 1e-9
    assert np.mean(np.array(away) < 1.0) == pytest.approx(0.25, abs=0.05)


# --- Dropped --------------------------------------------------------------------------------


@pytest.mark.parametrize("name", [*STAND_IN_NAMES, *SOLIDS])
def test_a_dropped_object_comes_to_rest_flat_on_a_face_it_can_stand_on(name):
    model = oracles.model(name)
    scene = DropScene(model, worked_out_parts(model).parts)
    rng = np.random.default_rng(5)
    for _ in range(8):
        settled = scene.drop(rng)
        down = settled.T_world_object.rotation.apply(settled.face.normal)
        assert np.arccos(min(1.0, -down[2])) == pytest.approx(settled.tilt, abs=3e-8)
        # As stated where `Resting` is documented.
        assert settled.tilt <= 1e-4
        assert 0.0 <= settled.sunk <= 1e-5 * model.diameter
        heights = settled.T_world_object.apply(settled.face.corners)[:, 2]
        assert np.abs(heights).max() <= 1e-5 * model.diameter
        assert settled.upright.apply(settled.face.normal) == pytest.approx([0, 0, -1], abs=1e-12)
        turned = settled.upright * settled.T_world_object.rotation.inv()
        assert turned.magnitude() == pytest.approx(settled.tilt, abs=1e-12)


@pytest.mark.parametrize("name", ["housing", "complex-hand", "l-block", "hull-20"])
def test_what_dropping_returns_stands_as_its_support_promises(name, tmp_path):
    model = oracles.model(name)
    placement = Resting(offset=0.1, mode="dropped", parts_folder=tmp_path)
    support = placement.support(model)
    assert support is not None
    rng = np.random.default_rng(6)
    for _ in range(5):
        pose = placement.draw(rng, model)
        assert abs(pose.apply(model.vertices)[:, 2].min()) <= 1e-15 * model.diameter
        assert np.linalg.norm(pose.apply(model.centroid)[:2]) <= 0.1 * (1 + 1e-9)
        assert_stands(model, pose, support)


@pytest.mark.parametrize("mode", ["placed", "dropped"])
@pytest.mark.parametrize("name", ["housing", "stapler", "simple-hand"])
def test_an_object_left_where_it_rests_stays_there(name, mode, tmp_path):
    """In a scene of its own, of true size, with MuJoCo's default mass from the parts' volume."""
    model = oracles.model(name)
    spec = mujoco.MjSpec()
    spec.option.timestep = 0.001
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0.0, 0.0, 1.0])
    body = spec.worldbody.add_body(name="object")
    body.add_freejoint()
    for row, part in enumerate(worked_out_parts(model).parts):
        mesh = spec.add_mesh(name=f"part{row}")
        mesh.uservert = part.vertices.astype(np.float32).ravel()
        mesh.userface = part.triangles.astype(np.int32).ravel()
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=f"part{row}")
    for geom in spec.geoms:
        geom.solref[:] = 0.004, 1.0
    compiled = spec.compile()
    data = mujoco.MjData(compiled)
    rng = np.random.default_rng(7)
    placement = Resting(offset=0.05, mode=mode, parts_folder=tmp_path)
    for _ in range(4):
        pose = placement.draw(rng, model)
        mujoco.mj_resetData(compiled, data)
        data.qpos[:3] = pose.translation
        data.qpos[3:] = pose.rotation.as_quat(scalar_first=True)
        mujoco.mj_step(compiled, data, 500)
        after = RigidTransform.from_components(
            data.qpos[:3], Rotation.from_quat(data.qpos[3:], scalar_first=True)
        )
        moved = after.apply(model.vertices) - pose.apply(model.vertices)
        assert np.linalg.norm(moved, axis=1).max() < 1e-3 * model.diameter


def test_a_brick_falls_on_its_broad_sides_more_often_than_on_its_ends():
    model = Polyhedron.from_mesh(oracles.box(0.05, 0.06, 0.12), name="brick")
    scene = DropScene(model, worked_out_parts(model).parts)
    rng = np.random.default_rng(8)
    along = [int(np.abs(scene.drop(rng).face.normal).argmax()) for _ in range(60)]
    assert along.count(0) > 2 * along.count(2)


@pytest.mark.parametrize("diameter", [1e-3, 0.1, 10.0])
def test_size_makes_no_difference_to_a_drop(diameter):
    model = oracles.scaled("l-block", diameter)
    like = oracles.scaled("l-block", 0.25)
    one, other = (
        DropScene(m, worked_out_parts(m).parts).drop(np.random.default_rng(9))
        for m in (model, like)
    )
    assert np.allclose(one.face.normal, other.face.normal, atol=1e-9)
    assert one.tilt <= 1e-4
    assert one.sunk <= 1e-5 * diameter


def test_slippery_objects_come_to_rest_too():
    model = oracles.model("stapler")
    scene = DropScene(model, worked_out_parts(model).parts, friction=0.05)
    rng = np.random.default_rng(10)
    assert max(scene.drop(rng).tilt for _ in range(5)) <= 1e-4


# --- Randomness and bad input ---------------------------------------------------------------


@pytest.mark.parametrize("mode", ["placed", "dropped"])
def test_the_same_seed_gives_the_same_pose_to_the_bit(mode, tmp_path):
    model = oracles.model("housing-34")
    placement = Resting(offset=0.1, mode=mode, parts_folder=tmp_path)

    def poses(seed: int) -> list[bytes]:
        rng = np.random.default_rng(seed)
        return [placement.draw(rng, model).as_matrix().tobytes() for _ in range(4)]

    assert poses(11) == poses(11)
    assert poses(11) != poses(12)
    assert len(set(poses(11))) == 4


def test_a_scene_dropped_in_before_gives_the_same_pose():
    model = oracles.model("l-block")
    parts = worked_out_parts(model).parts
    used = DropScene(model, parts)
    used.drop(np.random.default_rng(13))
    again = used.drop(np.random.default_rng(14)).T_world_object.as_matrix()
    fresh = DropScene(model, parts).drop(np.random.default_rng(14)).T_world_object.as_matrix()
    assert again.tobytes() == fresh.tobytes()


def test_the_object_lies_across_the_plane():
    model = oracles.model("housing")
    rng = np.random.default_rng(0)
    placement = AcrossPlane(offset=0.01)
    assert placement.support(model) is None
    for _ in range(200):
        pose = placement.draw(rng, model)
        heights = pose.apply(model.vertices)[:, 2]
        sunk = -heights.min() / np.ptp(heights)
        assert 0.1 - 1e-9 <= sunk <= 0.5 + 1e-9
        assert np.linalg.norm(pose.apply(model.centroid)[:2]) <= 0.01 + 1e-12


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Resting(offset=-1.0), "offset is -1 m"),
        (lambda: Resting(offset=float("nan")), "offset is nan m"),
        (lambda: AcrossPlane(offset=float("inf")), "offset is inf m"),
        (lambda: AcrossPlane(offset=0.1, sunk=(0.5, 0.1)), "two shares"),
        (lambda: AcrossPlane(offset=0.1, sunk=(0.0, 1.5)), "two shares"),
        (lambda: Resting(offset=0.1, mode="thrown"), "'thrown'.*'placed' or 'dropped'"),  # type: ignore[arg-type]
        (lambda: mass_properties(oracles.model("cube"), 0.0), "density is 0"),
        (lambda: DropScene(oracles.model("cube"), (), friction=0.0), "friction is 0"),
    ],
)
def test_a_wrong_argument_is_named(make, words):
    with pytest.raises(ValueError, match=words):
        make()


def test_an_object_that_never_rests_is_said(monkeypatch):
    monkeypatch.setattr("palpate.envs.scene.drop.LONGEST", 0.05)
    monkeypatch.setattr("palpate.envs.scene.drop.MOST_DROPS", 3)
    model = oracles.model("cube")
    scene = DropScene(model, worked_out_parts(model).parts)
    with pytest.raises(ValueError, match="cube: dropped 3 times"):
        scene.drop(np.random.default_rng(0))


# --- Mass, and standing a face on the plane -------------------------------------------------


@pytest.mark.parametrize("name", [*STAND_IN_NAMES, *SOLIDS])
def test_mass_centre_and_inertia_are_those_of_an_independent_computation(name):
    model = oracles.model(name)
    found = mass_properties(model, 2700.0)
    mesh = oracles.mesh_of(model)
    mesh.density = 2700.0
    assert found.mass == pytest.approx(mesh.mass, rel=1e-9)
    assert volume(model) == pytest.approx(mesh.volume, rel=1e-9)
    assert np.allclose(found.centre_object, mesh.center_mass, atol=1e-9 * model.diameter)
    assert np.allclose(
        found.inertia_object, mesh.moment_inertia, atol=1e-9 * mesh.mass * model.diameter**2
    )


def test_the_inertia_of_a_box_is_the_textbooks():
    a, b, c = 0.1, 0.2, 0.4
    found = mass_properties(Polyhedron.from_mesh(oracles.box(a, b, c), name="box"), 500.0)
    expected = np.diag([b * b + c * c, a * a + c * c, a * a + b * b]) * found.mass / 12.0
    assert found.mass == pytest.approx(4.0)
    assert np.allclose(found.inertia_object, expected, rtol=1e-9, atol=1e-15)


def test_the_simulated_body_has_the_mass_of_the_surface_and_not_of_overlapping_parts():
    model = oracles.scaled("housing", 0.1)
    scene = DropScene(model, worked_out_parts(model).parts)
    expected = mass_properties(model, 1000.0)
    assert scene._compiled.body_mass[1] == pytest.approx(expected.mass, rel=1e-9)
    assert np.allclose(scene._compiled.body_ipos[1], expected.centre_object, atol=1e-12)
    principal = np.linalg.eigvalsh(expected.inertia_object)
    assert np.allclose(np.sort(scene._compiled.body_inertia[1]), principal, rtol=1e-9)


def test_a_face_is_turned_onto_the_plane_by_the_shortest_way():
    rng = np.random.default_rng(15)
    face = stable_faces(oracles.model("cube"))[0]
    for rotation in [Rotation.identity(), *Rotation.random(50, rng=rng)]:
        upright = onto_plane(rotation, face)
        before, after = rotation.apply(face.normal), upright.apply(face.normal)
        assert after == pytest.approx([0, 0, -1], abs=1e-12)
        turned = (upright * rotation.inv()).magnitude()
        assert turned == pytest.approx(np.arccos(np.clip(-before[2], -1, 1)), abs=1e-7)
    for face in stable_faces(oracles.model("cube")):
        upright = onto_plane(Rotation.identity(), face)
        assert upright.apply(face.normal) == pytest.approx([0, 0, -1], abs=1e-12)


def test_the_tilt_that_a_drop_may_end_with_is_small():
    assert MOST_TILT <= 0.01
