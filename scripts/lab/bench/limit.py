"""How far off a pose must be: the error that no estimator gets below, found by sampling.

Noise is uniform in its bounds, so given the faces every pose has a known density: a contact at
distance ``d`` from its face's plane can have come from a disc of area ``pi (b^2 - d^2)`` of it, and
its normal must be within its cone. The mean of poses drawn from that density has the least squared
error of all estimators. It is given the true faces, and starts at the true pose.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.spatial.transform import RigidTransform, Rotation

from .report import Case

Floats = NDArray[np.float64]

DRAWS = 50_000
BURN_IN = 10_000
STEP = 0.6
"""Of a step, as a share of the spread of poses by least squares; two in five are then taken."""


def mean_pose(case: Case, seed: int = 0) -> RigidTransform:
    """The mean of the poses that a case's contacts allow, the faces known; model to world."""
    model, truth, felt = case.model, case.truth, case.contacts
    pose, normals = truth.T_world_object, model.normals[truth.faces]
    radius = model.diameter / 2.0
    arms = (pose.inv().apply(np.array(felt.positions)) - model.centroid) / radius
    rows = np.concatenate([np.cross(arms, normals), normals], axis=1)
    # Variances of one axis of a vector uniform in a ball, and of a direction in a small cone.
    information = 5.0 * (rows / felt.position_error[:, None] ** 2).T @ rows
    across = np.eye(3) - normals[:, :, None] * normals[:, None]
    cones = 4.0 / (felt.normal_error * radius) ** 2
    information[:3, :3] += (cones[:, None, None] * across).sum(axis=0)
    turn, centre = _chain(
        pose.rotation.as_matrix(),
        np.array(pose.apply(model.centroid)),
        np.array(felt.positions),
        np.array(felt.normals),
        normals,
        model.offsets[truth.faces] - normals @ model.centroid,
        np.array(felt.position_error),
        np.cos(felt.normal_error),
        STEP * np.linalg.cholesky(np.linalg.inv(information)).astype(float),
        radius,
        DRAWS,
        np.random.default_rng(seed),
    )
    rotation = Rotation.from_matrix(turn)
    return RigidTransform.from_components(centre - rotation.apply(model.centroid.copy()), rotation)


@njit(cache=True)
def _log_density(
    turn: Floats,
    centre: Floats,
    points: Floats,
    felt: Floats,
    normals: Floats,
    offsets: Floats,
    bounds: Floats,
    cosines: Floats,
) -> float:
    total = 0.0
    for i in range(len(points)):
        height, cosine = -offsets[i], 0.0
        for m in range(3):
            normal = turn[m, 0] * normals[i, 0]
            normal += turn[m, 1] * normals[i, 1] + turn[m, 2] * normals[i, 2]
            height += normal * (points[i, m] - centre[m])
            cosine += normal * felt[i, m]
        share = 1.0 - (height / bounds[i]) ** 2
        if share <= 0.0 or cosine < cosines[i]:
            return -np.inf
        total += np.log(share)
    return total


@njit(cache=True)
def _chain(
    turn: Floats,
    centre: Floats,
    points: Floats,
    felt: Floats,
    normals: Floats,
    offsets: Floats,
    bounds: Floats,
    cosines: Floats,
    spread: Floats,
    radius: float,
    draws: int,
    rng: np.random.Generator,
) -> tuple[Floats, Floats]:
    """Metropolis's walk: the mean rotation, not yet a rotation, and the mean centroid."""
    now = _log_density(turn, centre, points, felt, normals, offsets, bounds, cosines)
    turns, centres, cross = np.zeros((3, 3)), np.zeros(3), np.zeros((3, 3))
    for draw in range(draws):
        step = spread @ rng.standard_normal(6)
        w = step[:3] / radius
        angle = np.sqrt((w**2).sum()) + 1e-300
        cross[0, 1], cross[0, 2], cross[1, 2] = -w[2], w[1], -w[0]
        cross[1, 0], cross[2, 0], cross[2, 1] = w[2], -w[1], w[0]
        small = np.eye(3) + np.sin(angle) / angle * cross
        small += (1.0 - np.cos(angle)) / angle**2 * (cross @ cross)
        new_turn, new_centre = turn @ small, centre + turn @ step[3:]
        new = _log_density(new_turn, new_centre, points, felt, normals, offsets, bounds, cosines)
        if np.log(rng.random()) < new - now:
            turn, centre, now = new_turn, new_centre, new
        if draw >= BURN_IN:
            turns += turn
            centres += centre
    count = draws - BURN_IN
    return turns / count, centres / count
