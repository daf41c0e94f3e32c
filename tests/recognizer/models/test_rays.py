"""Rays meet what linear algebra says, and what MuJoCo says."""

from __future__ import annotations

import numpy as np
import pytest
from oracles.solids import SOLIDS, first_hit, model, random_pose
from scipy.spatial.transform import RigidTransform

from palpate.assets import STAND_IN_NAMES
from palpate.envs.scene.scene import OBJECT, ProbeScene
from palpate.recognizer.models.rays import cast_rays

every_stand_in = pytest.mark.parametrize("name", STAND_IN_NAMES)


def rays_around(solid, pose: RigidTransform, count: int, rng: np.random.Generator):
    """Rays from a sphere around an object towards its neighbourhood; some of them miss."""
    centre = pose.apply(solid.centroid)
    starts = rng.normal(size=(count, 3))
    starts = centre + 1.2 * solid.diameter * starts / np.linalg.norm(starts, axis=1, keepdims=True)
    spread = 0.3 * solid.diameter
    directions = centre + spread * rng.normal(size=(count, 3)) - starts
    return starts, directions / np.linalg.norm(directions, axis=1, keepdims=True)


@pytest.mark.parametrize("name", [*SOLIDS, *STAND_IN_NAMES])
def test_rays_meet_the_triangles_that_plain_linear_algebra_finds(name):
    solid, rng = model(name), np.random.default_rng(0)
    pose = random_pose(rng, solid.diameter)
    starts, directions = rays_around(solid, pose, 40, rng)
    hits = cast_rays(solid, pose, starts, directions)
    corners = pose.apply(solid.vertices)[solid.triangles]
    for ray in range(len(starts)):
        depth, triangle = first_hit(corners, starts[ray], directions[ray])
        assert hits.hit[ray] == (triangle >= 0)
        if triangle < 0:
            assert hits.distances[ray] == np.inf
            assert hits.faces[ray] == -1
            assert np.isnan(hits.points_world[ray]).all()
            assert np.isnan(hits.normals_world[ray]).all()
            continue
        assert hits.distances[ray] == pytest.approx(depth, abs=1e-10 * solid.diameter)
        assert hits.faces[ray] == solid.triangle_faces[triangle]
        end = starts[ray] + depth * directions[ray]
        np.testing.assert_allclose(hits.points_world[ray], end, atol=1e-10 * solid.diameter)
        normal = pose.rotation.apply(solid.normals[hits.faces[ray]].copy())
        np.testing.assert_allclose(hits.normals_world[ray], normal, atol=1e-12)
        assert normal @ directions[ray] < 0.0
    assert hits.hit.any()


def test_rays_that_miss_are_found_to_miss():
    solid, rng = model("cube"), np.random.default_rng(1)
    starts, directions = rays_around(solid, RigidTransform.identity(), 300, rng)
    away = cast_rays(solid, RigidTransform.identity(), starts, -directions)
    assert not away.hit.any()
    assert (away.distances == np.inf).all()
    towards = cast_rays(solid, RigidTransform.identity(), starts, directions)
    assert 0 < towards.hit.sum() < 300


def test_a_ray_through_an_edge_or_a_corner_or_a_diagonal_meets_the_solid():
    solid = model("cube")
    targets = np.array([[0.5, 0.5, 1.0], [0.0, 0.3, 1.0], [1.0, 1.0, 1.0], [0.25, 0.25, 1.0]])
    starts = targets + [-0.4, -0.3, 2.0]
    directions = targets - starts
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    hits = cast_rays(solid, RigidTransform.identity(), starts, directions)
    assert hits.hit.all()
    np.testing.assert_allclose(hits.points_world, targets, atol=1e-12)


def test_a_ray_through_a_hole_meets_nothing():
    starts, down = np.array([[1.6, 1.75, 3.0], [0.5, 1.75, 3.0]]), np.array([[0.0, 0.0, -1.0]] * 2)
    through = cast_rays(model("holed"), RigidTransform.identity(), starts, down)
    assert through.hit.tolist() == [False, True]
    into = cast_rays(model("pocketed"), RigidTransform.identity(), starts, down)
    np.testing.assert_allclose(into.points_world[:, 2], [1.0, 1.6])


def test_no_rays_meet_nothing():
    none = np.zeros((0, 3))
    hits = cast_rays(model("cube"), RigidTransform.identity(), none, none)
    assert hits.hit.shape == (0,)
    assert hits.points_world.shape == (0, 3)


@every_stand_in
def test_rays_meet_what_mujoco_says(name):
    solid, rng = model(name), np.random.default_rng(2)
    scene = ProbeScene(solid)
    met = missed = 0
    for _ in range(5):
        pose = random_pose(rng, 0.1)
        lifted = RigidTransform.from_translation([0.0, 0.0, 2.0]) * pose  # clear of the plane
        scene.place(lifted)
        starts, directions = rays_around(solid, lifted, 200, rng)
        ours, theirs = cast_rays(solid, lifted, starts, directions), scene.cast(starts, directions)
        struck = theirs.outcomes == OBJECT
        # Single precision moves an edge by 1e-8 m: now and then a ray just passes it by.
        agree = ours.hit == struck
        assert agree.mean() > 0.99
        both = ours.hit & struck
        apart = np.linalg.norm(ours.points_world[both] - theirs.ends_world[both], axis=1)
        turned = (ours.normals_world[both] * theirs.normals_world[both]).sum(axis=1)
        same = apart < 1e-6
        assert same.mean() > 0.99
        assert (turned[same] > 1.0 - 1e-9).mean() > 0.99
        met, missed = met + int(both.sum()), missed + int((~ours.hit & ~struck).sum())
    assert met > 200
    assert missed > 50
