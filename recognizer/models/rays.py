"""What a ray meets on a model at a pose: the one predictor of touches."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import RigidTransform

from .polyhedron import Polyhedron
from .ray_kernels import first_hits

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class RayHits:
    """Where rays first meet a model."""

    distances: Floats
    """(r,) metres from the start, infinity for a miss."""
    faces: NDArray[np.int64]
    """(r,) the face met, -1 for a miss."""
    points_world: Floats
    """(r, 3) points met, metres; NaN for a miss."""
    normals_world: Floats
    """(r, 3) outward unit normals of the faces met; NaN for a miss."""

    @property
    def hit(self) -> NDArray[np.bool_]:
        """(r,) whether the ray meets the model at all."""
        return self.faces >= 0


def cast_rays(
    model: Polyhedron, T_world_object: RigidTransform, origins: Floats, directions: Floats
) -> RayHits:
    """Trace rays to the first face of a model they meet.

    Args:
        model: the object.
        T_world_object: its pose, model to world.
        origins: (r, 3) starts, world frame, metres.
        directions: (r, 3) unit directions, world frame.
    """
    T_object_world = T_world_object.inv()
    count = len(origins)
    distances, triangles = np.empty(count), np.empty(count, np.int64)
    first_hits(
        np.ascontiguousarray(T_object_world.apply(origins)),
        np.ascontiguousarray(T_object_world.rotation.apply(directions)),
        model.vertices[model.triangles],
        distances,
        triangles,
    )
    hit = triangles >= 0
    faces = np.where(hit, model.triangle_faces[triangles], -1)
    normals = T_world_object.rotation.apply(model.normals[faces])
    with np.errstate(invalid="ignore"):
        points = np.where(hit[:, None], origins + distances[:, None] * directions, np.nan)
    return RayHits(distances, faces, points, np.where(hit[:, None], normals, np.nan))
