"""Rays and the probe in the plane: against exact fractions, and within the bounds they state."""

from __future__ import annotations

from fractions import Fraction

import matplotlib.path
import numpy as np
import pytest
from helpers.planar_rays import random_planar_pose, unit
from oracles.outlines import OUTLINES, outline
from scipy.spatial.transform import RigidTransform

from palpate.assets.planar import PLANAR_NAMES
from palpate.envs.planar.probe import PlanarProbe
from palpate.envs.planar.rays import cast_planar_rays
from palpate.envs.scene.scene import NOTHING, OBJECT
from palpate.envs.sensors.noise import SensorNoise

SHAPES = [*OUTLINES, *PLANAR_NAMES]


def first_edge_by_fractions(corners, origin, direction):
    """The depth and the edge where a ray first meets an outline, in exact arithmetic."""
    (ox, oy), (dx, dy) = ([Fraction(float(x)) for x in row] for row in (origin, direction))
    exact = [[Fraction(float(x)) for x in corner] for corner in corners]
    best, edge = None, -1
    for k, (px, py) in enumerate(exact):
        qx, qy = exact[(k + 1) % len(exact)]
        ex, ey = qx - px, qy - py
        scale = dx * ey - dy * ex
        if scale == 0:
            continue
        depth = ((px - ox) * ey - (py - oy) * ex) / scale
        share = ((px - ox) * dy - (py - oy) * dx) / scale
        if depth >= 0 and 0 <= share <= 1 and (best is None or depth < best):
            best, edge = depth, k
    return (np.inf if best is None else float(best)), edge


@pytest.mark.parametrize("name", ["triangle", "l-shape", "comb", "wrench", "hand"])
def test_rays_meet_the_edges_that_exact_fractions_find(name):
    rng, model = np.random.default_rng(0), outline(name)
    middle, size = model.centroid, model.diameter
    origins = middle + 1.5 * size * unit(rng.uniform(-np.pi, np.pi, 40))
    towards = middle + 0.4 * size * rng.normal(size=(40, 2)) - origins
    directions = towards / np.linalg.norm(towards, axis=1, keepdims=True)
    hits = cast_planar_rays(model, RigidTransform.identity(), origins, directions)
    met = 0
    for ray in range(len(origins)):
        depth, edge = first_edge_by_fractions(model.corners, origins[ray], directions[ray])
        assert hits.edges[ray] == edge
        assert hits.distances[ray] == pytest.approx(depth, rel=1e-12)
        met += edge >= 0
    assert 10 < met < 40


@pytest.mark.parametrize("name", SHAPES)
def test_a_ray_is_outside_before_it_meets_an_outline_and_inside_after(name):
    rng, model = np.random.default_rng(1), outline(name)
    size = model.diameter
    pose = random_planar_pose(rng, size)
    bearings = rng.uniform(-np.pi, np.pi, 200)
    middle = pose.apply(np.append(model.centroid, 0.0))[:2]
    starts = middle - 2.0 * size * unit(bearings)
    starts += rng.uniform(-0.4, 0.4, (200, 1)) * size * unit(bearings + np.pi / 2.0)
    hits = cast_planar_rays(model, pose, starts, unit(bearings))
    ring = pose.apply(np.column_stack([model.corners, np.zeros(model.face_count)]))[:, :2]
    solid = matplotlib.path.Path(np.concatenate([ring, ring[:1]]), closed=True)
    free = np.where(hits.hit, hits.distances, 4.0 * size)
    for share in np.linspace(0.0, 1.0 - 1e-9, 40):
        assert not solid.contains_points(starts + (share * free)[:, None] * unit(bearings)).any()
    met = hits.hit
    beyond = (hits.points_world + 1e-9 * size * unit(bearings))[met]
    # A ray that only clips a corner is out again by then; it would be a rare one.
    assert solid.contains_points(beyond).mean() > 0.99
    assert met.sum() > 50
    assert np.isnan(hits.points_world[~met]).all()
    assert np.isnan(hits.normals_world[~met]).all()
    facing = (hits.normals_world * unit(bearings))[met].sum(axis=1)
    assert (facing < 0.0).all()
    normals = model.normals[hits.edges[met]] @ pose.rotation.as_matrix()[:2, :2].T
    assert np.allclose(hits.normals_world[met], normals)


@pytest.mark.parametrize("name", ["triangle", "square", "hexagon", "70-gon"])
def test_no_ray_slips_through_a_corner(name):
    rng, model = np.random.default_rng(2), outline(name)
    for _ in range(50):
        pose = random_planar_pose(rng, 2.0)
        ring = pose.apply(np.column_stack([model.corners, np.zeros(model.face_count)]))[:, :2]
        middle = pose.apply(np.append(model.centroid, 0.0))[:2]
        directions = (middle - ring) / np.linalg.norm(middle - ring, axis=1, keepdims=True)
        hits = cast_planar_rays(model, pose, ring - directions, directions)
        assert np.allclose(hits.distances, 1.0)


def test_what_the_probe_reports_is_within_its_bounds_and_fills_them():
    rng, model = np.random.default_rng(3), outline("gator")
    noise = SensorNoise(position_error=1e-3, normal_error=0.3)
    probe, far, lean = PlanarProbe(noise, 2.0 * model.diameter), [], []
    for _ in range(3000):
        pose = random_planar_pose(rng, 0.1 * model.diameter)
        bearing, offset = rng.uniform(-np.pi, np.pi), rng.uniform(-0.3, 0.3) * model.diameter
        touch = probe.touch(model, pose, bearing, offset, rng)
        start, direction = touch.start_world, unit([bearing])
        assert np.linalg.norm(start) == pytest.approx(np.hypot(probe.reach, offset))
        hits = cast_planar_rays(model, pose, start[None], direction)
        assert (touch.outcome == OBJECT) == hits.hit[0] == (len(touch.contacts) == 1)
        if touch.outcome == NOTHING:
            assert np.allclose(touch.end_world, start + 2.0 * probe.reach * direction[0])
            continue
        assert np.allclose(touch.contacts.approaches, direction, atol=1e-15)
        assert np.array_equal(touch.end_world, touch.contacts.positions[0])
        far.append(np.linalg.norm(touch.end_world - hits.points_world[0]))
        one, other = touch.contacts.normals[0], hits.normals_world[0]
        lean.append(np.arctan2(one[0] * other[1] - one[1] * other[0], one @ other))
    assert max(far) <= 1e-3
    assert np.mean(np.array(far) < 0.5e-3) == pytest.approx(0.25, abs=0.04)
    assert np.abs(lean).max() <= 0.3
    assert np.mean(np.array(lean) < 0.15) == pytest.approx(0.75, abs=0.04)


def test_offsets_are_to_the_left_of_the_ray():
    probe = PlanarProbe(SensorNoise(position_error=1e-3, normal_error=0.1), 5.0)
    square = outline("square")
    pose = RigidTransform.identity()
    above = probe.touch(square, pose, 0.0, 0.9, np.random.default_rng(0))
    assert above.start_world == pytest.approx([-5.0, 0.9])
    assert above.outcome == OBJECT
    below = probe.touch(square, pose, np.pi, 0.9, np.random.default_rng(0))
    assert below.start_world == pytest.approx([5.0, -0.9])
    assert below.outcome == NOTHING


def test_noise_that_is_not_uniform_is_refused():
    gaussian = SensorNoise(position_error=1e-3, normal_error=0.1, distribution="gaussian")
    with pytest.raises(ValueError, match="uniform, not 'gaussian'"):
        PlanarProbe(gaussian, 1.0)
