"""What rays in the plane meet on an outline: exact, in plain numpy."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import RigidTransform

from ...recognizer import Polygon

Floats = NDArray[np.float64]

SLACK = 1e-12
"""By how much of an edge's length a ray may miss its ends and still meet it, so that none slips
through a corner: less than a thousandth of a nanometre on anything that a hand holds."""


@dataclass(frozen=True, eq=False)
class PlanarHits:
    """Where rays first meet an outline."""

    distances: Floats
    """(r,) metres from the start, infinity for a miss."""
    edges: NDArray[np.int64]
    """(r,) the edge met, -1 for a miss."""
    points_world: Floats
    """(r, 2) points met, metres; NaN for a miss."""
    normals_world: Floats
    """(r, 2) outward unit normals of the edges met; NaN for a miss."""

    @property
    def hit(self) -> NDArray[np.bool_]:
        """(r,) whether the ray meets the outline at all."""
        return self.edges >= 0


def cast_planar_rays(
    outline: Polygon, T_world_object: RigidTransform, origins: Floats, directions: Floats
) -> PlanarHits:
    """Trace rays to the first edge of an outline they meet.

    A ray along an edge meets the edge across its end.

    Args:
        outline: the object.
        T_world_object: its pose, model to world, a motion within the plane ``z = 0``.
        origins: (r, 2) starts, world frame, metres.
        directions: (r, 2) unit directions, world frame.
    """
    rotation = T_world_object.rotation.as_matrix()[:2, :2]
    origins_object = (origins - T_world_object.translation[:2]) @ rotation
    directions_object = directions @ rotation
    first, along = outline.segments[:, 0], outline.segments[:, 1] - outline.segments[:, 0]
    across = first[None] - origins_object[:, None]
    # o + t d = p + s e: Cramer's rule, a ray a row, an edge a column.
    scale = _cross(directions_object[:, None], along[None])
    with np.errstate(divide="ignore", invalid="ignore"):
        depths = _cross(across, along[None]) / scale
        shares = _cross(across, directions_object[:, None]) / scale
        met = (scale != 0.0) & (depths >= 0.0) & (np.abs(shares - 0.5) <= 0.5 + SLACK)
    depths = np.where(met, depths, np.inf)
    nearest = depths.argmin(axis=1)
    distances = depths[np.arange(len(origins)), nearest]
    hit = np.isfinite(distances)[:, None]
    with np.errstate(invalid="ignore"):
        points = np.where(hit, origins + distances[:, None] * directions, np.nan)
    normals = np.where(hit, outline.normals[nearest] @ rotation.T, np.nan)
    return PlanarHits(distances, np.where(hit[:, 0], nearest, -1), points, normals)


def _cross(a: Floats, b: Floats) -> Floats:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
