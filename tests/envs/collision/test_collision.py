"""Collision parts: their union is the solid, whatever solid it is, and if it isn't they say so."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import cache
from pathlib import Path

import mujoco
import numpy as np
import pytest
import trimesh
from manifold3d import Manifold
from oracles import solids as oracles
from scipy.spatial.transform import RigidTransform, Rotation

from palpate.assets import STAND_IN_NAMES, ConvexPart, load_parts
from palpate.envs.collision import collision, convex_cuts
from palpate.envs.collision.collision import (
    MOST_STRAY,
    CollisionParts,
    collision_parts,
    parts_key,
    worked_out_parts,
)
from palpate.envs.collision.convex_cells import Cell, Plane, split_polygon
from palpate.envs.collision.hull import Hull
from palpate.envs.collision.parts_check import stray
from palpate.recognizer import Polyhedron
from palpate.recognizer.models.rays import cast_rays
from palpate.recognizer.tables import file_cache

# --- Solids and oracles ---------------------------------------------------------------------


def user_mesh(name: str) -> Polyhedron:
    """A stand-in as a mesh that nothing is known of."""
    return replace(oracles.model(name), name=f"my {name}")


def some_convex_solid(rng: np.random.Generator) -> Manifold:
    """A box, a prism or a random hull, mostly turned and off centre."""
    kind = rng.integers(3)
    if kind == 0:
        points = np.stack(np.meshgrid([-1, 1], [-1, 1], [-1, 1]), axis=-1).reshape(-1, 3)
        points = points * rng.uniform(0.15, 0.6, 3)
    elif kind == 1:
        points = oracles.prism(int(rng.integers(3, 8)), 1.0).vertices * rng.uniform(0.2, 0.6, 3)
    else:
        points = oracles.random_hull(int(rng.integers(5, 10)), int(rng.integers(1000))).vertices
    if rng.random() < 0.6:
        points = Rotation.random(rng=rng).apply(points)
    if rng.random() < 0.8:
        points = points + rng.uniform(-0.4, 0.4, 3)
    return Manifold.hull_points(np.ascontiguousarray(points, np.float64))


@cache
def random_csg(seed: int) -> Polyhedron:
    """Convex solids added and taken away, a few centimetres large: notches, holes and all."""
    rng = np.random.default_rng(seed)
    solid = some_convex_solid(rng)
    for _ in range(int(rng.integers(1, 6))):
        other = some_convex_solid(rng)
        solid = solid + other if rng.random() < 0.5 else solid - other
    mesh = solid.to_mesh64()
    vertices = 0.05 * np.asarray(mesh.vert_properties)[:, :3]
    faces = np.asarray(mesh.tri_verts).astype(np.int64)
    return Polyhedron.from_mesh(trimesh.Trimesh(vertices, faces, process=False), name=f"csg-{seed}")


CSG_SEEDS = tuple(range(100, 109))


def convex_solids() -> dict[str, Polyhedron]:
    """Johnson solids, Archimedean ones and the like."""
    square = np.array([[1, 1, 0], [1, -1, 0], [-1, 1, 0], [-1, -1, 0]], float)
    permuted = np.array([np.roll([0, a, b], k) for k in range(3) for a in (-1, 1) for b in (-1, 1)])
    truncated = [
        np.array(order) * signs
        for order in ((0, 1, 2), (0, 2, 1), (1, 0, 2), (1, 2, 0), (2, 0, 1), (2, 1, 0))
        for signs in np.stack(np.meshgrid([-1, 1], [-1, 1], [-1, 1]), axis=-1).reshape(-1, 3)
    ]
    points = {
        "square pyramid": [*square, [0, 0, 2**0.5]],
        "elongated pyramid": [*square, *(square + [0, 0, 2]), [0, 0, 2 + 2**0.5]],
        "gyrobifastigium": [*square, *[[x, 0, 3**0.5] for x in (-1, 1)]]
        + [[0, y, -(3**0.5)] for y in (-1, 1)],
        "cuboctahedron": permuted,
        "truncated octahedron": truncated,
        "needle": oracles.prism(5, 40.0).vertices,
        "plate": oracles.prism(7, 0.01).vertices,
    }
    return {
        name: Polyhedron.from_mesh(oracles.hull_of(0.02 * np.asarray(corners)), name=name)
        for name, corners in points.items()
    }


def winding(model: Polyhedron, points: np.ndarray) -> np.ndarray:
    """Solid angle of the surface seen from each point, over 4 pi (Van Oosterom & Strackee)."""
    a, b, c = (model.vertices[model.triangles][None, :, i] - points[:, None] for i in range(3))
    la, lb, lc = (np.linalg.norm(x, axis=-1) for x in (a, b, c))
    above = np.einsum("pti,pti->pt", a, np.cross(b, c))
    below = la * lb * lc + (a * b).sum(-1) * lc + (b * c).sum(-1) * la + (c * a).sum(-1) * lb
    return np.arctan2(above, below).sum(axis=1) / (2 * np.pi)


def in_parts(parts: tuple[ConvexPart, ...], points: np.ndarray) -> np.ndarray:
    return np.any([in_part(part, points) for part in parts], axis=0)


def in_part(part: ConvexPart, points: np.ndarray) -> np.ndarray:
    """Below every triangle that has a direction to speak of."""
    a, b, c = part.vertices[part.triangles].transpose(1, 0, 2)
    normals = np.cross(b - a, c - a)
    sizes = np.linalg.norm(normals, axis=1)
    broad = sizes > 1e-9 * np.ptp(part.vertices, axis=0).max() ** 2
    normals = normals[broad] / sizes[broad, None]
    return ((points[:, None] - a[broad]) * normals).sum(axis=-1).max(axis=1) <= 0.0


def trial_points(model: Polyhedron, rng: np.random.Generator, count: int = 250) -> np.ndarray:
    """Points all over the box around a solid, and others a hair above and below its surface."""
    low, high = model.vertices.min(axis=0), model.vertices.max(axis=0)
    rows = rng.integers(len(model.triangles), size=count)
    on_surface = oracles.points_on(model, rows, rng)
    hair = 1e-4 * model.diameter * model.normals[model.triangle_faces[rows]]
    anywhere = rng.uniform(low - 0.05 * (high - low), high + 0.05 * (high - low), (count, 3))
    return np.concatenate([anywhere, on_surface + hair, on_surface - hair])


def mesh_volume(model: Polyhedron) -> float:
    return float(trimesh.Trimesh(model.vertices, model.triangles, process=False).volume)


def part_volumes(parts: tuple[ConvexPart, ...]) -> float:
    return sum(
        float(trimesh.Trimesh(part.vertices, part.triangles, process=False).volume)
        for part in parts
    )


def assert_union_is_the_solid(model: Polyhedron, found: CollisionParts) -> None:
    points = trial_points(model, np.random.default_rng(0))
    inside = winding(model, points)
    assert np.abs(inside - np.round(inside)).max() < 1e-6
    assert inside.max() > 0.5 > inside.min()
    assert np.array_equal(in_parts(found.parts, points), inside > 0.5)


def remade(model: Polyhedron, vertices: np.ndarray) -> Polyhedron:
    mesh = trimesh.Trimesh(vertices, model.triangles, process=False)
    return Polyhedron.from_mesh(mesh, name=model.name)


def together(one: trimesh.Trimesh, other: trimesh.Trimesh) -> Polyhedron:
    """Two surfaces as one mesh."""
    vertices = np.concatenate([one.vertices, other.vertices])
    faces = np.concatenate([one.faces, other.faces + len(one.vertices)])
    return Polyhedron.from_mesh(trimesh.Trimesh(vertices, faces, process=False), name="two")


ROTATION = Rotation.from_rotvec([0.3, 0.7, 0.2])

# --- The union is the solid -----------------------------------------------------------------


@pytest.mark.parametrize("name", STAND_IN_NAMES)
def test_a_stand_in_has_the_parts_it_was_built_from(name):
    model = oracles.model(name)
    found = worked_out_parts(model)
    own = load_parts(name)
    assert len(found.parts) == len(own)
    for part, other in zip(found.parts, own, strict=True):
        assert np.array_equal(part.vertices, other.vertices)
        assert np.array_equal(part.triangles, other.triangles)
    assert found.stray <= 1e-9 * model.diameter
    assert_union_is_the_solid(model, found)


@pytest.mark.parametrize("name", STAND_IN_NAMES)
def test_a_stand_in_cut_as_any_mesh_gives_hardly_more_parts_than_it_was_built_from(name):
    model = user_mesh(name)
    found = worked_out_parts(model)
    assert len(found.parts) <= len(load_parts(name)) + 1
    assert found.stray <= 1e-9 * model.diameter
    assert part_volumes(found.parts) == pytest.approx(mesh_volume(model), rel=1e-9)
    assert_union_is_the_solid(model, found)


@pytest.mark.parametrize(("name", "most"), [("l-block", 2), ("bridge", 3), ("pocketed", 5)])
def test_simple_notches_give_the_fewest_parts(name, most):
    model = oracles.model(name)
    found = worked_out_parts(model)
    assert len(found.parts) == most
    assert_union_is_the_solid(model, found)


def test_a_hole_through_a_block_stays_a_hole():
    model = oracles.model("holed")
    found = worked_out_parts(model)
    assert len(found.parts) == 4
    assert not in_parts(found.parts, np.array([[1.6, 1.75, z] for z in (0.0, 0.5, 1.0)])).any()
    assert_union_is_the_solid(model, found)


def hollow_block() -> Polyhedron:
    """A block with a void inside that doesn't show."""
    cells = np.ones((3, 3, 3))
    cells[1, 1, 1] = 0
    lines = [0.0, 0.01, 0.03, 0.04]
    return Polyhedron.from_mesh(oracles.blocks(cells, lines, lines, lines), name="hollow")


