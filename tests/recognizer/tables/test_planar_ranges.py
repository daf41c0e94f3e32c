"""Range tables of outlines: the extremes over any two points of two edges."""

from __future__ import annotations

import numpy as np
import pytest
from oracles.outlines import SHAPES, entry, rotation, wrapped

from palpate.recognizer.models.polygon import Polygon
from palpate.recognizer.poses.entry import OutlineEntry

every_shape = pytest.mark.parametrize("name", SHAPES)


@every_shape
def test_tables_are_the_extremes_over_sampled_points(name):
    model, tables = entry(name).model, entry(name).tables
    shares = np.linspace(0.0, 1.0, 41)[:, None]
    starts, ends = model.segments[:, 0], model.segments[:, 1]
    points = starts[:, None] + shares * (ends - starts)[:, None]
    rng = np.random.default_rng(1)
    for a in rng.choice(model.face_count, min(12, model.face_count), replace=False):
        between = points[:, None] - points[a][:, None]  # (e, points of a, points of b, 2)
        lengths = np.linalg.norm(between, axis=-1)
        # From any point to the nearest sampled one, on either edge.
        steps = (model.lengths[a] + model.lengths) / 80
        for found, table, side in (
            (lengths.min(axis=(1, 2)), tables.distance_min[a], 1.0),
            (lengths.max(axis=(1, 2)), tables.distance_max[a], -1.0),
            ((between @ model.normals[a]).min(axis=(1, 2)), tables.component_min[a], 1.0),
            ((between @ model.normals[a]).max(axis=(1, 2)), tables.component_max[a], -1.0),
        ):
            assert (side * (found - table) >= 0.0).all()
            assert (side * (found - table) <= steps + 1e-8 * model.diameter).all()
        turn = rotation(-np.arctan2(model.normals[a, 1], model.normals[a, 0]))
        normals = model.normals @ turn.T
        angles = np.arctan2(normals[:, 1], normals[:, 0])
        assert np.abs(wrapped(tables.angle[a] - angles)).max() < 1e-12
        middle = (tables.tilt_min[a] + tables.tilt_max[a]) / 2
        half = (tables.tilt_max[a] - tables.tilt_min[a]) / 2
        assert half[a] >= np.pi
        towards = between @ turn.T
        tilts = wrapped(np.arctan2(towards[..., 1], towards[..., 0]) - middle[:, None, None])
        tilts = np.where(lengths > 1e-12, tilts, 0.0)  # the corner that neighbours share
        others = np.arange(model.face_count) != a
        assert (np.abs(tilts).max(axis=(1, 2)) <= half)[others].all()
        assert (half < np.pi / 2 + 1e-8)[others].all()
        # The extreme directions are those between end points, which are among the samples.
        assert (tilts.max(axis=(1, 2)) > half - 1e-8)[others].all()
        assert (tilts.min(axis=(1, 2)) < 1e-8 - half)[others].all()


def test_the_tables_of_the_memos_triangle_are_those_it_prints():
    """The right triangle with sides 3, 4 and 5 (Section 1.2): ranges of distances."""
    triangle = OutlineEntry.of(Polygon.from_corners([[0, 0], [4, 0], [0, 3]], name="3-4-5"))
    four, five, three = 0, 1, 2
    tables = triangle.tables
    np.testing.assert_allclose(tables.distance_min, 0.0, atol=1e-7)
    assert tables.distance_max[three, three] == pytest.approx(3)
    assert tables.distance_max[four, four] == pytest.approx(4)
    assert tables.distance_max[three, four] == pytest.approx(5)
    assert tables.distance_max[three, five] == pytest.approx(5)
    assert tables.angle[four, three] == pytest.approx(-np.pi / 2)
    assert tables.angle[three, four] == pytest.approx(np.pi / 2)
