"""Contacts that a block allows in two ways, between which something else has to decide."""

from __future__ import annotations

import numpy as np
import pytest
from oracles.solids import random_pose
from scipy.spatial.transform import RigidTransform

from palpate.recognizer import Belief, Contacts

TIGHT = {"position_error": 2e-4, "normal_error": 0.05}
TURNED = np.diag([-1.0, -1.0, 1.0])
"""Half a turn about the vertical: what the contacts of `two_ways` leave open."""


def two_ways(motion: RigidTransform) -> Contacts:
    """Contacts that the L-block allows in two ways: its notch at one corner or the opposite one."""
    felt = [
        ([0.00, 0.04, 0.01], [-1, 0, 0]),
        ([0.06, 0.01, 0.02], [1, 0, 0]),
        ([0.05, 0.00, 0.01], [0, -1, 0]),
        ([0.01, 0.05, 0.02], [0, 1, 0]),
        ([0.01, 0.04, 0.00], [0, 0, -1]),
        ([0.05, 0.01, 0.00], [0, 0, -1]),
        ([0.01, 0.045, 0.03], [0, 0, 1]),
    ]
    points, normals = (np.array(column, float) for column in zip(*felt, strict=True))
    return Contacts(motion.apply(points), motion.rotation.apply(normals), **TIGHT)


def ways(belief: Belief, motion: RigidTransform) -> list[bool]:
    """Of each hypothesis, whether it is the block as modelled, and not turned."""
    found = []
    for hypothesis in belief.hypotheses:
        turn = (motion.rotation.inv() * hypothesis.pose.rotation).as_matrix()
        assert min(np.abs(turn - np.eye(3)).max(), np.abs(turn - TURNED).max()) < 0.1
        found.append(bool(np.abs(turn - np.eye(3)).max() < 0.1))
    return found


motions = pytest.mark.parametrize(
    "motion",
    [RigidTransform.identity(), random_pose(np.random.default_rng(5))],
    ids=["here", "there"],
)