def test_a_void_inside_a_block_stays_a_void():
    model = hollow_block()
    found = worked_out_parts(model)
    assert len(found.parts) == 6
    assert_union_is_the_solid(model, found)


def test_bodies_apart_are_parts_of_their_own():
    model = together(oracles.box(1, 1, 1), oracles.box(1, 2, 1).apply_translation([3, 0, 0]))
    found = worked_out_parts(model)
    assert len(found.parts) == 2
    assert_union_is_the_solid(model, found)


@pytest.mark.parametrize("seed", CSG_SEEDS)
def test_the_parts_of_a_random_solid_fill_it_and_nothing_else(seed):
    model = random_csg(seed)
    found = worked_out_parts(model)
    assert found.stray <= 1e-8 * model.diameter
    assert part_volumes(found.parts) == pytest.approx(mesh_volume(model), rel=1e-7)
    assert_union_is_the_solid(model, found)


def test_the_random_solids_are_hard_enough():
    notches = [len(convex_cuts.reflex_edges(random_csg(seed))[0]) for seed in CSG_SEEDS]
    genus = [
        1 - trimesh.Trimesh(m.vertices, m.triangles, process=False).euler_number / 2
        for m in map(random_csg, CSG_SEEDS)
    ]
    assert np.median(notches) >= 10
    assert max(notches) >= 40
    assert max(genus) >= 1


