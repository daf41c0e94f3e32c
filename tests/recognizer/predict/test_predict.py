"""Predictions are what casting ray after ray gives, with the uncertainty that poses have."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.pose_samples import pose_of, samples_at
from oracles.solids import SOLIDS, model, random_pose
from scipy.spatial.transform import RigidTransform, Rotation

from palpate.assets import STAND_IN_NAMES
from palpate.recognizer import Polyhedron
from palpate.recognizer.models.rays import cast_rays
from palpate.recognizer.predict.prediction import (
    MET_OBJECT,
    MET_PLANE,
    PoseSamples,
    Predictions,
    predict,
)
from palpate.recognizer.predict.probes import ProbeSpace, TriadRays


def plain_predictions(samples: PoseSamples, rays: TriadRays) -> Predictions:
    """Each pose's rays one by one, against every triangle."""
    starts, directions = rays.starts_world.reshape(-1, 3), rays.directions_world.reshape(-1, 3)
    count, many = len(samples), len(starts)
    plane = -starts[:, 2] / directions[:, 2]
    depths, normals = np.tile(plane, (count, 1)), np.tile([0.0, 0.0, 1.0], (count, many, 1))
    outcomes, spread = np.full((count, many), MET_PLANE, np.int8), np.zeros((count, many))
    for row in range(count):
        solid, pose = samples.models[samples.objects[row]], pose_of(samples, row)
        hits = cast_rays(solid, pose, starts, directions)
        met = hits.hit & (hits.distances < plane)
        facing = hits.normals_world[met]
        outcomes[row, met] = MET_OBJECT
        depths[row, met] = hits.distances[met]
        normals[row, met] = facing
        arms = hits.points_world[met] - pose.apply(solid.centroid)
        levers = np.linalg.norm(np.cross(arms, facing), axis=1)
        moved = np.hypot(samples.position_spread[row], levers * samples.rotation_spread[row])
        spread[row, met] = moved / np.abs((facing * directions[met]).sum(axis=1))
    shape = (count, many // 3, 3)
    return Predictions(
        outcomes.reshape(shape),
        depths.reshape(shape),
        normals.reshape(*shape, 3),
        spread.reshape(shape),
    )


SPREADS = {"spread": 0.001, "turn": 0.02}
"""Of shifts, metres, and of turns, radians."""


def about_the_origin(solid: Polyhedron, rng: np.random.Generator) -> RigidTransform:
    """Any orientation, the centroid about a quarter of the diameter around the origin."""
    turn = random_pose(rng, 0.0).rotation
    place = 0.25 * solid.diameter * rng.uniform(-1.0, 1.0, 3)
    return RigidTransform.from_components(place - turn.apply(solid.centroid.copy()), turn)


def triads(solid: Polyhedron, count: int, rng: np.random.Generator) -> TriadRays:
    space = ProbeSpace(0.6 * solid.diameter, 3.0 * solid.diameter)
    return space.rays(rng.uniform(-1.0, 1.0, (count, 3)))


def agree(found: Predictions, wanted: Predictions, size: float) -> None:
    """The same to rounding: of a thousand rays hardly any comes so near an edge that it may not."""
    same = (found.outcomes == wanted.outcomes) & np.isclose(
        found.depths, wanted.depths, rtol=0.0, atol=1e-8 * size
    )
    assert same.mean() > 0.999
    away = (found.normals_world - wanted.normals_world)[same]
    assert (np.abs(away).max(axis=1) < 1e-9).mean() > 0.999
    apart = np.abs(found.depth_spread - wanted.depth_spread)[same]
    assert (apart <= 1e-6 * wanted.depth_spread[same]).mean() > 0.999


@pytest.mark.parametrize("name", [*SOLIDS, *STAND_IN_NAMES])
def test_predictions_are_those_of_casting_every_ray_against_every_triangle(name):
    solid, rng = model(name), np.random.default_rng(0)
    samples = samples_at([solid], [about_the_origin(solid, rng) for _ in range(6)], **SPREADS)
    rays = triads(solid, 60, rng)
    found, wanted = predict(samples, rays), plain_predictions(samples, rays)
    agree(found, wanted, solid.diameter)
    assert 0.05 < (wanted.outcomes == MET_OBJECT).mean() < 0.95


def test_a_library_is_predicted_as_its_objects_are():
    solids, rng = [model(name) for name in STAND_IN_NAMES], np.random.default_rng(1)
    poses = [about_the_origin(solids[row % len(solids)], rng) for row in range(12)]
    samples, rays = (
        samples_at(solids, poses, objects=np.arange(12) % len(solids), **SPREADS),
        triads(solids[-1], 70, rng),
    )
    agree(predict(samples, rays), plain_predictions(samples, rays), solids[-1].diameter)


@pytest.mark.parametrize("size", [1e-3, 1e3])
def test_the_size_of_the_world_does_not_matter(size):
    small, rng = model("housing-34"), np.random.default_rng(2)
    scale = size / small.diameter
    import trimesh

    mesh = trimesh.Trimesh(small.vertices * scale, small.triangles, process=False)
    solid = Polyhedron.from_mesh(mesh, name="scaled")
    samples = samples_at([solid], [about_the_origin(solid, rng) for _ in range(4)], turn=0.02)
    rays = triads(solid, 50, rng)
    agree(predict(samples, rays), plain_predictions(samples, rays), solid.diameter)


def test_rays_through_edges_and_corners_meet_the_solid():
    solid, rng = model("cube"), np.random.default_rng(3)
    for _ in range(20):
        turn = random_pose(rng, 0.0).rotation
        pose = RigidTransform.from_components(
            -turn.apply(solid.centroid.copy()) + [0, 0, 2.0], turn
        )
        ends = np.concatenate([solid.vertices, solid.edges.mean(axis=1)])
        down = -np.array([[0.3, 0.2, 0.9]]) / np.linalg.norm([0.3, 0.2, 0.9])
        # A corner that is seen against the sky may be met or not: move in by a millionth.
        targets = pose.apply(solid.centroid + (1.0 - 1e-5) * (ends - solid.centroid))
        rows = targets[: len(targets) // 3 * 3]
        rays = TriadRays(
            (rows - 5.0 * down).reshape(-1, 3, 3), np.tile(down, (len(rows) // 3, 3, 1))
        )
        found = predict(samples_at([solid], [pose], **SPREADS), rays)
        assert (found.outcomes == MET_OBJECT).all()


def test_what_lies_below_the_plane_or_behind_the_start_is_not_met():
    solid = model("cube")
    below = RigidTransform.from_translation([-0.5, -0.5, -1.2])
    behind = RigidTransform.from_translation([-0.5, -0.5, 40.0])
    rays = ProbeSpace(1.0, 5.0).rays(np.zeros((1, 3)))
    found = predict(samples_at([solid], [below, behind], **SPREADS), rays)
    assert (found.outcomes == MET_PLANE).all()
    np.testing.assert_allclose(found.depths, 5.0)
    np.testing.assert_array_equal(found.normals_world[..., 2], 1.0)
    assert (found.depth_spread == 0.0).all()


def test_the_spread_of_depths_is_that_of_poses_moved_at_random():
    solid, rng = model("tetrahedron"), np.random.default_rng(4)
    pose, rays = about_the_origin(solid, rng), triads(solid, 25, rng)
    shift, turn, many = 2e-4 * solid.diameter, 5e-4, 1500
    predicted = predict(samples_at([solid], [pose], spread=shift, turn=turn), rays)
    centre = pose.apply(solid.centroid)
    moved = []
    for _ in range(many):
        rotation = Rotation.from_rotvec(turn * rng.normal(size=3))
        about = RigidTransform.from_components(
            centre - rotation.apply(centre) + shift * rng.normal(size=3), rotation
        )
        moved.append(about * pose)
    drawn = predict(samples_at([solid], moved, **SPREADS), rays)
    normals = drawn.normals_world @ np.ones(3)
    steady = (drawn.outcomes == MET_OBJECT).all(axis=0) & (normals.std(axis=0) < 3.0 * turn)
    assert steady.sum() > 10
    ratio = drawn.depths.std(axis=0)[steady] / predicted.depth_spread[0][steady]
    assert np.abs(ratio - 1.0).max() < 0.1


def test_a_balls_centre_stops_a_radius_off_the_face_that_it_meets():
    solid, radius = model("cube"), 0.05
    pose = RigidTransform.from_translation([-0.5, -0.5, -0.5])
    rays = ProbeSpace(0.2, 5.0).rays(np.random.default_rng(5).uniform(-1.0, 1.0, (40, 3)))
    point, ball = (
        predict(samples_at([solid], [pose], **SPREADS), rays, radius=r) for r in (0.0, radius)
    )
    met = point.outcomes == MET_OBJECT
    assert met.any()
    np.testing.assert_array_equal(ball.outcomes[met], MET_OBJECT)
    ends = rays.starts_world + ball.depths[0, ..., None] * rays.directions_world
    facing = ball.normals_world[met]
    heights = ((ends[met[0]] - pose.apply(solid.centroid)) * facing).sum(axis=1) - 0.5
    np.testing.assert_allclose(heights, radius, atol=1e-12)
    np.testing.assert_array_equal(facing, point.normals_world[met])
    np.testing.assert_allclose(ends[~met[0]][:, 2], radius, atol=1e-12)


def test_no_samples_and_no_rays_predict_nothing():
    solid = model("cube")
    rays = ProbeSpace(1.0, 5.0).rays(np.zeros((2, 3)))
    assert predict(PoseSamples.none([solid]), rays).depths.shape == (0, 2, 3)
    none = ProbeSpace(1.0, 5.0).rays(np.zeros((0, 3)))
    pose = RigidTransform.identity()
    assert predict(samples_at([solid], [pose], **SPREADS), none).normals_world.shape == (1, 0, 3, 3)


def test_a_radius_below_zero_is_refused():
    rays = ProbeSpace(1.0, 5.0).rays(np.zeros((1, 3)))
    with pytest.raises(ValueError, match="zero or more"):
        predict(PoseSamples.none([model("cube")]), rays, radius=-0.1)
