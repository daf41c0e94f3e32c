"""The public baseline is used as it is meant: it finds a pose that it is led near to."""

from __future__ import annotations

import numpy as np
import pytest
from oracles.solids import model, noisy_contacts, random_pose, surface_points
from scipy.spatial.transform import RigidTransform, Rotation

from palpate.recognizer import Contacts, pose_difference
from palpate.scripts.lab.bench.gicp_baseline import SmallGicp

NEAR = np.radians(8.0)


def exact_contacts(name: str, pose: RigidTransform, rng: np.random.Generator) -> Contacts:
    solid = model(name)
    points, faces = surface_points(solid, 40, rng)
    return noisy_contacts(
        pose.apply(points),
        pose.rotation.apply(solid.normals[faces]),
        rng,
        position_error=1e-9 * solid.diameter,
        normal_error=1e-9,
    )


def small_gicp_of(name: str) -> SmallGicp:
    solid = model(name)
    # Only their ratio matters, which sets how far out the points around a contact are.
    return SmallGicp(solid, position_error=2e-3 * solid.diameter, normal_error=np.pi / 10)


@pytest.mark.parametrize("name", ["l-block", "housing"])
def test_exact_contacts_give_the_pose_from_a_start_near_it(name):
    solid, rng = model(name), np.random.default_rng(4)
    baseline = small_gicp_of(name)
    for _ in range(3):
        truth = random_pose(rng, 10.0 * solid.diameter)
        axis = rng.normal(size=3)
        away = RigidTransform.from_components(
            0.03 * solid.diameter * rng.uniform(-1.0, 1.0, 3),
            Rotation.from_rotvec(NEAR * axis / np.linalg.norm(axis)),
        )
        start = truth * away
        contacts = exact_contacts(name, truth, rng)
        before = pose_difference(solid, start, truth)
        after = pose_difference(solid, baseline.fit(contacts, start).pose, truth)
        assert before.rotation > 0.9 * NEAR
        # Normals of samples by an edge are between those of its faces.
        assert after.rotation < np.radians(1.0)
        assert after.translation < 0.01 * solid.diameter


def test_of_all_starts_the_best_fits_no_worse_than_one_at_the_truth():
    solid, rng = model("l-block"), np.random.default_rng(5)
    baseline = small_gicp_of("l-block")
    truth = random_pose(rng, solid.diameter)
    contacts = exact_contacts("l-block", truth, rng)
    fit = baseline.fit(contacts)
    assert fit.residual <= 1.01 * baseline.fit(contacts, truth).residual
    off = pose_difference(solid, fit.pose, truth)
    assert off.rotation < np.radians(1.0)
    assert off.translation < 0.01 * solid.diameter
    assert baseline.fit(contacts).residual == fit.residual