@pytest.mark.parametrize("name", convex_solids())
def test_a_convex_solid_is_its_own_part(name):
    model = convex_solids()[name]
    (part,) = worked_out_parts(model).parts
    assert {tuple(corner) for corner in part.vertices} <= {tuple(v) for v in model.vertices}
    assert part_volumes((part,)) == pytest.approx(mesh_volume(model), rel=1e-9)


@pytest.mark.parametrize("scale", [1e-3, 1e3])
@pytest.mark.parametrize("name", ["housing", "pocketed"])
def test_size_and_attitude_make_no_difference(name, scale):
    model = replace(oracles.model(name), name="mine")
    turned = remade(model, scale * ROTATION.apply(model.vertices))
    found = worked_out_parts(turned)
    assert len(found.parts) == len(worked_out_parts(model).parts)
    assert found.stray <= 1e-9 * turned.diameter
    assert_union_is_the_solid(turned, found)


@pytest.mark.parametrize("name", [*STAND_IN_NAMES, "holed", "hull-20"])
def test_coordinates_in_single_precision_cost_only_what_they_round(name):
    model = replace(oracles.model(name), name="mine")
    rounded = remade(model, ROTATION.apply(model.vertices).astype(np.float32).astype(float))
    found = worked_out_parts(rounded)
    assert found.stray <= 2e-6 * rounded.diameter
    assert len(found.parts) <= len(worked_out_parts(model).parts) + 1
    assert_union_is_the_solid(rounded, found)


