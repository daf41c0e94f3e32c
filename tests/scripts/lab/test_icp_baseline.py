"""The baseline is a fair one: starts well spread, samples even, exact contacts fitted exactly."""

from __future__ import annotations

import numpy as np
import pytest
from oracles.solids import model, noisy_contacts, random_pose, surface_points
from scipy.spatial.transform import Rotation

from palpate.recognizer import pose_difference
from palpate.scripts.lab.bench.icp_baseline import MultiStartIcp, super_fibonacci, surface_samples

POSITION_ERROR, NORMAL_ERROR = 0.00127, np.pi / 10


def angles_to_nearest(starts: Rotation, others: Rotation) -> np.ndarray:
    """(m,) radians from each of the others to the start nearest to it."""
    dots = np.abs(others.as_quat() @ starts.as_quat().T)
    return 2.0 * np.arccos(np.minimum(dots.max(axis=1), 1.0))


@pytest.mark.parametrize("count", [30, 60, 500])
def test_starts_are_spread_better_than_random_ones(count):
    quaternions = super_fibonacci(count)
    np.testing.assert_allclose(np.linalg.norm(quaternions, axis=1), 1.0, rtol=1e-12)
    rng = np.random.default_rng(0)
    everywhere = Rotation.random(4000, rng=rng)
    farthest = angles_to_nearest(Rotation.from_quat(quaternions), everywhere).max()
    by_chance = [
        angles_to_nearest(Rotation.random(count, rng=rng), everywhere).max() for _ in range(20)
    ]
    assert farthest < min(by_chance)


def test_sixty_starts_are_far_apart_and_leave_no_large_gap():
    starts = Rotation.from_quat(super_fibonacci(60))
    dots = np.abs(starts.as_quat() @ starts.as_quat().T) - np.eye(60)
    assert 2.0 * np.arccos(dots.max()) > np.radians(36.0)
    everywhere = Rotation.random(4000, rng=np.random.default_rng(1))
    assert angles_to_nearest(starts, everywhere).max() < np.radians(62.0)


@pytest.mark.parametrize("name", ["l-block", "holed", "hull-20"])
def test_samples_lie_on_their_faces_in_proportion_to_area(name):
    solid = model(name)
    points, normals = surface_samples(solid, 5000)
    # None of these solids has two faces in one plane.
    off = np.linalg.norm(normals[:, None] - solid.normals, axis=2)
    off += np.abs(points @ solid.normals.T - solid.offsets)
    faces = off.argmin(axis=1)
    assert off.min(axis=1).max() < 1e-9
    shares = np.bincount(faces, minlength=solid.face_count) / 5000
    np.testing.assert_allclose(shares, solid.areas / solid.areas.sum(), atol=4e-4)
    middles = np.array([points[faces == face].mean(axis=0) for face in range(solid.face_count)])
    for face in range(solid.face_count):
        own = solid.vertices[solid.triangles[solid.triangle_faces == face]]
        areas = np.linalg.norm(np.cross(own[:, 1] - own[:, 0], own[:, 2] - own[:, 0]), axis=1)
        middle = areas @ own.mean(axis=1) / areas.sum()
        assert np.linalg.norm(middles[face] - middle) < 0.02 * solid.diameter


@pytest.mark.parametrize("name", ["l-block", "housing", "stapler"])
def test_many_exact_contacts_give_the_pose_itself(name):
    solid = model(name)
    error = POSITION_ERROR * solid.diameter / 0.1
    icp = MultiStartIcp(solid, position_error=error, normal_error=NORMAL_ERROR)
    rng = np.random.default_rng(2)
    for _ in range(3):
        T_world_object = random_pose(rng, 10.0 * solid.diameter)
        points, faces = surface_points(solid, 60, rng)
        contacts = noisy_contacts(
            T_world_object.apply(points),
            T_world_object.rotation.apply(solid.normals[faces]),
            rng,
            position_error=1e-9 * solid.diameter,
            normal_error=1e-9,
        )
        fit = icp.fit(contacts)
        off = pose_difference(solid, fit.pose, T_world_object)
        # What is left is a contact near an edge, whose neighbour is a sample beyond the edge.
        assert off.rotation < 3e-3
        assert off.translation < 1e-3 * solid.diameter
        assert fit.residual < 3.0


def test_noisy_contacts_give_the_pose_most_of_the_time_and_a_residual_of_their_size():
    solid = model("stapler")
    icp = MultiStartIcp(solid, position_error=POSITION_ERROR, normal_error=NORMAL_ERROR)
    rng = np.random.default_rng(3)
    right, residuals = 0, []
    for _ in range(6):
        T_world_object = random_pose(rng, 1.0)
        points, faces = surface_points(solid, 25, rng)
        contacts = noisy_contacts(
            T_world_object.apply(points),
            T_world_object.rotation.apply(solid.normals[faces]),
            rng,
            position_error=POSITION_ERROR,
            normal_error=NORMAL_ERROR,
        )
        fit = icp.fit(contacts)
        again = icp.fit(contacts)
        assert fit.residual == again.residual
        off = pose_difference(solid, fit.pose, T_world_object)
        right += off.rotation < np.radians(6.0) and off.translation < 0.03 * solid.diameter
        residuals.append(fit.residual)
    assert right >= 5
    # Three readings a contact, each of about one standard deviation, less six freedoms.
    assert 20.0 < np.median(residuals) < 100.0
