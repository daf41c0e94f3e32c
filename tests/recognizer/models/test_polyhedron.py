"""From meshes to planar faces: which faces there are, which symmetries, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from oracles.solids import (
    SOLIDS,
    as_set,
    blocks,
    box,
    bridge,
    holed_block,
    hull_of,
    l_block,
    model,
    pocketed_block,
    points_on,
    prism,
    random_hull,
    random_pose,
    surface_points,
    tetrahedron,
    triangles_of,
)
from scipy.spatial.transform import Rotation

from palpate.assets import STAND_IN_NAMES, mesh_path
from palpate.recognizer import Polyhedron, load_folder
from palpate.recognizer.models.faces import convex_hull_in_plane

FACES = {
    "cube": 6,
    "tetrahedron": 4,
    "l-block": 8,
    "holed": 10,
    "pocketed": 11,
    "bridge": 10,
    "hull-20": 20,
    "hull-90": 90,
} | dict(zip(STAND_IN_NAMES, (40, 34, 34, 28, 64), strict=True))

every_model = pytest.mark.parametrize("name", FACES)


def moved(mesh: trimesh.Trimesh, seed: int, scale: float = 1.0) -> trimesh.Trimesh:
    """A copy, scaled, turned and shifted by up to its size."""
    vertices = random_pose(np.random.default_rng(seed), mesh.scale).apply(mesh.vertices) * scale
    return trimesh.Trimesh(vertices, mesh.faces, process=False)


def cut_up(mesh: trimesh.Trimesh, rng: np.random.Generator) -> trimesh.Trimesh:
    """The same surface: triangles and edges split at random, everything renumbered."""
    vertices, triangles = list(np.asarray(mesh.vertices)), [list(t) for t in mesh.faces.tolist()]
    for _ in range(25):
        a, b, c = triangles.pop(int(rng.integers(len(triangles))))
        vertices.append(rng.dirichlet([2, 2, 2]) @ np.array([vertices[k] for k in (a, b, c)]))
        new = len(vertices) - 1
        triangles += [[a, b, new], [b, c, new], [c, a, new]]
    for _ in range(25):
        a, b, _ = triangles[int(rng.integers(len(triangles)))]
        share = rng.uniform(0.1, 0.9)
        vertices.append((1 - share) * vertices[a] + share * vertices[b])
        new = len(vertices) - 1
        for triangle in [t for t in triangles if a in t and b in t]:
            triangles.remove(triangle)
            triangles += [[new if v == gone else v for v in triangle] for gone in (a, b)]
    number = rng.permutation(len(vertices))
    renumbered = np.empty((len(vertices), 3))
    renumbered[number] = vertices
    shuffled = number[np.array(triangles)[rng.permutation(len(triangles))]]
    rolled = [np.roll(triangle, rng.integers(3)) for triangle in shuffled]
    return trimesh.Trimesh(renumbered, rolled, process=False)


def signature(solid: Polyhedron) -> np.ndarray:
    """(f, 8) normal, offset, area and middle of each face, lengths as shares of the size."""
    size = solid.diameter
    middles = []
    for face in range(solid.face_count):
        corners = triangles_of(solid, face)
        sides = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        areas = np.linalg.norm(sides, axis=1)
        middles.append(areas @ corners.mean(axis=1) / areas.sum() / size)
    return np.column_stack([solid.normals, solid.offsets / size, solid.areas / size**2, middles])


def hull_areas(solid: Polyhedron) -> np.ndarray:
    starts = zip(solid.hulls.start[:-1], solid.hulls.start[1:], solid.normals, strict=True)
    hulls = [(solid.hulls.corners[first:stop], normal) for first, stop, normal in starts]
    return np.array([np.cross(h, np.roll(h, -1, axis=0)).sum(axis=0) @ n / 2 for h, n in hulls])


def assert_same_faces(one: Polyhedron, other: Polyhedron, tolerance: float) -> None:
    first, second = signature(one), signature(other)
    assert len(first) == len(second)
    apart = np.abs(first[:, None] - second).max(axis=2)
    assert apart.min(axis=1).max() < tolerance
    assert len(set(apart.argmin(axis=1))) == len(first)


def on_surface(triangles: np.ndarray, points: np.ndarray, slack: float) -> np.ndarray:
    """Whether points lie on any of some triangles, up to a slack in metres."""
    held = np.zeros(len(points), bool)
    for a, b, c in triangles:
        sides = np.column_stack([b - a, c - a])
        weights = np.linalg.pinv(sides) @ (points - a).T
        heights = np.linalg.norm((points - a).T - sides @ weights, axis=0)
        share = slack / min(np.linalg.norm(b - a), np.linalg.norm(c - a), np.linalg.norm(c - b))
        inside = (weights >= -share).all(axis=0) & (weights.sum(axis=0) <= 1 + share)
        held |= inside & (heights <= slack)
    return held


@every_model
def test_a_mesh_has_the_faces_that_its_solid_has(name):
    solid = model(name)
    assert solid.face_count == FACES[name]
    assert solid.hulls.first.tolist() == list(range(FACES[name] + 1))


@every_model
def test_faces_are_planar_outward_and_close_the_solid(name):
    solid = model(name)
    np.testing.assert_allclose(np.linalg.norm(solid.normals, axis=1), 1.0, rtol=1e-14)
    for face in range(solid.face_count):
        heights = triangles_of(solid, face) @ solid.normals[face] - solid.offsets[face]
        assert np.abs(heights).max() < 1e-11 * solid.diameter
    assert np.abs(solid.areas @ solid.normals).max() < 1e-10 * solid.areas.sum()
    # The divergence theorem: a third of the offsets weighted by area is the volume.
    mesh = trimesh.Trimesh(solid.vertices, solid.triangles, process=False)
    assert solid.areas @ solid.offsets / 3.0 == pytest.approx(mesh.volume, rel=1e-9)
    assert solid.areas.sum() == pytest.approx(mesh.area, rel=1e-9)
    np.testing.assert_allclose(solid.centroid, mesh.center_mass, atol=1e-9 * solid.diameter)


@every_model
def test_convex_pieces_tile_each_face(name):
    solid, rng = model(name), np.random.default_rng(3)
    pieces = solid.pieces
    for face in range(solid.face_count):
        normal, area = solid.normals[face], 0.0
        for piece in range(pieces.first[face], pieces.first[face + 1]):
            corners = pieces.corners[pieces.start[piece] : pieces.start[piece + 1]]
            edges = np.roll(corners, -1, axis=0) - corners
            turns = np.cross(edges, np.roll(edges, -1, axis=0)) @ normal
            assert (turns > -1e-9 * solid.diameter**2).all()
            area += np.cross(corners, np.roll(corners, -1, axis=0)).sum(axis=0) @ normal / 2.0
            inside = rng.dirichlet(np.ones(len(corners)), 20) @ corners
            slack = 1e-9 * solid.diameter
            assert on_surface(triangles_of(solid, face), inside, slack).all()
        # All of them inside the face and together as large as it: they don't overlap.
        assert area == pytest.approx(solid.areas[face], rel=1e-8)


@every_model
def test_hulls_hold_their_faces(name):
    solid, rng = model(name), np.random.default_rng(4)
    for face in range(solid.face_count):
        first, stop = solid.hulls.start[face : face + 2]
        hull = solid.hulls.corners[first:stop]
        members = np.flatnonzero(solid.triangle_faces == face)
        points = points_on(solid, rng.choice(members, 50), rng)
        edges = np.roll(hull, -1, axis=0) - hull
        inward = np.cross(solid.normals[face], edges)
        assert ((points @ inward.T) >= (hull * inward).sum(axis=1) - 1e-9).all()


def test_no_rounding_makes_a_hull_lose_a_corner():
    # Edges across the order in which a sweep takes the points, with more points on them.
    rng = np.random.default_rng(0)
    for _ in range(500):
        turn = Rotation.from_euler("x", rng.uniform(0, 2 * np.pi)).as_matrix()
        corners = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]] @ turn.T + rng.normal(size=3)
        start, share = rng.integers(4, size=6), rng.random((6, 1))
        between = (1 - share) * corners[start] + share * corners[(start + 1) % 4]
        points = rng.permutation(np.concatenate([corners, between]))
        hull = convex_hull_in_plane(points, turn[:, 2])
        assert as_set(hull) == as_set(corners)


def test_faces_of_a_cube_are_its_six_squares():
    cube = model("cube")
    order = np.lexsort(cube.normals.T)
    np.testing.assert_array_equal(np.abs(cube.normals[order]).sum(axis=1), np.ones(6))
    assert sorted(cube.offsets.tolist()) == [0, 0, 0, 1, 1, 1]
    np.testing.assert_allclose(cube.areas, 1.0, rtol=1e-15)
    assert cube.diameter == pytest.approx(np.sqrt(3.0))
    assert len(cube.edges) == 12
    assert set(np.diff(cube.hulls.start).tolist()) == {4}


def test_a_face_with_a_hole_is_one_face_in_several_convex_pieces():
    holed = model("holed")
    large = np.flatnonzero(np.isclose(holed.areas, 4 * 3 - 1.2 * 0.5))
    assert len(large) == 2
    assert (np.diff(holed.pieces.first)[large] >= 4).all()
    lengths = np.linalg.norm(np.diff(holed.edges, axis=1), axis=2)
    assert lengths.sum() == pytest.approx(2 * (2 * (4 + 3) + 2 * (1.2 + 0.5)) + 8 * 1)


def test_single_triangles_are_faces():
    solid = model("hull-20")
    assert solid.face_count == len(solid.triangles) == 20


def test_coplanar_faces_that_do_not_touch_stay_apart():
    solid = model("bridge")
    soles = np.flatnonzero((solid.normals[:, 2] < -0.5) & (solid.offsets == 0.0))
    assert len(soles) == 2
    np.testing.assert_allclose(np.sort(solid.areas[soles]), [1.0, 1.5])


@pytest.mark.parametrize("seed", range(3))
@every_model
def test_faces_do_not_depend_on_how_the_surface_is_triangulated(name, seed):
    solid = model(name)
    mesh = trimesh.Trimesh(solid.vertices, solid.triangles, process=False)
    other = Polyhedron.from_mesh(cut_up(mesh, np.random.default_rng(seed)))
    assert len(other.triangles) > len(solid.triangles)
    assert_same_faces(solid, other, 1e-9)
    assert len(other.symmetries) == len(solid.symmetries)
    np.testing.assert_allclose(
        np.sort(hull_areas(other)), np.sort(hull_areas(solid)), rtol=1e-9, atol=0
    )
    assert len(other.hulls.corners) == len(solid.hulls.corners)


@pytest.mark.parametrize("ending", ["stl", "obj", "ply", "off"])
@every_model
def test_faces_survive_the_rounding_of_a_file(name, ending, tmp_path):
    solid = model(name)
    mesh = trimesh.Trimesh(solid.vertices, solid.triangles, process=False)
    mesh.export(tmp_path / f"thing.{ending}")
    read = Polyhedron.from_mesh(tmp_path / f"thing.{ending}")
    assert read.name == "thing"
    assert_same_faces(solid, read, 2e-5)
    assert len(read.symmetries) == len(solid.symmetries)


@pytest.mark.parametrize("scale", [1e-3, 1e3])
@every_model
def test_faces_and_symmetries_do_not_depend_on_the_scale(name, scale):
    solid = model(name)
    other = Polyhedron.from_mesh(
        trimesh.Trimesh(solid.vertices * scale, solid.triangles, process=False)
    )
    assert_same_faces(solid, other, 1e-9)
    assert len(other.symmetries) == len(solid.symmetries)


GROUPS = {
    "cube": (lambda: box(1, 1, 1), 24),
    "box": (lambda: box(1, 2, 3), 4),
    "square prism": (lambda: box(1, 1, 3), 8),
    "tetrahedron": (tetrahedron, 12),
    "octahedron": (lambda: hull_of(np.concatenate([np.eye(3), -np.eye(3)])), 24),
    "hexagonal prism": (lambda: prism(6, 1.3), 12),
    "triangular prism": (lambda: prism(3, 0.8), 6),
    "heptagonal prism": (lambda: prism(7, 2.0), 14),
    "square pyramid": (
        lambda: hull_of([[1, 1, 0], [1, -1, 0], [-1, 1, 0], [-1, -1, 0], [0, 0, 1.7]]),
        4,
    ),
    "lens": (
        lambda: hull_of(
            [[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0], [0, 0, 0.05], [0, 0, -0.05]]
        ),
        8,
    ),
    "needle": (lambda: box(1, 1, 100), 8),
    "tile": (lambda: box(1, 2, 0.01), 4),
    "l-block": (l_block, 1),
    "equal-armed l-block": (
        lambda: blocks([[[1], [1]], [[1], [0]]], [0, 1, 3], [0, 1, 3], [0, 1]),
        2,
    ),
    "holed": (holed_block, 1),
    "bridge": (bridge, 1),
    "pocketed": (pocketed_block, 1),
    "hull": (lambda: random_hull(14, 5), 1),
    "simple-hand": (lambda: trimesh.load_mesh(mesh_path("simple-hand"), process=False), 2),
} | {
    name: (lambda name=name: trimesh.load_mesh(mesh_path(name), process=False), 1)
    for name in STAND_IN_NAMES
    if name != "simple-hand"
}


@pytest.mark.parametrize("scale", [1.0, 1e-3, 1e3])
@pytest.mark.parametrize("name", GROUPS)
def test_symmetries_are_the_groups_of_geometry_books(name, scale):
    build, order = GROUPS[name]
    solid = Polyhedron.from_mesh(moved(build(), seed=int(scale), scale=scale))
    group = solid.symmetries
    assert len(group) == order
    np.testing.assert_array_equal(group[0], np.eye(3))
    np.testing.assert_allclose(np.linalg.det(group), 1.0, atol=1e-6)
    products = np.einsum("aij,bjk->abik", group, group)
    missed = np.abs(products[:, :, None] - group).max(axis=(3, 4)).min(axis=2)
    assert missed.max() < 1e-4


@pytest.mark.parametrize("name", [name for name, (_, order) in GROUPS.items() if order > 1])
def test_every_symmetry_maps_the_surface_onto_itself(name):
    solid, rng = Polyhedron.from_mesh(moved(GROUPS[name][0](), seed=2)), np.random.default_rng(6)
    points, _ = surface_points(solid, 60, rng, awkward=True)
    assert len(solid.symmetries) == GROUPS[name][1]
    for rotation in solid.symmetries:
        turned = (points - solid.centroid) @ rotation.T + solid.centroid
        corners = solid.vertices[solid.triangles]
        assert on_surface(corners, turned, 1e-7 * solid.diameter).all()


def test_a_solid_a_little_short_of_symmetric_has_no_symmetry():
    assert len(Polyhedron.from_mesh(box(1, 1.002, 3)).symmetries) == 4
    assert len(Polyhedron.from_mesh(box(1, 1.0000001, 3)).symmetries) == 8


# --- What is refused, and what is mended ------------------------------------------------------


def test_an_inverted_winding_is_mended_with_a_warning():
    mesh = l_block()
    mesh.invert()
    with pytest.warns(UserWarning, match="dented: its winding was inverted") as caught:
        solid = Polyhedron.from_mesh(mesh, name="dented")
    assert caught[0].filename == __file__
    assert_same_faces(solid, model("l-block"), 1e-12)


@pytest.mark.parametrize("name", ["cube", "holed", "hull-90", "housing"])
def test_an_inconsistent_winding_is_mended_with_a_warning(name):
    solid = model(name)
    triangles = solid.triangles.copy()
    flipped = np.random.default_rng(1).random(len(triangles)) < 0.3
    triangles[flipped] = triangles[flipped, ::-1]
    with pytest.warns(UserWarning, match="winding was inconsistent"):
        mended = Polyhedron.from_mesh(trimesh.Trimesh(solid.vertices, triangles, process=False))
    assert_same_faces(mended, solid, 1e-12)


def test_a_surface_with_one_side_only_is_refused():
    # Boy's surface would do too; here the projective plane as six corners and ten triangles.
    triangles = ["012", "023", "034", "045", "051", "124", "235", "341", "452", "513"]
    corners = np.random.default_rng(0).normal(size=(6, 3))
    mesh = trimesh.Trimesh(corners, [[int(k) for k in t] for t in triangles], process=False)
    with pytest.raises(ValueError, match="one side only"):
        Polyhedron.from_mesh(mesh)


def test_an_open_mesh_is_refused_by_name(tmp_path):
    mesh = holed_block()
    mesh.update_faces(np.arange(len(mesh.faces)) != 5)
    mesh.export(tmp_path / "leaky.stl")
    with pytest.raises(
        ValueError, match=r"leaky\.stl: the mesh isn't closed: 3 edges belong to one"
    ):
        Polyhedron.from_mesh(tmp_path / "leaky.stl")


def test_solids_that_share_an_edge_are_refused():
    cells = [[[1], [0]], [[0], [1]]]
    with pytest.raises(ValueError, match=r"isn't closed: 0 edges .* 1 to more than two"):
        Polyhedron.from_mesh(blocks(cells, [0, 1, 2], [0, 1, 2], [0, 1]))


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(ValueError, match=r"nowhere\.stl: no such mesh file"):
        Polyhedron.from_mesh(tmp_path / "nowhere.stl")


@pytest.mark.parametrize("ending", ["stl", "obj", "ply", "off", "xyz", "txt"])
@pytest.mark.parametrize("content", [b"", b"these are no triangles\n", bytes(range(256)) * 4])
def test_an_unreadable_file_is_named(tmp_path, ending, content):
    path = tmp_path / f"garbage.{ending}"
    path.write_bytes(content)
    with pytest.raises(ValueError, match="garbage"):
        Polyhedron.from_mesh(path)


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_vertex_that_is_not_finite_is_refused(value):
    mesh = box(1, 1, 1)
    vertices = np.array(mesh.vertices)
    vertices[3, 1] = value
    with pytest.raises(ValueError, match=r"vertex \d+ is \[.*(nan|inf).*\]; it must be finite"):
        Polyhedron.from_mesh(trimesh.Trimesh(vertices, mesh.faces, process=False))


def test_a_flat_mesh_is_refused():
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
    sheet = trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3], [2, 1, 3], [3, 1, 0]], process=False)
    with pytest.raises(ValueError, match="encloses no volume"):
        Polyhedron.from_mesh(sheet)


def test_a_curved_surface_is_refused_for_its_many_faces():
    with pytest.raises(ValueError, match="1280 planar faces, and 1000 is the most"):
        Polyhedron.from_mesh(trimesh.creation.icosphere(subdivisions=3))


def test_what_is_no_mesh_is_refused():
    with pytest.raises(ValueError, match=r"trimesh\.Trimesh or a path, not int"):
        Polyhedron.from_mesh(3)  # type: ignore[arg-type]
    empty = trimesh.Trimesh(np.zeros((0, 3)), np.zeros((0, 3), int))
    with pytest.raises(ValueError, match="0 triangles can't enclose a volume"):
        Polyhedron.from_mesh(empty)


def test_the_mesh_that_was_given_is_left_as_it_was():
    mesh = box(1, 2, 3)
    mesh.invert()
    before = np.array(mesh.vertices), np.array(mesh.faces)
    with pytest.warns(UserWarning, match="inverted"):
        Polyhedron.from_mesh(mesh)
    np.testing.assert_array_equal(mesh.vertices, before[0])
    np.testing.assert_array_equal(mesh.faces, before[1])


def test_a_folder_is_read_in_alphabetical_order(tmp_path):
    for name in ("b.STL", "a.obj", "c.ply"):
        box(1, 2, 3).export(tmp_path / name, file_type=name[-3:].lower())
    (tmp_path / "notes.txt").write_text("not a mesh")
    assert [solid.name for solid in load_folder(tmp_path)] == ["a", "b", "c"]


def test_a_folder_without_meshes_is_refused(tmp_path):
    with pytest.raises(ValueError, match="no mesh in this folder"):
        load_folder(tmp_path)
    with pytest.raises(ValueError, match="missing: no such folder"):
        load_folder(tmp_path / "missing")


def test_two_meshes_of_one_name_are_refused(tmp_path):
    for name in ("a.obj", "a.stl"):
        box(1, 2, 3).export(tmp_path / name)
    with pytest.raises(ValueError, match="another mesh in its folder is called 'a' too"):
        load_folder(tmp_path)


def test_a_bad_mesh_in_a_folder_is_named(tmp_path):
    box(1, 2, 3).export(tmp_path / "good.stl")
    (tmp_path / "rotten.stl").write_text("solid nothing\nendsolid\n")
    with pytest.raises(ValueError, match="rotten"):
        load_folder(tmp_path)


def test_every_solid_of_the_tests_is_what_its_samplers_take_it_for():
    for name in SOLIDS:
        points, faces = surface_points(model(name), 50, np.random.default_rng(0), awkward=True)
        heights = (points * model(name).normals[faces]).sum(axis=1) - model(name).offsets[faces]
        assert np.abs(heights).max() < 1e-12


@pytest.mark.parametrize("name", [*SOLIDS, *STAND_IN_NAMES])
def test_balls_hold_their_faces_and_are_no_larger_than_need_be(name: str):
    pieces = model(name).pieces
    assert pieces.balls.shape == (model(name).face_count, 4)
    for face, (*centre, radius) in enumerate(pieces.balls):
        ends = pieces.start[[pieces.first[face], pieces.first[face + 1]]]
        corners = pieces.corners[slice(*ends)]
        assert np.linalg.norm(corners - centre, axis=1).max() == pytest.approx(radius)
        span = np.linalg.norm(corners[:, None] - corners, axis=2).max()
        assert 0.5 * span <= radius * (1.0 + 1e-9) <= np.sqrt(0.75) * span * (1.0 + 1e-6)