@pytest.mark.parametrize("name", ["my stapler", "holed"])
def test_mujoco_meets_the_parts_where_geometry_meets_the_mesh(name):
    model = user_mesh("stapler") if name == "my stapler" else oracles.model(name)
    spec = mujoco.MjSpec()
    for row, part in enumerate(worked_out_parts(model).parts):
        mesh = spec.add_mesh(name=f"part{row}")
        mesh.uservert = part.vertices.astype(np.float32).ravel()
        mesh.userface = part.triangles.astype(np.int32).ravel()
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=f"part{row}")
    compiled = spec.compile()
    data = mujoco.MjData(compiled)
    mujoco.mj_forward(compiled, data)
    rng = np.random.default_rng(1)
    away = rng.normal(size=(300, 3))
    away *= 2.0 * model.diameter / np.linalg.norm(away, axis=1, keepdims=True)
    starts = model.centroid + away
    ends = rng.uniform(model.vertices.min(axis=0), model.vertices.max(axis=0), (300, 3))
    directions = (ends - starts) / np.linalg.norm(ends - starts, axis=1, keepdims=True)
    hits = cast_rays(model, RigidTransform.identity(), starts, directions)
    geom = np.empty(1, np.int32)
    depths = np.array(
        [
            mujoco.mj_ray(compiled, data, start, direction, None, True, -1, geom, None)
            for start, direction in zip(starts, directions, strict=True)
        ]
    )
    assert hits.hit.sum() > 100
    assert np.array_equal(depths >= 0, hits.hit)
    assert np.allclose(depths[hits.hit], hits.distances[hits.hit], atol=1e-5 * model.diameter)


def test_a_hull_keeps_true_corners_only_and_one_plane_a_facet():
    box = oracles.box(1, 2, 3).vertices
    rng = np.random.default_rng(5)
    on_edges = np.array([[0, 0, z] for z in (0.3, 1.0, 2.2)])
    on_facet = np.column_stack([np.ones(9), rng.uniform(0, 2, 9), rng.uniform(0, 3, 9)])
    twice = box + 1e-12 * rng.normal(size=box.shape)
    for pose in (Rotation.identity(), ROTATION):
        points = pose.apply(np.concatenate([on_edges, box, on_facet, twice, [[0.5, 1, 1]]]))
        hull = Hull.around(points, 1e-9)
        assert hull is not None
        assert len(hull.corners) == 8
        assert len(hull.normals) == 6
        assert hull.volume == pytest.approx(6.0)
        assert hull.heights(pose.apply(box)).max() <= 1e-9
    assert Hull.around(on_facet, 1e-9) is None
    assert Hull.around(box * [1.0, 1.0, 1e-10], 1e-9) is None


# --- How far they stray ---------------------------------------------------------------------


def resized(part: ConvexPart, share: float) -> ConvexPart:
    middle = part.vertices.mean(axis=0)
    return ConvexPart(middle + (1.0 + share) * (part.vertices - middle), part.triangles)


@pytest.mark.parametrize("share", [-3e-6, -4e-8, 0.0, 2e-8, 5e-7, 1e-6])
def test_the_stray_of_a_box_too_large_or_too_small_is_that_of_its_corners(share):
    model = oracles.model("cube")
    (part,) = worked_out_parts(model).parts
    off = abs(share) * model.diameter / 2.0
    bound = stray(model, [resized(part, share)])
    assert bound is not None
    # The next step of 1, 2, 5, 10 above the truth.
    assert off <= bound <= max(2.6 * off, 1.01e-9 * model.diameter)


@pytest.mark.parametrize("name", ["housing", "complex-hand"])
def test_no_point_of_a_rounded_solid_is_farther_off_than_the_stray(name):
    model = replace(oracles.model(name), name="mine")
    rounded = remade(model, ROTATION.apply(model.vertices).astype(np.float32).astype(float))
    found = worked_out_parts(rounded)
    rng = np.random.default_rng(2)
    on_mesh = oracles.points_on(rounded, rng.integers(len(rounded.triangles), size=300), rng)
    grown = []
    for part in found.parts:
        middle = part.vertices.mean(axis=0)
        reach = np.linalg.norm(part.vertices - middle, axis=1).max()
        grown.append(resized(part, 1.001 * found.stray / reach))
        corners = part.vertices[part.triangles[rng.integers(len(part.triangles), size=100)]]
        on_part = np.einsum("nk,nkd->nd", rng.dirichlet(np.ones(3), 100), corners)
        pulled_in = on_part - 1.001 * found.stray / reach * (on_part - middle)
        assert (winding(rounded, pulled_in) > 0.5).all()
    assert in_parts(tuple(grown), on_mesh).all()


