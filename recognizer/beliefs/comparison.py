"""How far two poses of an object are apart, up to its symmetries: the one measure of pose error."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from ..models.polyhedron import Polyhedron


@dataclass(frozen=True)
class PoseDifference:
    """The difference of two poses."""

    rotation: float
    """Angle of the rotation between them, radians, the least over the object's symmetries."""
    translation: float
    """Distance of the object's centroids, metres; symmetries leave it alone."""


def pose_difference(
    model: Polyhedron, one: RigidTransform, other: RigidTransform
) -> PoseDifference:
    """Compare two poses, model to world, of an object."""
    between = one.rotation.inv() * other.rotation
    turns = (between * Rotation.from_matrix(model.symmetries)).magnitude()
    apart = one.apply(model.centroid) - other.apply(model.centroid)
    return PoseDifference(float(turns.min()), float(np.linalg.norm(apart)))
