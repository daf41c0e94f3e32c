"""Signed distances from solids, and how deep paths run in them, against plain numpy."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.sensing import CUBE, SMALL, solid
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from oracles import solids as oracles
from oracles.geometry import signed_distances

from palpate.recognizer import Polyhedron
from palpate.recognizer.models.distance_kernels import deepest, signed_distance
from palpate.recognizer.models.features import all_features, face_features
from palpate.recognizer.poses.breach_kernels import move_inside
from palpate.recognizer.poses.fits.pose import KernelModel

Floats = NDArray[np.float64]

OTHERS = ("l-block", "pocketed", "bridge", "tetrahedron", "hull-90", "stapler", "complex-hand")
every_solid = pytest.mark.parametrize("name", [*SMALL, *OTHERS])


def kernel_distances(model: Polyhedron, points: Floats) -> tuple[Floats, Floats]:
    """Signed distances (n,) and nearest points (n, 3) of the surface, from the kernels."""
    packed = KernelModel(model, face_features(model)).model
    nearest = np.empty((len(points), 3))
    distances = [
        signed_distance(point, packed, model.face_count, found)
        for point, found in zip(points, nearest, strict=True)
    ]
    return np.array(distances), nearest


def places_near(model: Polyhedron, rng: np.random.Generator, count: int) -> Floats:
    """Points in and around a solid, many of them close to its surface."""
    low, high = model.vertices.min(axis=0), model.vertices.max(axis=0)
    around = rng.uniform(low - 0.3 * (high - low), high + 0.3 * (high - low), (count, 3))
    close = oracles.surface_points(model, count, rng)[0]
    close += rng.normal(size=(count, 3)) * model.diameter * 10.0 ** rng.uniform(-6, -1, (count, 1))
    return np.concatenate([around, close])


@every_solid
def test_distances_and_their_signs_are_those_of_triangles_and_solid_angles(name: str) -> None:
    model = solid(name)
    points = places_near(model, np.random.default_rng(1), 300)
    distances, nearest = kernel_distances(model, points)
    expected = signed_distances(model, points)
    assert (expected < 0.0).sum() > 30
    assert (expected > 0.0).sum() > 30
    np.testing.assert_allclose(distances, expected, rtol=0, atol=1e-9 * model.diameter)
    reached = np.linalg.norm(nearest - points, axis=1)
    np.testing.assert_allclose(reached, np.abs(expected), rtol=0, atol=1e-9 * model.diameter)
    on_surface = np.abs(signed_distances(model, nearest))
    np.testing.assert_allclose(on_surface, 0.0, rtol=0, atol=1e-9 * model.diameter)


@pytest.mark.parametrize("name", list(SMALL))
def test_beside_the_lines_of_edges_and_faces_distances_keep_their_signs(name: str) -> None:
    """In the planes of faces and on the lines of edges solid angles are at their worst."""
    model = solid(name)
    lines = [np.unique(np.concatenate([axis, [axis.min() - 0.01, axis.max() + 0.01]]).round(6))
             for axis in model.vertices.T]  # fmt: skip
    grid = np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, 3)
    halves = [np.unique(np.concatenate([axis, 0.5 * (axis[1:] + axis[:-1])])) for axis in lines]
    finer = np.stack(np.meshgrid(*halves, indexing="ij"), axis=-1).reshape(-1, 3)
    points = np.concatenate([grid, finer])
    expected = signed_distances(model, points)
    distances, _ = kernel_distances(model, points)
    np.testing.assert_allclose(np.abs(distances), np.abs(expected), rtol=0, atol=1e-12)
    off = np.abs(expected) > 1e-9
    assert (expected[off] > 0.0).any()
    assert (expected[off] < 0.0).any()
    np.testing.assert_array_equal(np.sign(distances[off]), np.sign(expected[off]))


def test_edges_and_vertices_among_the_features_change_no_distance() -> None:
    model = SMALL["L-block"]
    nearest = np.empty(3)
    plain, rich = (KernelModel(model, of(model)).model for of in (face_features, all_features))
    for point in places_near(model, np.random.default_rng(2), 100):
        one, other = (
            signed_distance(point, packed, model.face_count, nearest) for packed in (plain, rich)
        )
        assert one == other


def walk(
    model: Polyhedron, one: Floats, other: Floats, clearance: float, grain: float
) -> tuple[float, Floats]:
    bound = float(np.linalg.norm(model.vertices - model.centroid, axis=1).max())
    place = np.full(3, np.nan)
    found = deepest(
        one,
        other,
        clearance,
        grain,
        bound,
        KernelModel(model, face_features(model)).model,
        model.face_count,
        place,
        np.empty(3),
        np.empty(3),
    )
    return float(found), place


def sampled(model: Polyhedron, one: Floats, other: Floats, count: int = 2001) -> Floats:
    shares = np.linspace(0.0, 1.0, count)[:, None]
    return signed_distances(model, one + shares * (other - one))


@every_solid
def test_no_place_of_a_path_is_nearer_than_the_deepest_found_to_the_grain(name: str) -> None:
    model = solid(name)
    rng = np.random.default_rng(3)
    size, found_near = model.diameter, 0
    for case in range(12):
        one, other = places_near(model, rng, 2)[[0, 2]]
        if case % 3:
            one = other + size * (one - other) / np.linalg.norm(one - other)
        clearance = size * rng.uniform(-0.05, 0.1)
        grain = size * 10.0 ** rng.uniform(-3.5, -2.0)
        found, place = walk(model, one, other, clearance, grain)
        least = sampled(model, one, other, 801).min()
        if np.isinf(found):
            assert least >= clearance
            continue
        found_near += 1
        # What was found is there, on the path.
        along = (other - one) / np.linalg.norm(other - one)
        aside = place - one - ((place - one) @ along) * along
        assert np.linalg.norm(aside) < 1e-9 * size
        assert -1e-9 * size <= (place - one) @ along <= np.linalg.norm(other - one) + 1e-9 * size
        assert found == pytest.approx(signed_distances(model, place[None])[0], abs=1e-9 * size)
        if found >= clearance:
            assert least >= clearance - grain - 1e-9 * size
        else:
            # How much deeper it gets is looked for only, in steps of a share of the path.
            assert least < clearance + 1e-9 * size
            step = max(np.linalg.norm(other - one) / 64.0, grain)
            assert found <= least + step
    assert found_near > 3


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.integers(0, 2**32), st.sampled_from(list(SMALL)))
def test_a_path_that_keeps_its_clearance_and_the_grain_is_let_through(seed: int, name: str) -> None:
    model = SMALL[name]
    rng = np.random.default_rng(seed)
    one, other = places_near(model, rng, 2)[[0, 3]]
    least = float(sampled(model, one, other, 401).min())
    step = float(np.linalg.norm(other - one)) / 400.0
    grain = model.diameter * 1e-3
    # Between samples half a step may be missing.
    found, _ = walk(model, one, other, least - step, grain)
    assert found >= least - step
    found, _ = walk(model, one, other, least + 1.1 * grain, grain)
    assert found < least + 1.1 * grain


def test_a_path_out_of_reach_is_not_looked_at() -> None:
    far = np.array([1.0, 1.0, 1.0])
    found, place = walk(SMALL["cube"], far, far + [1.0, 0.0, 0.0], 0.01, 1e-4)
    assert np.isinf(found)
    assert np.isnan(place).all()


def test_a_path_that_stands_still_is_one_place() -> None:
    cube = SMALL["cube"]
    inside, outside = np.array([0.02, 0.02, 0.01]), np.array([0.02, 0.02, 0.045])
    assert walk(cube, inside, inside, -1e-3, 1e-4)[0] == pytest.approx(-0.01)
    assert walk(cube, outside, outside, 1e-3, 1e-4)[0] == pytest.approx(0.005)


def test_a_path_through_a_hole_meets_its_walls_at_their_distance() -> None:
    holed = SMALL["holed"]
    # The hole is 40 by 30 millimetres; its middle line is 15 from two of its walls.
    one, other = np.array([0.04, 0.03, -0.1]), np.array([0.04, 0.03, 0.1])
    assert walk(holed, one, other, 0.015 - 1e-4, 1e-5)[0] == pytest.approx(0.015, abs=2e-5)
    assert walk(holed, one, other, 0.016, 1e-5)[0] == pytest.approx(0.015, abs=2e-5)
    beside = one + [0.025, 0.0, 0.0]
    found, place = walk(holed, beside, other + [0.025, 0.0, 0.0], -1e-3, 1e-5)
    assert found == pytest.approx(-0.005, abs=1e-4)
    assert 0.0 < place[2] < 0.025


def test_a_place_outside_is_not_taken_for_one_inside_that_has_to_leave() -> None:
    model = KernelModel(CUBE, face_features(CUBE)).model
    top = CUBE.vertices[:, 2].max()
    for height, clearance, after in (
        (1e-5, -1e-6, 1.0),
        (-1e-5, -1e-6, -1e-6),
        (1e-5, 1e-3, 0.0),
        (2e-3, 1e-3, 1.0),
    ):
        place = CUBE.centroid.copy()
        place[2] = top + height
        space = (*(np.empty(3) for _ in range(5)),)
        assert move_inside(place, clearance, model, CUBE.face_count, space) == after
        assert (place[2] < top) == (after <= 0.0)
