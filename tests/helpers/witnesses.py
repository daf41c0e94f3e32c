"""The poses that a model test finds, and where they are beside the true ones."""

from __future__ import annotations

import numpy as np
from oracles import solids as oracles
from scipy.spatial.transform import RigidTransform, Rotation

from palpate.recognizer import Polyhedron
from palpate.recognizer.poses.fits.pose import Poses

BAR = Polyhedron.from_mesh(oracles.box(0.3, 0.02, 0.015), name="bar")
"""Long: nothing but the ends of its flanks says where along it a contact is."""
FLANKS = np.flatnonzero(np.abs(BAR.normals[:, 0]) < 0.5).tolist()


def witness_of(poses: Poses, row: int) -> RigidTransform:
    return RigidTransform.from_components(
        poses.translations[row], Rotation.from_matrix(poses.rotations[row])
    )


def centroid_and_turn_errors(
    model: Polyhedron, pose: RigidTransform, truth: RigidTransform
) -> tuple[float, float]:
    shift = np.linalg.norm(pose.apply(model.centroid) - truth.apply(model.centroid))
    return float(shift), float((pose.rotation.inv() * truth.rotation).magnitude())


def face_with_normal(model: Polyhedron, direction: tuple[float, float, float], nth: int = 0) -> int:
    return int(np.flatnonzero(model.normals @ direction > 0.999)[nth])
