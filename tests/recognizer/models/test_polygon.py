"""An outline becomes maximal edges with outward normals, and knows its own symmetries."""

from __future__ import annotations

import numpy as np
import pytest
from oracles.geometry import segment_distances
from oracles.outlines import L_SHAPE, OUTLINES, outline, regular, rotation

from palpate.assets.planar import PLANAR_NAMES, PLANAR_STAND_INS, planar_corners
from palpate.recognizer.models.polygon import Polygon
from palpate.recognizer.models.polyhedron import MOST_FACES

INCH = 0.0254
SHAPES = (*OUTLINES, *PLANAR_NAMES)

every_shape = pytest.mark.parametrize("name", SHAPES)
every_stand_in = pytest.mark.parametrize("name", PLANAR_NAMES)


def inside(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Whether each point is inside, by the angle that the outline turns about it."""
    arms = corners - points[:, None]
    angles = np.arctan2(arms[..., 1], arms[..., 0])
    turns = np.angle(np.exp(1j * np.diff(angles, axis=1, append=angles[:, :1])))
    return np.abs(turns.sum(axis=1)) > np.pi


# --- What an outline is -----------------------------------------------------------------------


def test_the_square_has_its_closed_form():
    square = outline("square")
    assert square.face_count == 4
    np.testing.assert_allclose(square.normals, [[0, -1], [1, 0], [0, 1], [-1, 0]], atol=1e-15)
    np.testing.assert_allclose(square.offsets, [0, 1, 1, 0], atol=1e-15)
    np.testing.assert_array_equal(square.segments[1], [[1, 0], [1, 1]])
    np.testing.assert_allclose(square.centroid, [0.5, 0.5])
    assert square.diameter == pytest.approx(np.sqrt(2))
    assert square.perimeter == pytest.approx(4)
    assert square.area == pytest.approx(1)
    assert square.straightness == 0.0


def test_the_l_shape_is_the_sum_of_two_rectangles():
    shape = outline("l-shape")
    areas, middles = [3.0, 1.8], [[1.5, 0.5], [0.6, 1.75]]
    assert shape.area == pytest.approx(4.8)
    np.testing.assert_allclose(shape.centroid, np.average(middles, axis=0, weights=areas))
    assert shape.perimeter == pytest.approx(11)
    assert shape.diameter == pytest.approx(np.hypot(3, 2.5))


@pytest.mark.parametrize("sides", [3, 5, 12, 101])
def test_a_regular_polygon_has_its_closed_form(sides):
    shape = Polygon.from_corners(regular(sides), name="regular")
    apothem = np.cos(np.pi / sides)
    np.testing.assert_allclose(shape.offsets, apothem)
    np.testing.assert_allclose(shape.centroid, 0.0, atol=1e-15)
    assert shape.perimeter == pytest.approx(2 * sides * np.sin(np.pi / sides))
    assert shape.area == pytest.approx(sides * np.sin(2 * np.pi / sides) / 2)
    assert len(shape.symmetries) == sides


@every_shape
def test_normals_point_out_and_segments_run_round(name):
    shape = outline(name)
    middles = shape.segments.mean(axis=1)
    step = 1e-3 * shape.lengths.min() * shape.normals
    assert inside(middles - step, shape.corners).all()
    assert not inside(middles + step, shape.corners).any()
    np.testing.assert_array_equal(shape.segments[:, 1], np.roll(shape.segments[:, 0], -1, axis=0))
    heights = (shape.segments * shape.normals[:, None]).sum(axis=2) - shape.offsets[:, None]
    assert np.abs(heights).max() < 1e-14 * (1 + shape.diameter)
    np.testing.assert_allclose(np.linalg.norm(shape.normals, axis=1), 1.0)


@every_shape
def test_area_and_centroid_are_those_of_a_raster(name):
    shape = outline(name)
    low, high = shape.corners.min(axis=0), shape.corners.max(axis=0)
    axes = [np.linspace(low[k], high[k], 201) for k in range(2)]
    x, y = np.meshgrid(*[(axis[1:] + axis[:-1]) / 2 for axis in axes])
    cells = np.column_stack([x.ravel(), y.ravel()])
    filled = cells[inside(cells, shape.corners)]
    assert shape.area == pytest.approx(np.prod(high - low) * len(filled) / len(cells), rel=0.02)
    np.testing.assert_allclose(shape.centroid, filled.mean(axis=0), atol=5e-3 * shape.diameter)


@every_shape
def test_moving_an_outline_moves_all_that_is_said_of_it(name):
    shape, R = outline(name), rotation(0.7)
    for scale, shift in ((1.0, 0.3), (1e-3, 0.0), (1e3, -1e5)):
        other = Polygon.from_corners(scale * shape.corners @ R.T + shift, name=name)
        size, rounding = scale * shape.diameter, 1e-15 * abs(shift)
        assert other.face_count == shape.face_count
        assert other.diameter == pytest.approx(size, rel=1e-12, abs=rounding)
        assert other.area == pytest.approx(scale**2 * shape.area, rel=1e-9)
        np.testing.assert_allclose(other.normals, shape.normals @ R.T, atol=1e-7)
        np.testing.assert_allclose(
            other.centroid, scale * R @ shape.centroid + shift, atol=1e-9 * size
        )
        assert len(other.symmetries) == len(shape.symmetries)


@every_shape
def test_arrays_are_read_only(name):
    shape = outline(name)
    for array in (
        shape.corners,
        shape.segments,
        shape.lengths,
        shape.normals,
        shape.offsets,
        shape.centroid,
        shape.symmetries,
    ):
        with pytest.raises(ValueError, match="read-only"):
            array[:] = 0.0


# --- Symmetries -------------------------------------------------------------------------------

ORDERS = {"square": 4, "hexagon": 6, "70-gon": 70, "wrench": 2}


@every_shape
def test_symmetries_are_a_group_that_maps_the_outline_onto_itself(name):
    shape = outline(name)
    found = shape.symmetries
    assert len(found) == ORDERS.get(name, 1)
    np.testing.assert_array_equal(found[0], np.eye(2))
    np.testing.assert_allclose(np.linalg.det(found), 1.0)
    for turn in found:
        image = (shape.corners - shape.centroid) @ turn.T + shape.centroid
        distances = segment_distances(image[:, None], shape.segments)
        assert distances.min(axis=1).max() < 1e-9 * shape.diameter
        products = turn @ found
        apart = np.abs(products[:, None] - found).max(axis=(2, 3))
        assert apart.min(axis=1).max() < 1e-9


def test_a_rectangle_has_half_a_turn_and_a_nearly_square_one_too():
    for height in (0.4, 0.99):
        shape = Polygon.from_corners([[0, 0], [1, 0], [1, height], [0, height]], name="r")
        np.testing.assert_allclose(shape.symmetries, [np.eye(2), -np.eye(2)], atol=1e-12)


# --- What is taken in -------------------------------------------------------------------------


def test_a_clockwise_outline_is_reversed():
    shape = Polygon.from_corners(L_SHAPE[::-1], name="l")
    assert shape.area > 0
    assert {tuple(c) for c in shape.corners.tolist()} == {tuple(c) for c in L_SHAPE}


def test_repeated_points_and_straight_corners_are_left_out():
    points = [
        [0, 0],
        [1, 0],
        [1, 0],
        [2, 0],
        [3, 0],
        [3, 1],
        [3, 1],
        [3, 2],
        [0, 2],
        [0, 1],
        [0, 0],
    ]
    for start in range(len(points)):
        shape = Polygon.from_corners(np.roll(points, start, axis=0), name="r")
        assert {tuple(c) for c in shape.corners.tolist()} == {(0, 0), (3, 0), (3, 2), (0, 2)}
        assert shape.straightness == 0.0


@every_shape
def test_finely_sampled_edges_in_single_precision_are_edges_still(name):
    shape = outline(name)
    rng = np.random.default_rng(1)
    points = []
    for start, end in shape.segments:
        for share in np.sort(np.r_[0.0, rng.random(5)]):
            points.append(start + share * (end - start))
    rounded = np.array(points, np.float32)
    finer = Polygon.from_corners(rounded, name=name)
    assert finer.face_count == shape.face_count
    np.testing.assert_allclose(finer.corners, shape.corners, atol=2e-6 * shape.diameter)
    assert finer.straightness < 2e-6 * shape.diameter
    off = segment_distances(rounded.astype(float)[:, None], finer.segments).min(axis=1)
    assert off.max() == pytest.approx(finer.straightness, abs=1e-15 * shape.diameter)


@pytest.mark.parametrize(
    ("corners", "complaint"),
    [
        ([0, 1, 2], r"shape \(v, 2\), not \(3,\)"),
        ([[0, 0, 0], [1, 0, 0], [0, 1, 0]], r"shape \(v, 2\), not \(3, 3\)"),
        ([], r"shape \(v, 2\)"),
        ([[0, 0], [1, 0]], "2 distinct corners"),
        ([[0, 0], [1, 0], [1, 0], [0, 0]], "2 distinct corners"),
        ([[0, 0], [1, 0], [np.nan, 1]], "corner 2 is .*finite"),
        ([[0, 0], [np.inf, 0], [0, 1]], "corner 1 is .*finite"),
        ([[0, 0], [1, 0], [2, 0]], "no area"),
        ([[0, 0], [1, 0], [2, 1e-9], [3, 0]], "no area"),
        ([[0, 0], [1, 1], [1, 0], [0, 1]], "no area"),
        ([[0, 0], [2, 2], [2, 0], [0, 1]], r"meets itself: the edge from \[0.0, 0.0\]"),
        ([[0, 0], [2, 0], [2, 2], [1, 0], [0, 2]], "meets itself"),
        ([[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [1, 1], [0, 1]], "meets itself"),
        ([[0, 0], [3, 0], [1, 0], [1, 1], [0, 1]], "meets itself"),
        (regular(MOST_FACES + 1), "1001 edges, and 1000 is the most"),
    ],
)
def test_what_is_no_outline_is_refused_by_name(corners, complaint):
    with pytest.raises(ValueError, match=complaint) as caught:
        Polygon.from_corners(corners, name="plate.csv")
    assert str(caught.value).startswith("plate.csv: ")


# --- The stand-ins ----------------------------------------------------------------------------


def test_the_planar_stand_ins_are_those_of_table_1():
    assert PLANAR_NAMES == ("wrench", "gator", "hand")
    told = [(s.name, s.edges, s.diameter_in) for s in PLANAR_STAND_INS]
    assert told == [("wrench", 12, 9.0), ("gator", 50, 14.0), ("hand", 67, 12.0)]


@pytest.mark.parametrize("stand_in", PLANAR_STAND_INS, ids=lambda s: s.name)
def test_edges_and_diameters_are_the_memos(stand_in):
    corners = planar_corners(stand_in.name)
    shape = Polygon.from_corners(corners, name=stand_in.name)
    assert shape.face_count == len(corners) == stand_in.edges
    assert shape.diameter == pytest.approx(stand_in.diameter_in * INCH, rel=1e-9)
    np.testing.assert_array_equal(shape.corners, corners)  # counter-clockwise as it is
    np.testing.assert_allclose(corners.min(axis=0), -corners.max(axis=0), atol=1e-12)


@every_stand_in
def test_no_feature_of_a_stand_in_is_smaller_than_the_noise_of_a_probe(name):
    shape = outline(name)
    assert shape.lengths.min() > 0.2 * INCH
    bend = np.abs(np.sin(np.diff(np.unwrap(np.arctan2(*shape.normals.T[::-1])))))
    assert bend.min() > np.sin(np.radians(7))


def test_the_wrench_is_mapped_onto_itself_by_half_a_turn_exactly():
    corners = planar_corners("wrench")
    np.testing.assert_array_equal(-corners, np.roll(corners, 6, axis=0))


def test_an_unknown_name_is_refused_with_the_valid_ones():
    with pytest.raises(ValueError, match="'stapler'; the library has wrench, gator, hand"):
        planar_corners("stapler")
