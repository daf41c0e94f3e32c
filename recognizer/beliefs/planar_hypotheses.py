"""Hypotheses of the plane: poses that place the object alike are one (memo, end of Section 3)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..models.polygon import Polygon
from ..poses.planar.pose import PlanarPoses
from .hypotheses import Hypothesis, PoseTolerance
from .hypothesis_kernels import group_poses

Floats = NDArray[np.float64]


def cluster_planar(
    polygon: Polygon, poses: PlanarPoses, tolerance: PoseTolerance, position_error: float
) -> tuple[list[Hypothesis], Floats]:
    """Group one outline's poses into hypotheses, as `hypotheses.cluster` does a solid's.

    The weight of a group is the volume of poses it stands for, in three freedoms instead of six.
    Poses are in space, with z = 0 and a rotation about z.

    Args:
        polygon: the outline.
        poses: of its surviving interpretations.
        tolerance: which poses count as the same.
        position_error: the largest bound on a position, metres.

    Returns:
        Hypotheses, whose ``freedoms`` are (d, 3): rotation about the centroid (times half the
        diameter), then shift, in the object's frame; and (h,) the logarithms of their weights, not
        yet normalised.
    """
    if not len(poses):
        return [], np.zeros(0)
    poses = poses.take(np.lexsort((poses.costs, ~poses.proven)))
    radius = polygon.diameter / 2.0
    most_shift = tolerance.distance(polygon.diameter, position_error)
    placed = poses.in_space()
    centres = placed.apply(np.append(polygon.centroid, 0.0))
    symmetries = np.tile(np.eye(3), (len(polygon.symmetries), 1, 1))
    symmetries[:, :2, :2] = polygon.symmetries
    groups = group_poses(
        placed.rotation.as_matrix(), centres, symmetries, tolerance.rotation, most_shift
    )
    leaders = np.unique(groups, return_index=True)[1]
    matrices = placed.as_matrix()
    prior = np.diag([1.0 / (np.pi * radius), 1.0 / radius, 1.0 / radius]) ** 2
    covariances = np.linalg.inv(poses.informations + prior)
    variances, motions = np.linalg.eigh(covariances)
    log_volumes = 0.5 * np.log(variances).sum(axis=1) + np.log(len(symmetries))
    # Three standard deviations of each motion, against what the tolerance allows it: with bounded
    # noise hardly any fit is off by more.
    allowed = min(tolerance.rotation * radius, most_shift)
    hypotheses, log_weights = [], np.empty(len(leaders))
    for group, leader in enumerate(leaders):
        members = np.flatnonzero(groups == group)
        open_motions = 3.0 * np.sqrt(variances[leader]) > allowed
        hypotheses.append(
            Hypothesis(
                object_name=polygon.name,
                T_world_object=matrices[leader],
                weight=1.0,
                interpretations=_distinct(poses.faces[members]),
                freedoms=motions[leader].T[open_motions],
                covariance=covariances[leader].astype(float),
            )
        )
        log_weights[group] = log_volumes[members].max()
    return hypotheses, log_weights


def _distinct(rows: NDArray[np.int32]) -> NDArray[np.int32]:
    """Each row once, in the order of first appearance: one may have two poses in a group."""
    return rows[np.sort(np.unique(rows, axis=0, return_index=True)[1])]
