"""The object library: what each stand-in must be, measured on the shipped files."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh
from helpers.processes import loaded_by
from oracles.geometry import windings

from palpate.assets import STAND_IN_NAMES, load_parts, mesh_path, parts_path
from palpate.assets.stand_ins import METRES_PER_INCH, STAND_INS, StandIn, parts_m

FACES = dict(zip(STAND_IN_NAMES, (40, 34, 34, 28, 64), strict=True))
DIAMETERS_IN = dict(zip(STAND_IN_NAMES, (4.0, 4.0, 7.0, 8.0, 8.0), strict=True))
FLAT = 1e-4  # radians between coplanar neighbours

every_object = pytest.mark.parametrize("name", STAND_IN_NAMES)


def load(name: str) -> trimesh.Trimesh:
    mesh = trimesh.load(mesh_path(name), process=False)
    assert isinstance(mesh, trimesh.Trimesh)
    return mesh


def planar_faces(mesh: trimesh.Trimesh) -> list[np.ndarray]:
    coplanar = mesh.face_adjacency[mesh.face_adjacency_angles < FLAT]
    nodes = np.arange(len(mesh.faces))
    groups = trimesh.graph.connected_components(coplanar, nodes=nodes, min_len=1)
    return [np.asarray(group) for group in groups]


def inside_convex(vertices: np.ndarray, triangles: np.ndarray, points: np.ndarray) -> np.ndarray:
    normals, offsets = halfspaces(vertices, triangles)
    return np.all(points @ normals.T < offsets, axis=1)


def halfspaces(vertices: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    a, b, c = vertices[triangles].transpose(1, 0, 2)
    normals = np.cross(b - a, c - a)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return normals, (normals * a).sum(axis=1)


def frame(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Orthonormal right-handed columns that follow two vectors."""
    first = u / np.linalg.norm(u)
    third = np.cross(u, v) / np.linalg.norm(np.cross(u, v))
    return np.column_stack([first, np.cross(third, first), third])


def rotations_onto_itself(mesh: trimesh.Trimesh) -> list[np.ndarray]:
    """All rotations about the centre of mass that map the set of corners onto itself."""
    corners = mesh.vertices - mesh.center_mass
    tolerance = 1e-6 * mesh.scale
    radii = np.linalg.norm(corners, axis=1)
    first = int(radii.argmax())
    second = int(np.linalg.norm(np.cross(corners[first], corners), axis=1).argmax())
    apart = np.linalg.norm(corners[first] - corners[second])
    start = frame(corners[first], corners[second])
    found = []
    for i in np.flatnonzero(np.abs(radii - radii[first]) < tolerance):
        for j in np.flatnonzero(np.abs(radii - radii[second]) < tolerance):
            if abs(np.linalg.norm(corners[i] - corners[j]) - apart) > tolerance:
                continue
            rotation = frame(corners[i], corners[j]) @ start.T
            moved = corners @ rotation.T
            distances = np.linalg.norm(moved[:, None] - corners[None], axis=-1)
            if distances.min(axis=1).max() < tolerance:
                found.append(rotation)
    return found


def test_the_names_are_those_of_the_table_in_its_order() -> None:
    expected = ("housing", "housing-34", "stapler", "simple-hand", "complex-hand")
    assert expected == STAND_IN_NAMES
    assert tuple(stand_in.name for stand_in in STAND_INS) == expected


@every_object
def test_the_planar_faces_are_as_many_as_in_the_memo(name: str) -> None:
    assert len(planar_faces(load(name))) == FACES[name]


@pytest.mark.parametrize("stand_in", STAND_INS, ids=lambda s: s.name)
def test_the_table_states_the_faces_and_diameter_of_the_memo(stand_in: StandIn) -> None:
    assert stand_in.faces == FACES[stand_in.name]
    assert stand_in.diameter_in == DIAMETERS_IN[stand_in.name]


@every_object
def test_the_diameter_is_the_memos_in_metres(name: str) -> None:
    corners = load(name).vertices
    diameter = np.linalg.norm(corners[:, None] - corners[None], axis=-1).max()
    assert diameter == pytest.approx(DIAMETERS_IN[name] * METRES_PER_INCH, rel=1e-6)


@every_object
def test_the_mesh_is_one_closed_surface_wound_outwards(name: str) -> None:
    mesh = load(name)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.volume > 0
    assert mesh.body_count == 1
    # Genus 0 also rules out vertices at which two sheets of the surface touch.
    assert mesh.euler_number == 2


@every_object
def test_every_vertex_is_a_corner_of_at_least_three_faces(name: str) -> None:
    mesh = load(name)
    assert len(np.unique(mesh.vertices, axis=0)) == len(mesh.vertices)
    meeting: list[set[int]] = [set() for _ in mesh.vertices]
    for label, members in enumerate(planar_faces(mesh)):
        for vertex in np.unique(mesh.faces[members]):
            meeting[vertex].add(label)
    assert min(len(faces) for faces in meeting) >= 3


