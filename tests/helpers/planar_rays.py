"""Poses and directions in the plane."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation


def random_planar_pose(rng: np.random.Generator, extent: float) -> RigidTransform:
    rotation = Rotation.from_rotvec([0.0, 0.0, rng.uniform(-np.pi, np.pi)])
    return RigidTransform.from_components([*rng.uniform(-extent, extent, 2), 0.0], rotation)


def unit(bearings) -> np.ndarray:
    return np.column_stack([np.cos(bearings), np.sin(bearings)])