def test_a_part_missing_too_large_or_out_of_place_is_noticed():
    model = oracles.model("housing")
    own = load_parts("housing")
    assert stray(model, own) is not None
    assert stray(model, ()) is None
    for row in range(len(own)):
        others = own[:row] + own[row + 1 :]
        assert stray(model, others) is None
        assert stray(model, (*others, resized(own[row], 1e-3))) is None
        shifted = ConvexPart(
            own[row].vertices + [0.0, 3e-5 * model.diameter, 0.0], own[row].triangles
        )
        assert stray(model, (*others, shifted)) is None


@pytest.mark.parametrize("name", ["l-block", "holed", "pocketed", "bridge"])
def test_a_hull_that_fills_a_notch_or_a_hole_is_noticed(name):
    model = oracles.model(name)
    hull = trimesh.convex.convex_hull(model.vertices)
    part = ConvexPart(np.array(hull.vertices), np.array(hull.faces))
    assert stray(model, (*worked_out_parts(model).parts, part)) is None


def test_a_thin_slit_is_not_bridged():
    """Narrower than any grid of sample points would see."""
    gap = 1e-4
    model = Polyhedron.from_mesh(
        oracles.blocks(
            [[[1], [1]], [[1], [0]], [[1], [1]]], [0, 1, 1 + gap, 2], [0, 0.5, 2], [0, 1]
        ),
        name="slit",
    )
    found = worked_out_parts(model)
    assert not in_parts(found.parts, np.array([[1 + gap / 2, 1.0, 0.5]])).any()
    filled = oracles.box(2, 2, 1)
    part = ConvexPart(np.array(filled.vertices), np.array(filled.faces))
    assert stray(model, (part,)) is None


# --- What is refused ------------------------------------------------------------------------


def test_a_mesh_that_crosses_itself_is_refused_with_what_to_do():
    other = oracles.box(1, 1, 1).apply_translation([0.5, 0.4, 0.3])
    crossed = together(oracles.box(1, 1, 1), other)
    with pytest.raises(ValueError, match=r"two: its convex parts stray.*mend a mesh"):
        worked_out_parts(crossed)


def test_a_decomposition_that_leaves_a_void_is_refused(monkeypatch):
    """Its surface is all there, and only the volume tells."""
    solid = Polyhedron.from_mesh(oracles.box(0.04, 0.04, 0.04), name="solid")
    around_a_void = convex_cuts.convex_cuts(hollow_block())
    assert stray(solid, [hull.part for hull in around_a_void]) is not None
    monkeypatch.setattr(collision, "_convex_whole", lambda model: [])
    monkeypatch.setattr(convex_cuts, "convex_cuts", lambda model: around_a_void)
    with pytest.raises(ValueError, match="stray"):
        worked_out_parts(solid)


def test_too_intricate_a_solid_is_refused(monkeypatch):
    monkeypatch.setattr(convex_cuts, "MOST_CELLS", 10)
    with pytest.raises(ValueError, match=r"more than 10 convex cells.*coarser mesh"):
        worked_out_parts(user_mesh("housing"))


def test_a_mesh_of_a_stand_ins_name_is_taken_for_what_it_is():
    model = replace(oracles.model("l-block"), name="housing")
    found = worked_out_parts(model)
    assert len(found.parts) == 2
    assert_union_is_the_solid(model, found)


def test_the_limit_is_the_one_stated():
    assert MOST_STRAY == 1e-5


# --- Kept on disk ---------------------------------------------------------------------------


def same(one: CollisionParts, other: CollisionParts) -> bool:
    return one.stray == other.stray and all(
        np.array_equal(a.vertices, b.vertices) and np.array_equal(a.triangles, b.triangles)
        for a, b in zip(one.parts, other.parts, strict=True)
    )


@pytest.fixture
def nothing_is_worked_out(monkeypatch):
    """Call to forbid working out from here on."""

    def forbid():
        def complain(solid):
            raise AssertionError(f"{solid.name} was worked out again")

        monkeypatch.setattr(collision, "worked_out_parts", complain)

    return forbid


