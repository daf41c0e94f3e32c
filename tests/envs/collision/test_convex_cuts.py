"""Cutting: planes through polygons and cells, and the hulls of what is left."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from oracles import solids as oracles
from oracles.convex_parts import ROTATION
from scipy.spatial.transform import Rotation

from palpate.envs.collision.convex_cells import Cell, Plane, split_polygon
from palpate.envs.collision.hull import Hull


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
