"""Ranges of the triangles between three faces: outer bounds, whatever the points."""

from __future__ import annotations

import itertools
from itertools import pairwise

import numpy as np
import pytest
from oracles.geometry import angle_between
from oracles.solids import SOLIDS, Floats, box, model, prism, random_pose, tables
from oracles.triangles import some_triples, triangle

from palpate.assets import STAND_IN_NAMES
from palpate.recognizer import PairTables, Polyhedron
from palpate.recognizer.models.features import all_features
from palpate.recognizer.tables.triple_kernels import measured_triangle
from palpate.recognizer.tables.triple_range_kernels import (
    CORNER_TERMS,
    corner_ranges,
    direction_cones,
)

MODELS = (*SOLIDS, *STAND_IN_NAMES)
every_model = pytest.mark.parametrize("name", MODELS)


def weights(rng: np.random.Generator, corners: int, count: int) -> Floats:
    """(count, corners) mostly on corners and edges, where the extremes are, but not only."""
    return rng.dirichlet(np.full(corners, rng.choice([0.05, 0.3, 1.0])), count)


def points_of_face(solid: Polyhedron, face: int, count: int, rng: np.random.Generator) -> Floats:
    members = rng.choice(np.flatnonzero(solid.triangle_faces == face), count)
    corners = solid.vertices[solid.triangles[members]]
    return np.einsum("nk,nkd->nd", weights(rng, 3, count), corners)


@every_model
def test_no_three_points_of_three_faces_lie_outside_the_ranges(name):
    solid, rng = model(name), np.random.default_rng(0)
    chosen = some_triples(solid.face_count, 200, rng)
    ranges = tables(name).triples.ranges(chosen)
    width, seen = 0.0, 0
    for row, faces in enumerate(chosen):
        angles, areas = triangle(*(points_of_face(solid, face, 200, rng) for face in faces))
        for k in range(3):
            known = angles[~np.isnan(angles[:, k]), k]
            assert (known >= ranges.angle_min[row, k]).all()
            assert (known <= ranges.angle_max[row, k]).all()
            width += np.ptp(known) if len(known) else 0.0
            seen += 1
        assert (areas >= ranges.area_min[row] - 1e-12 * solid.diameter**2).all()
        assert (areas <= ranges.area_max[row] + 1e-12 * solid.diameter**2).all()
    outer = np.clip(ranges.angle_max, 0, np.pi) - np.clip(ranges.angle_min, 0, np.pi)
    # Bounds that say nothing would pass too. On a tetrahedron nearly every angle is possible.
    assert np.pi - outer.mean() > 0.3 * (np.pi - width / seen) or name == "tetrahedron"


@every_model
def test_cones_hold_every_direction_between_two_faces(name):
    solid, rng = model(name), np.random.default_rng(1)
    start = solid.hulls.start
    axes, half_angles = direction_cones(solid.hulls.corners, start, 1e-9 * solid.diameter)
    narrow = 0
    for a, b in rng.integers(solid.face_count, size=(200, 2)):
        p, q = (points_of_face(solid, face, 40, rng) for face in (a, b))
        p = np.concatenate([p, solid.hulls.corners[start[a] : start[a + 1]]])
        q = np.concatenate([q, solid.hulls.corners[start[b] : start[b + 1]]])
        between = (q[:, None] - p).reshape(-1, 3)
        lengths = np.linalg.norm(between, axis=1)
        between = between[lengths > 1e-6 * solid.diameter]
        cosines = between @ axes[a, b] / np.linalg.norm(between, axis=1)
        assert (np.arccos(np.clip(cosines, -1.0, 1.0)) <= half_angles[a, b] + 1e-6).all()
        narrow += half_angles[a, b] < np.pi / 4
    assert narrow > 10 or name in ("cube", "tetrahedron", "l-block", "holed", "bridge")


def test_ranges_over_edges_and_vertices_hold_their_points_too():
    solid, rng = model("bridge"), np.random.default_rng(6)
    features = all_features(solid)
    chosen = some_triples(len(features), 400, rng)
    ranges = PairTables.of(solid, features).triples.ranges(chosen)
    hulls = [features.corners[a:b] for a, b in pairwise(features.start[: len(features) + 1])]
    kinds = set()
    for row, faces in enumerate(chosen):
        points = [weights(rng, len(hulls[f]), 60) @ hulls[f] for f in faces]
        angles, areas = triangle(*points)
        near = np.isnan(angles)
        for k in range(3):
            for j in range(3):
                if j != k:
                    near[:, k] |= np.linalg.norm(points[k] - points[j], axis=1) < 1e-6
        assert ((angles >= ranges.angle_min[row]) | near).all()
        assert ((angles <= ranges.angle_max[row]) | near).all()
        assert (areas >= ranges.area_min[row] - 1e-12).all()
        assert (areas <= ranges.area_max[row] + 1e-12).all()
        kinds |= {features.kind(int(f)) for f in faces}
    assert kinds == {"face", "edge", "vertex"}


