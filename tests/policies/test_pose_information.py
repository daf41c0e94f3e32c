"""What contacts tell of a pose: rows of the Jacobian, and the probe that adds most."""

from __future__ import annotations

import numpy as np
from helpers.bar import (
    BAR,
    CONE,
    MM,
    REACH,
    SPACE,
    contacts_on_the_bar,
    observation_of,
    pose_at,
    task_for,
)
from helpers.pose_samples import samples_at
from scipy.spatial.transform import Rotation

from palpate.policies import make_policy
from palpate.policies.outcomes.pose_information import (
    PlacedModel,
    gain,
    gain_to_tolerance,
    known,
    rows_of,
)
from palpate.recognizer.models.rays import cast_rays


def test_rows_of_the_jacobian_are_slopes_of_heights():
    """The height of a world point over a face that moves with the object, by differences."""
    rng = np.random.default_rng(6)
    pose = pose_at(25.0, 4e-3, -2e-3, 1e-3)
    model = PlacedModel.of(samples_at((BAR,), [pose]), 0)
    point, normal, step = rng.normal(0.0, 0.02, 3), np.array([0.6, 0.0, 0.8]), 1e-5
    row = rows_of(model, point, normal)
    slopes = []
    for motion in np.eye(6):
        ends = []
        for sign in (1.0, -1.0):
            turn = Rotation.from_rotvec(sign * step * motion[:3] / model.radius)
            moved = turn.apply(point - model.centre) + model.centre + sign * step * motion[3:]
            ends.append(moved @ normal)
        slopes.append((ends[0] - ends[1]) / (2.0 * step))
    np.testing.assert_allclose(row, slopes, atol=1e-6)


def test_what_is_known_already_is_worth_nothing_down_to_the_tolerance():
    before = np.diag([1e4, 1e4, 1e4, 1e8, 1e8, 1e8])
    rough, fine = np.zeros((6, 6)), np.zeros((6, 6))
    rough[0, 0], fine[5, 5] = 1e4, 1e8
    added = np.stack([rough, fine])
    np.testing.assert_allclose(gain(before, added), np.log(2.0), rtol=1e-9)
    told = gain_to_tolerance(before, added, 1e-3)
    # By hand: variances 1e-4 to 5e-5, and 1e-8 to 5e-9, each with 1e-6 beside it.
    expected = 0.5 * np.log([1.01e-4 / 5.1e-5, 1.01e-6 / 1.005e-6])
    np.testing.assert_allclose(told, expected, rtol=1e-6)


def test_contacts_are_counted_on_the_faces_they_were_felt_on():
    """Three contacts on each side of the bar: all is known but the shift along it."""
    pose = pose_at(0.0)
    model = PlacedModel.of(samples_at((BAR,), [pose]), 0)
    rng = np.random.default_rng(3)
    points, normals = [], []
    for axis, height in ((1, 10 * MM), (1, -10 * MM), (2, 12 * MM)):
        for _ in range(3):
            point = rng.uniform(-9 * MM, 9 * MM, 3)
            point[axis] = height
            normal = np.sign(height) * np.eye(3)[axis]
            points.append(point + rng.uniform(-0.3, 0.3, 3) * REACH)
            normals.append(Rotation.from_rotvec(rng.normal(0.0, 0.1, 3)).apply(normal))
    observation = observation_of(samples_at((BAR,), [pose]), (np.array(points), np.array(normals)))
    deviations = np.sqrt(np.diag(np.linalg.inv(known(observation, model))))
    assert deviations[3] > 0.3 * model.radius
    assert (deviations[4:] < REACH).all()


def test_refine_sends_the_candidate_with_the_largest_determinant():
    """No other probe of a thousand is better by more than a little."""
    pose = pose_at(15.0, 2e-3)
    samples = samples_at((BAR,), [pose])
    contacts = contacts_on_the_bar(np.random.default_rng(2), 5)
    observation = observation_of(samples, contacts)
    action = make_policy("refine", task_for()).act(observation, np.random.default_rng(0))
    model = PlacedModel.of(samples, 0)
    before = known(observation, model)

    def worth(probe) -> float:
        rays = SPACE.rays(np.asarray(probe, float)[None])
        hits = cast_rays(BAR, pose, rays.starts_world[0], rays.directions_world[0])
        total = before.copy()
        for point, normal in zip(hits.points_world, hits.normals_world, strict=True):
            if not point[2] > 0.0:
                continue
            row = np.append(np.cross(point - model.centre, normal) / model.radius, normal)
            total += 5.0 / REACH**2 * np.outer(row, row)
            tilt = (2.0 * np.sin(0.5 * CONE) * model.radius) ** 2
            total[:3, :3] += 4.0 / tilt * (np.eye(3) - np.outer(normal, normal))
        return float(np.linalg.slogdet(total)[1])

    others = [worth(probe) for probe in np.random.default_rng(5).uniform(-1, 1, (1000, 3))]
    assert worth(action) > max(others) - 0.6
    assert worth(action) > np.median(others) + 1.0
