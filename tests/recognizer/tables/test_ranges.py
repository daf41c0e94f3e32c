"""Range tables hold every pair of points, and are as tight as they say."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import trimesh
from oracles.geometry import angle_between
from oracles.solids import (
    SOLIDS,
    box,
    convex_distance,
    face_distance,
    model,
    points_on,
    random_pose,
    tables,
    tetrahedron,
    triangles_of,
)

from palpate.assets import STAND_IN_NAMES
from palpate.recognizer import PairTables, Polyhedron
from palpate.recognizer.tables.range_kernels import triangle_distance_squared

every_model = pytest.mark.parametrize("name", [*SOLIDS, *STAND_IN_NAMES])

SLACK = 3e-9
"""Widening that the tables promise, and a little: a share of the diameter, or radians."""


def point_pairs(solid: Polyhedron, a: int, b: int, count: int, rng: np.random.Generator):
    """Points of two faces: anywhere, on edges, at corners, and near where the faces meet."""
    points = []
    for face in (a, b):
        members = rng.choice(np.flatnonzero(solid.triangle_faces == face), count)
        inside = points_on(solid, members, rng)
        weights = rng.dirichlet(np.ones(3), count)
        weights[np.arange(count), rng.integers(3, size=count)] = 0.0
        weights = np.where(rng.random((count, 1)) < 0.3, np.round(weights), weights)
        weights[weights.sum(axis=1) == 0.0] = [1.0, 0.0, 0.0]
        weights /= weights.sum(axis=1, keepdims=True)
        rim = np.einsum("nk,nkd->nd", weights, solid.vertices[solid.triangles[members]])
        points.append(np.where(rng.random((count, 1)) < 0.5, inside, rim))
    return points


@every_model
def test_no_two_points_of_two_faces_lie_outside_the_ranges(name):
    solid, ranges = model(name), tables(name)
    rng = np.random.default_rng(0)
    count = max(24, 5000 // solid.face_count**2)
    seen = 0
    for a, b in itertools.product(range(solid.face_count), repeat=2):
        p, q = point_pairs(solid, a, b, count, rng)
        d = q - p
        lengths = np.linalg.norm(d, axis=1)
        assert (lengths >= ranges.distance_min[a, b]).all()
        assert (lengths <= ranges.distance_max[a, b]).all()
        heights = d @ solid.normals[a]
        assert (heights >= ranges.component_min[a, b]).all()
        assert (heights <= ranges.component_max[a, b]).all()
        apart = lengths > 1e-6 * solid.diameter
        sideways = np.linalg.norm(d - heights[:, None] * solid.normals[a], axis=1)
        tilts = np.arctan2(sideways, heights)[apart]
        assert (tilts >= ranges.tilt_min[a, b]).all(), (a, b)
        assert (tilts <= ranges.tilt_max[a, b]).all(), (a, b)
        seen += int(apart.sum())
    assert seen > 3000


@every_model
def test_least_distances_are_exact(name):
    solid, ranges = model(name), tables(name)
    rng = np.random.default_rng(1)
    pairs = list(itertools.combinations(range(solid.face_count), 2))
    chosen = rng.permutation(len(pairs))[:40]
    apart = 0
    for a, b in (pairs[k] for k in chosen):
        attained, undercut = face_distance(solid, a, b)
        assert attained - undercut < 1e-9 * solid.diameter, "the oracle's own certificate"
        for found in (ranges.distance_min[a, b], ranges.distance_min[b, a]):
            assert attained - SLACK * solid.diameter < found <= attained
        apart += attained > 0.01 * solid.diameter
    # A tetrahedron's faces all touch; of the others many don't.
    assert apart > 5 or solid.face_count < 12


@every_model
def test_greatest_distances_and_components_are_exact(name):
    solid, ranges = model(name), tables(name)
    corners = [triangles_of(solid, face).reshape(-1, 3) for face in range(solid.face_count)]
    slack = SLACK * solid.diameter
    for a, b in itertools.product(range(solid.face_count), repeat=2):
        # A distance is convex in both points and a component linear: corners are extreme.
        between = corners[b][None] - corners[a][:, None]
        farthest = np.linalg.norm(between, axis=2).max()
        assert farthest <= ranges.distance_max[a, b] < farthest + slack
        heights = between @ solid.normals[a]
        assert heights.min() - slack < ranges.component_min[a, b] <= heights.min()
        assert heights.max() <= ranges.component_max[a, b] < heights.max() + slack


@every_model
def test_angles_are_those_of_the_normals(name):
    solid, ranges = model(name), tables(name)
    for a, b in itertools.product(range(solid.face_count), repeat=2):
        expected = angle_between(solid.normals[a], solid.normals[b])
        assert ranges.angle[a, b] == pytest.approx(expected, abs=1e-12)


@every_model
def test_tables_are_symmetric_where_their_meaning_is(name):
    ranges = tables(name)
    for symmetric in (ranges.distance_min, ranges.distance_max, ranges.angle):
        np.testing.assert_allclose(symmetric, symmetric.T, rtol=0, atol=1e-12)
    assert (ranges.distance_min <= ranges.distance_max).all()
    assert (ranges.component_min <= ranges.component_max).all()
    assert (ranges.tilt_min <= ranges.tilt_max).all()
    for own in (ranges.component_min, ranges.component_max, ranges.distance_min, ranges.angle):
        assert np.abs(own.diagonal()).max() < 1e-6


def test_tables_of_a_cube_have_their_closed_forms():
    side = 0.25
    solid = Polyhedron.from_mesh(box(side, side, side))
    ranges = PairTables.of(solid)
    cosines = solid.normals @ solid.normals.T
    same, opposite, next_to = cosines > 0.5, cosines < -0.5, np.abs(cosines) < 0.5
    for table, values in (
        ("distance_min", (0, side, 0)),
        ("distance_max", np.sqrt([2, 3, 3]) * side),
        ("angle", (0, np.pi, np.pi / 2)),
        ("component_min", (0, -side, -side)),
        ("component_max", (0, -side, 0)),
        ("tilt_min", (np.pi / 2, np.pi - np.arctan(np.sqrt(2)), np.pi / 2)),
        ("tilt_max", (np.pi / 2, np.pi, np.pi)),
    ):
        for where, value in zip((same, opposite, next_to), values, strict=True):
            np.testing.assert_allclose(getattr(ranges, table)[where], value, atol=1e-8)


def test_tables_of_a_regular_tetrahedron_have_their_closed_forms():
    edge = 3.0
    ranges = PairTables.of(Polyhedron.from_mesh(tetrahedron(edge)))
    others = ~np.eye(4, dtype=bool)
    np.testing.assert_allclose(ranges.distance_min, 0.0, atol=1e-8)
    np.testing.assert_allclose(ranges.distance_max, edge, atol=1e-8)
    np.testing.assert_allclose(ranges.angle[others], np.pi - np.arccos(1 / 3), atol=1e-12)
    np.testing.assert_allclose(ranges.component_min[others], -edge * np.sqrt(2 / 3), atol=1e-8)
    np.testing.assert_allclose(ranges.component_max, 0.0, atol=1e-8)


def test_an_inner_corner_sees_its_other_wall_at_up_to_a_right_angle():
    solid, ranges = model("l-block"), tables("l-block")
    inner = ranges.component_max > 0.1
    walls = np.argwhere(inner & inner.T)
    assert len(walls) == 2
    for a, b in walls:
        assert ranges.tilt_min[a, b] == pytest.approx(0.0, abs=1e-8)
        assert ranges.tilt_max[a, b] == pytest.approx(np.pi / 2, abs=1e-8)
    assert solid.face_count == 8


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("name", ["holed", "hull-20", "housing-34"])
def test_tables_go_with_the_solid_when_it_is_moved_and_scaled(name, scale):
    solid, ranges = model(name), tables(name)
    pose = random_pose(np.random.default_rng(2), solid.diameter)
    moved = trimesh.Trimesh(pose.apply(solid.vertices) * scale, solid.triangles, process=False)
    other = PairTables.of(Polyhedron.from_mesh(moved))
    for table in ("distance_min", "distance_max", "component_min", "component_max"):
        np.testing.assert_allclose(
            getattr(other, table),
            scale * getattr(ranges, table),
            atol=1e-8 * scale * solid.diameter,
        )
    np.testing.assert_allclose(other.angle, ranges.angle, atol=1e-7)


def triangle_pairs(rng: np.random.Generator, count: int):
    """Pairs of triangles, many of them awkward: needles, points, parallel, touching, repeated."""
    for _ in range(count):
        s, t = rng.normal(size=(2, 3, 3))
        for triangle in (s, t):
            kind = rng.integers(5)
            if kind == 0:
                triangle[2] = triangle[0] + rng.random() * (triangle[1] - triangle[0])
            elif kind == 1:
                triangle[1] = triangle[0] + 10.0 ** -rng.integers(3, 9) * rng.normal(size=3)
        kind = rng.integers(8)
        if kind == 0:
            t[:] = s + rng.normal(size=3) * 3.0
        elif kind == 1:
            t[0] = s[1]
        elif kind == 2:
            t[:2] = s[:2]
        elif kind == 3:
            s[:, 2], t[:, 2] = 0.0, 1.0
        elif kind == 4:
            t[1] = t[0] + 2.0 * (s[1] - s[0])
        yield s, t


def pierces(s: np.ndarray, t: np.ndarray) -> bool:
    """Whether triangles run through each other, as no two faces of a solid do."""
    normal = np.cross(t[1] - t[0], t[2] - t[0])
    sides = (s - t[0]) @ normal
    return bool(sides.min() < -1e-12 and sides.max() > 1e-12)


def test_triangle_distances_are_exact_for_awkward_triangles_too():
    rng = np.random.default_rng(5)
    compared = 0
    for s, t in triangle_pairs(rng, 4000):
        attained, undercut = convex_distance(s, t)
        if attained - undercut > 1e-9 or (attained < 1e-9 and (pierces(s, t) or pierces(t, s))):
            continue
        found = np.sqrt(triangle_distance_squared(s, t))
        assert found == pytest.approx(attained, abs=2e-8)
        compared += 1
    assert compared > 3000
