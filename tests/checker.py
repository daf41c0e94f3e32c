"""An independent judge of poses: plain numpy on a model's triangles, none of palpate's kernels.

A pose meets an interpretation if it puts every contact within its bound of the bounded face it is
said to lie on, and every normal within its bound of that face's normal.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import RigidTransform

from palpate.recognizer import Contacts, Polyhedron

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Check:
    """How well a pose meets an interpretation, contact by contact."""

    distances: Floats
    """(n,) distance of each contact from its bounded face, metres."""
    angles: Floats
    """(n,) angle between each measured normal and its face's, radians."""
    within: NDArray[np.bool_]
    """(n,) whether both are within their bounds."""

    @property
    def passed(self) -> bool:
        return bool(self.within.all())


def check(
    model: Polyhedron,
    T_world_object: RigidTransform,
    contacts: Contacts,
    faces: NDArray[np.integer],
    tolerance: float = 1e-6,
) -> Check:
    """Compare contacts with their faces at a pose; ``tolerance`` is a share of each bound."""
    R, t = T_world_object.rotation.as_matrix(), T_world_object.translation
    points = (contacts.positions - t) @ R
    normals = contacts.normals @ R
    distances = np.array(
        [
            triangle_distances(point[None], corners_of(model, int(face))).min()
            for point, face in zip(points, faces, strict=True)
        ]
    )
    angles = angle_between(normals, model.normals[faces])
    within = (distances <= contacts.position_error * (1.0 + tolerance)) & (
        angles <= contacts.normal_error * (1.0 + tolerance)
    )
    return Check(distances, angles, within)


def corners_of(model: Polyhedron, face: int) -> Floats:
    """(t, 3, 3) corners of the triangles of a face."""
    return model.vertices[model.triangles[model.triangle_faces == face]]


def angle_between(a: Floats, b: Floats) -> Floats:
    """Angles between unit vectors (..., 3), radians; accurate near 0 and pi too."""
    return 2.0 * np.arctan2(np.linalg.norm(a - b, axis=-1), np.linalg.norm(a + b, axis=-1))


def triangle_distances(points: Floats, triangles: Floats) -> Floats:
    """Distances of points (..., 3) from solid triangles (..., 3, 3), broadcast."""
    points = points[..., None, :]
    ends = np.roll(triangles, -1, axis=-2)
    edges = ends - triangles
    towards = points - triangles
    lengths = (edges**2).sum(-1)
    shares = (towards * edges).sum(-1) / np.where(lengths > 0.0, lengths, 1.0)
    gaps = towards - np.clip(shares, 0.0, 1.0)[..., None] * edges
    to_edges = np.sqrt((gaps**2).sum(-1)).min(-1)
    normals = np.cross(edges[..., 0, :], edges[..., 1, :])
    doubled = np.linalg.norm(normals, axis=-1)
    normals = normals / np.where(doubled > 0.0, doubled, 1.0)[..., None]
    inwards = np.cross(normals[..., None, :], edges)
    above = ((inwards * towards).sum(-1) >= 0.0).all(-1) & (doubled > 0.0)
    heights = np.abs((towards[..., 0, :] * normals).sum(-1))
    return np.where(above, heights, to_edges)