@every_object
def test_each_face_is_flat_to_a_hundred_millionth_of_the_diameter(name: str) -> None:
    mesh = load(name)
    for members in planar_faces(mesh):
        points = mesh.vertices[np.unique(mesh.faces[members])]
        normal = mesh.face_normals[members[mesh.area_faces[members].argmax()]]
        heights = points @ normal
        assert np.ptp(heights) < 1e-8 * mesh.scale


@every_object
def test_no_feature_is_smaller_than_the_noise_of_a_probe(name: str) -> None:
    mesh = load(name)
    bent = mesh.face_adjacency_angles > FLAT
    assert np.rad2deg(mesh.face_adjacency_angles[bent].min()) > 15
    ends = mesh.vertices[mesh.face_adjacency_edges[bent]]
    assert np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).min() > 0.15 * METRES_PER_INCH


@every_object
def test_no_triangle_is_a_sliver(name: str) -> None:
    mesh = load(name)
    sides = np.linalg.norm(mesh.triangles - np.roll(mesh.triangles, 1, axis=1), axis=-1)
    heights = 2 * mesh.area_faces / sides.max(axis=1)
    # The complex hand's ledges, 0.07 in wide and 5 in long, force thinner triangles.
    limit_in = 0.005 if name == "complex-hand" else 0.05
    assert heights.min() > limit_in * METRES_PER_INCH


@every_object
def test_the_parts_are_closed_and_convex(name: str) -> None:
    parts = load_parts(name)
    assert parts
    for part in parts:
        mesh = trimesh.Trimesh(part.vertices, part.triangles, process=False)
        assert mesh.is_watertight
        assert mesh.volume > 0
        normals, offsets = halfspaces(part.vertices, part.triangles)
        assert (part.vertices @ normals.T - offsets).max() < 1e-9


@every_object
def test_the_shipped_parts_are_those_of_the_code(name: str) -> None:
    shipped, written = load_parts(name), parts_m(STAND_INS[STAND_IN_NAMES.index(name)])
    assert shipped
    for part, points in zip(shipped, written, strict=True):
        in_order = points[np.lexsort(points.T[::-1])]
        np.testing.assert_array_equal(part.vertices, in_order)


@every_object
def test_a_point_is_in_the_mesh_exactly_if_it_is_in_a_part(name: str) -> None:
    mesh, parts = load(name), load_parts(name)
    rng = np.random.default_rng(738)
    anywhere = rng.uniform(*mesh.bounds, size=(2000, 3))
    # Points close to the surface, on both sides, find a face that is slightly misplaced.
    which = rng.integers(len(mesh.faces), size=2000)
    weights = rng.dirichlet(np.ones(3), size=2000)
    on_surface = np.einsum("pi,pij->pj", weights, mesh.triangles[which])
    above = on_surface + 1e-6 * mesh.face_normals[which]
    below = on_surface - 1e-6 * mesh.face_normals[which]
    for points in (anywhere, above, below):
        winding = windings(mesh.triangles, points)
        np.testing.assert_allclose(winding, np.round(winding), atol=1e-6)
        in_parts = [inside_convex(part.vertices, part.triangles, points) for part in parts]
        np.testing.assert_array_equal(np.round(winding) == 1, np.any(in_parts, axis=0))


@every_object
def test_the_volume_of_the_union_is_that_of_the_mesh(name: str) -> None:
    manifold3d = pytest.importorskip("manifold3d")
    solids = [
        manifold3d.Manifold(manifold3d.Mesh64(part.vertices, part.triangles.astype(np.uint64)))
        for part in load_parts(name)
    ]
    union = manifold3d.Manifold.batch_boolean(solids, manifold3d.OpType.Add)
    assert load(name).volume == pytest.approx(union.volume(), rel=1e-9)


def test_the_simple_hand_is_mapped_onto_itself_by_pi_about_its_long_axis_alone() -> None:
    mesh = load("simple-hand")
    rotations = rotations_onto_itself(mesh)
    assert len(rotations) == 2
    turn = next(rotation for rotation in rotations if np.trace(rotation) < 0)
    np.testing.assert_allclose(turn, np.diag([-1.0, -1.0, 1.0]), atol=1e-9)
    assert mesh.extents.argmax() == 2
    points = np.random.default_rng(738).uniform(*mesh.bounds, size=(2000, 3))
    inside = windings(mesh.triangles, points) > 0.5
    np.testing.assert_array_equal(inside, windings(mesh.triangles, points * [-1, -1, 1]) > 0.5)


@pytest.mark.parametrize("name", [n for n in STAND_IN_NAMES if n != "simple-hand"])
def test_no_other_object_has_a_rotational_symmetry(name: str) -> None:
    (identity,) = rotations_onto_itself(load(name))
    np.testing.assert_allclose(identity, np.eye(3), atol=1e-9)


def test_the_search_for_symmetries_finds_the_24_rotations_of_a_cube() -> None:
    assert len(rotations_onto_itself(trimesh.creation.box())) == 24