@pytest.mark.parametrize("name", ["housing", "my housing", "cube"])
def test_parts_are_worked_out_once_and_read_to_the_bit(name, tmp_path, nothing_is_worked_out):
    model = user_mesh("housing") if name == "my housing" else oracles.model(name)
    expected = worked_out_parts(model)
    built = collision_parts(model, folder=tmp_path)
    nothing_is_worked_out()
    assert same(built, expected)
    assert same(collision_parts(model, folder=tmp_path), expected)
    assert len(list(tmp_path.iterdir())) == 1


@pytest.mark.parametrize("damage", [b"", b"not parts", b"cut off"])
def test_a_damaged_file_is_worked_out_anew(damage, tmp_path):
    model = oracles.model("l-block")
    expected = collision_parts(model, folder=tmp_path)
    (path,) = tmp_path.iterdir()
    whole = path.read_bytes()
    path.write_bytes(whole[:-9] if damage == b"cut off" else damage)
    assert same(collision_parts(model, folder=tmp_path), expected)
    assert path.read_bytes()[:16] == whole[:16]


def test_the_file_depends_on_the_shape_and_not_on_the_name():
    model = oracles.model("l-block")
    assert parts_key(replace(model, name="other")) == parts_key(model)
    assert parts_key(remade(model, 1.5 * model.vertices)) != parts_key(model)
    # A stand-in's name says which parts to try first.
    assert parts_key(oracles.model("housing")) != parts_key(user_mesh("housing"))


def test_several_at_work_on_one_folder_do_not_disturb_each_other(tmp_path):
    models = [oracles.model(name) for name in ("l-block", "holed", "bridge")] * 4
    with ThreadPoolExecutor(6) as pool:
        found = list(pool.map(lambda model: collision_parts(model, folder=tmp_path), models))
    assert all(same(one, other) for one, other in zip(found[:3] * 4, found, strict=True))
    assert len(list(tmp_path.iterdir())) == 3


def test_a_folder_that_cannot_be_written_is_said_and_does_no_harm(tmp_path):
    folder = tmp_path / "a file"
    folder.write_text("in the way")
    model = oracles.model("cube")
    with pytest.warns(UserWarning, match="collision parts can't be kept here"):
        found = collision_parts(model, folder=folder)
    assert same(found, worked_out_parts(model))


def test_by_default_parts_are_kept_in_the_users_cache(tmp_path, monkeypatch):
    asked = []
    monkeypatch.setattr(collision, "cache_folder", lambda name: asked.append(name) or tmp_path)
    collision_parts(oracles.model("cube"))
    assert asked == ["parts"]
    assert [path.suffix for path in tmp_path.iterdir()] == [".parts"]


# --- Cutting --------------------------------------------------------------------------------


def test_a_plane_cuts_a_polygon_into_two_that_make_it_up():
    rng = np.random.default_rng(3)
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
    for _ in range(200):
        normal = rng.normal(size=3)
        plane = Plane(normal / np.linalg.norm(normal), rng.uniform(-0.3, 1.0))
        parts = [part for part in split_polygon(square, plane, 1e-9) if part is not None]
        areas = [
            np.linalg.norm(np.cross(part, np.roll(part, -1, axis=0)).sum(axis=0)) / 2
            for part in parts
        ]
        assert sum(areas) == pytest.approx(1.0)
    flat = Plane(np.array([0.0, 0.0, 1.0]), 0.0)
    assert split_polygon(square, flat, 1e-9) == (None, None)


def test_a_plane_cuts_a_cell_into_two_that_make_it_up():
    rng = np.random.default_rng(4)
    for _ in range(50):
        cells = [Cell.box(np.zeros(3), np.array([1.0, 2.0, 3.0]))]
        for _ in range(4):
            normal = rng.normal(size=3)
            normal /= np.linalg.norm(normal)
            plane = Plane(normal, float(normal @ rng.uniform([0, 0, 0], [1, 2, 3])))
            halves = [half for cell in cells for half in cell.split(plane, 1e-9)]
            cells = [half for half in halves if half is not None]
        volumes = [trimesh.convex.convex_hull(cell.corners).volume for cell in cells]
        assert len(cells) > 4
        assert sum(volumes) == pytest.approx(6.0)


def test_a_user_without_a_home_has_no_cache_and_still_gets_parts(monkeypatch):
    monkeypatch.setattr("platformdirs.user_cache_path", lambda *names, **options: Path("~/cache"))
    model = oracles.model("l-block")
    assert file_cache.cache_folder("parts") is None
    assert same(collision_parts(model), worked_out_parts(model))