def polygon_of(rng: np.random.Generator, size: float) -> Floats:
    """A flat convex polygon, a segment or a point, somewhere in a unit cube."""
    corners = int(rng.integers(1, 6))
    around = np.sort(rng.uniform(0, 2 * np.pi, corners))
    frame = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    ring = np.column_stack([np.cos(around), rng.uniform(0.2, 1) * np.sin(around)])
    return rng.uniform(-0.5, 0.5, 3) + size * ring @ frame[:2]


def bounds_of(polygons: list[Floats]) -> Floats:
    """(4, 2) what the kernel says of three polygons."""
    corners, sizes = np.concatenate(polygons), [len(p) for p in polygons]
    middles = [p.mean(axis=0) for p in polygons]
    lifts = [((p - c) ** 2).sum(axis=1) for p, c in zip(polygons, middles, strict=True)]
    out = np.empty((4, 2))
    corner_ranges(
        corners,
        np.cumsum([0, *sizes]),
        np.concatenate(lifts),
        (0, 1, 2),
        1e-15,
        np.empty((int(np.prod(sizes)), CORNER_TERMS)),
        out,
    )
    return out


def polygon_triples(count: int):
    """Three polygons each: far apart, near, with a corner or an edge in common, or the same."""
    rng = np.random.default_rng(3)
    for _ in range(count):
        polygons = [polygon_of(rng, 10.0 ** rng.uniform(-2, 0)) for _ in range(3)]
        kind = rng.integers(5)
        if kind == 1:
            polygons[1] = polygons[1] - polygons[1][0] + polygons[0][-1]
        elif kind == 2:
            polygons[1] = np.vstack([polygons[0][:2], rng.uniform(-0.5, 0.5, 3)])
        elif kind == 3:
            polygons[rng.integers(1, 3)] = polygons[0]
        yield polygons, rng


def test_bounds_from_corners_hold_all_triangles_of_awkward_polygons():
    informative = 0
    for polygons, rng in polygon_triples(1800):
        out = bounds_of(polygons)
        points = [weights(rng, len(p), 150) @ p for p in polygons]
        angles, areas = triangle(*points)
        for k in range(3):
            known = angles[~np.isnan(angles[:, k]), k]
            # Legs of a few millionths have no direction to speak of in double precision.
            far = min(
                np.linalg.norm(points[k] - points[j], axis=1)[~np.isnan(angles[:, k])].min(
                    initial=1
                )
                for j in range(3)
                if j != k
            )
            slack = 1e-9 + 1e-14 / far
            assert (known >= out[k, 0] - slack).all()
            assert (known <= out[k, 1] + slack).all()
            informative += out[k, 0] > 0.1 or out[k, 1] < 3.0
        assert (areas >= out[3, 0] - 1e-12).all()
        assert (areas <= out[3, 1] + 1e-12).all()
    assert informative > 1800


def test_bounds_that_are_said_to_be_exact_are_those_of_the_corners():
    seen = 0
    for polygons, _ in polygon_triples(600):
        out = bounds_of(polygons)
        corners = np.array(list(itertools.product(*polygons)))
        angles, areas = triangle(*corners.swapaxes(0, 1))
        assert out[3, 1] == pytest.approx(areas.max(), abs=1e-12)
        for k in range(3):
            if not np.isnan(angles[:, k]).any() and angles[:, k].min() > np.pi / 2 + 1e-6:
                assert out[k, 0] == pytest.approx(angles[:, k].min(), abs=1e-9)
                seen += 1
    assert seen > 50


def test_bounds_of_small_faces_far_apart_are_tight():
    rng = np.random.default_rng(8)
    excess = []
    for _ in range(300):
        polygons = [0.01 * polygon_of(rng, 1.0) + rng.normal(size=3) for _ in range(3)]
        out = bounds_of(polygons)
        angles, areas = triangle(*np.array(list(itertools.product(*polygons))).swapaxes(0, 1))
        excess.append(angles.min(axis=0) - out[:3, 0])
        excess.append(out[:3, 1] - angles.max(axis=0))
        assert out[3, 0] <= areas.min()
    assert np.median(excess) < 1e-3
    assert np.percentile(excess, 90) < 0.02