@pytest.mark.parametrize(
    ("name", "mirrored"),
    [("housing", False), ("housing-34", True), ("stapler", True), ("complex-hand", True)],
)
def test_the_plane_y_0_is_a_mirror_plane_except_of_the_housing(name: str, mirrored: bool) -> None:
    corners = load(name).vertices
    distances = np.linalg.norm(corners[:, None] * [1, -1, 1] - corners[None], axis=-1)
    assert (distances.min(axis=1).max() < 1e-9) == mirrored


def test_the_stapler_is_more_than_four_times_as_long_as_it_is_wide() -> None:
    length, width, _ = load("stapler").extents
    assert length > 4 * width


def test_the_staplers_arm_and_base_face_each_other_across_an_open_gap() -> None:
    mesh = load("stapler")
    low, high = mesh.bounds[:, 2]
    column = np.column_stack([np.full((200, 2), [0.02, 0.0]), np.linspace(low, high, 200)])
    inside = np.round(windings(mesh.triangles, column)) == 1
    assert np.count_nonzero(np.diff(inside, prepend=False) & inside) == 2  # material begins twice


@pytest.mark.parametrize(
    ("name", "axis", "levels"),
    [("stapler", [0.0, 1.0, 0.0], 6), ("complex-hand", [1.0, 0.0, 0.0], 5)],
)
def test_parallel_faces_lie_close_together_where_the_counts_were_calibrated(
    name: str, axis: list[float], levels: int
) -> None:
    mesh = load(name)
    facing = mesh.face_normals @ axis > 1 - 1e-9
    heights = np.unique(np.round(mesh.triangles_center[facing] @ axis / METRES_PER_INCH, 6))
    assert len(heights) == levels
    assert np.diff(heights).max() < 0.1


def test_the_housing_but_for_its_lip_is_mapped_onto_itself_by_pi_about_the_vertical() -> None:
    corners = load("housing").vertices
    base = corners[corners[:, 2] < corners[:, 2].min() + 1e-9]
    corners = corners - [*base.mean(axis=0)[:2], 0.0]
    turned = corners * [-1, -1, 1]
    distances = np.linalg.norm(turned[:, None] - corners[None], axis=-1).min(axis=1)
    assert np.count_nonzero(distances > 1e-9) == 12  # six corners at either end of the lip


def test_the_housings_flanges_differ_by_more_than_the_least_noise_and_less_than_the_most() -> None:
    mesh = load("housing")
    low, high = (
        np.ptp(mesh.vertices[np.abs(mesh.vertices[:, 2] - level) < 1e-9], axis=0)[:2]
        for level in np.unique(np.round(mesh.vertices[:, 2], 9))[[0, -2]]
    )
    assert np.all((low - high) / 2 > 0.02 * METRES_PER_INCH)
    assert np.all((low - high) / 2 < 0.1 * METRES_PER_INCH)


@every_object
def test_the_origin_is_the_centre_of_the_bounding_box(name: str) -> None:
    np.testing.assert_allclose(load(name).bounds.mean(axis=0), 0.0, atol=1e-9)


def test_rebuilding_gives_the_shipped_bytes(tmp_path: Path) -> None:
    pytest.importorskip("manifold3d")
    from palpate.assets.build import rebuild

    written = rebuild(tmp_path)
    shipped = [file(name) for name in STAND_IN_NAMES for file in (mesh_path, parts_path)]
    assert [path.name for path in written] == [path.name for path in shipped]
    assert sorted(tmp_path.iterdir()) == sorted(written)
    for fresh, old in zip(written, shipped, strict=True):
        assert fresh.read_bytes() == old.read_bytes(), fresh.name


def test_the_triangulation_does_not_depend_on_the_one_it_comes_from() -> None:
    pytest.importorskip("manifold3d")
    from palpate.assets.obj_file import TriangleMesh, format_obj
    from palpate.assets.retriangulate import retriangulate

    mesh = load("complex-hand")
    finer = mesh.subdivide()
    faces = np.random.default_rng(738).permutation(finer.faces)
    fresh = retriangulate(TriangleMesh("complex-hand", finer.vertices, faces))
    shipped = mesh_path("complex-hand").read_text()
    assert format_obj([fresh], shipped.splitlines()[0].removeprefix("# ")) == shipped


@pytest.mark.parametrize("function", [mesh_path, parts_path, load_parts])
def test_an_unknown_name_is_refused_with_the_valid_ones(
    function: Callable[[str], object],
) -> None:
    with pytest.raises(ValueError, match="'wrench'") as caught:
        function("wrench")
    for name in STAND_IN_NAMES:
        assert name in str(caught.value)


def test_listing_the_library_imports_neither_numpy_nor_manifold3d() -> None:
    statement = "from palpate.assets import STAND_IN_NAMES, mesh_path; mesh_path(STAND_IN_NAMES[0])"
    assert not {"numpy", "manifold3d"} & loaded_by(statement)