def test_ranges_of_a_cube_have_their_closed_forms():
    side = 0.25
    solid = Polyhedron.from_mesh(box(side, side, side))
    top, bottom = (int(np.argmax(sign * solid.normals[:, 2])) for sign in (1, -1))
    ranges = PairTables.of(solid).triples.ranges(np.array([[bottom, top, top], [top, top, top]]))
    # Seen from a corner of the bottom, the farthest apart on top are two opposite corners, or the
    # corner above and the one across; half a turn is no more than over a point of the top.
    widest = max(
        angle_between(np.array(u) - p, np.array(w) - p)
        for p in (np.array([x, y, 0.0]) for x, y in itertools.product([0, 0.5, 1], repeat=2))
        for u, w in itertools.combinations(itertools.product([0, 1], [0, 1], [1.0]), 2)
    )
    assert widest <= ranges.angle_max[0, 0] < widest + 0.3
    assert ranges.angle_min[0, 0] == pytest.approx(0.0, abs=1e-6)
    # Two points of the top can't see one of the bottom flatter than across the diagonal.
    assert ranges.angle_min[0, 1] == pytest.approx(np.arctan(1 / np.sqrt(2)), abs=0.15)
    np.testing.assert_allclose(ranges.area_min, 0.0, atol=1e-12)
    np.testing.assert_allclose(ranges.area_max, [np.sqrt(3) / 2 * side**2, side**2 / 2], rtol=1e-9)


def test_a_hull_of_many_corners_is_held_by_one_of_few():
    solid = Polyhedron.from_mesh(prism(60, 0.5))
    few = PairTables.of(solid).triples
    rng = np.random.default_rng(4)
    round_faces = np.flatnonzero(np.abs(solid.normals[:, 2]) > 0.5)
    chosen = some_triples(solid.face_count, 200, rng)
    chosen[:150, 0] = rng.choice(round_faces, 150)
    chosen[:60, 1] = rng.choice(round_faces, 60)
    ranges = few.ranges(chosen)
    for row, faces in enumerate(chosen):
        angles, areas = triangle(*(points_of_face(solid, face, 200, rng) for face in faces))
        known = np.where(np.isnan(angles), 1.0, angles)
        nothing = np.isnan(angles)
        assert ((known >= ranges.angle_min[row]) | nothing).all()
        assert ((known <= ranges.angle_max[row]) | nothing).all()
        assert (areas <= ranges.area_max[row]).all()
        assert (areas >= ranges.area_min[row] - 1e-12).all()
    # A polygon of twelve sides around a disc is larger by 1 / cos 15 degrees at most.
    assert ranges.area_max.max() < 1.2 * 3 * np.sqrt(3) / 4 + 0.5


@pytest.mark.parametrize("scale", [1e-3, 1e3])
def test_ranges_go_with_the_solid_when_it_is_moved_and_scaled(scale):
    import trimesh

    solid, rng = model("housing-34"), np.random.default_rng(2)
    pose = random_pose(rng, solid.diameter)
    moved = trimesh.Trimesh(pose.apply(solid.vertices) * scale, solid.triangles, process=False)
    other = PairTables.of(Polyhedron.from_mesh(moved)).triples
    chosen = some_triples(solid.face_count, 400, rng)
    here, there = tables("housing-34").triples.ranges(chosen), other.ranges(chosen)
    np.testing.assert_allclose(there.area_max, scale**2 * here.area_max, rtol=1e-6)
    # Where one face's plane just touches another face, rounding decides what the tilts say.
    alike = np.abs(there.angle_min - here.angle_min) < 1e-3
    alike &= np.abs(there.angle_max - here.angle_max) < 1e-3
    assert alike.mean() > 0.85


def test_what_three_balls_allow_holds_every_triangle_with_points_in_them():
    rng = np.random.default_rng(5)
    for case in range(800):
        points = rng.normal(size=(3, 3))
        if case % 3 == 0:
            points[2] = points[1] + 10.0 ** rng.uniform(-6, 0) * rng.normal(size=3)
        reach = 10.0 ** rng.uniform(-4, 0, 3)
        felt = np.empty((4, 2))
        measured_triangle(points, reach, felt)
        shifts = rng.normal(size=(60, 3, 3))
        shifts /= np.linalg.norm(shifts, axis=2, keepdims=True)
        true = points + shifts * reach[:, None] * rng.choice([0.5, 1.0], (60, 3, 1))
        angles, areas = triangle(*true.swapaxes(0, 1))
        assert (angles >= felt[:3, 0] - 1e-9).all()
        assert (angles <= felt[:3, 1] + 1e-9).all()
        assert (areas >= felt[3, 0] - 1e-12).all()
        assert (areas <= felt[3, 1] + 1e-12).all()
