"""An outline of the plane in space: an upright prism, whose sides are the outline's edges.

What is felt in the plane is felt at height zero of its sides; what is asked of poses in space is
then asked of those of the plane, with two turns and a shift held at zero.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .features import Features
from .freezing import frozen
from .polygon import Polygon

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Prism:
    """An outline as a prism, to both sides of the plane z = 0; metres."""

    name: str
    diameter: float
    """That of the outline, whatever the prism's height."""
    centroid: Floats
    """(3,)"""
    symmetries: Floats
    """(g, 3, 3) the outline's, about z."""
    vertices: Floats
    """(v, 3)"""
    face_count: int
    """How many sides it has; ends it has none."""

    @classmethod
    def of(cls, outline: Polygon) -> Prism:
        """The prism of an outline."""
        symmetries = np.tile(np.eye(3), (len(outline.symmetries), 1, 1))
        symmetries[:, :2, :2] = outline.symmetries
        return cls(
            outline.name,
            outline.diameter,
            frozen(np.append(outline.centroid, 0.0)),
            frozen(symmetries),
            frozen(_sides(outline).reshape(-1, 3)),
            outline.face_count,
        )


def outline_features(outline: Polygon) -> Features:
    """The edges of an outline, as the sides of its prism."""
    count = outline.face_count
    corners = _sides(outline).reshape(-1, 3)
    normals = np.column_stack([outline.normals, np.zeros(count)])
    return Features(
        normals=normals,
        offsets=outline.offsets.copy(),
        first=np.arange(count, 2 * count + 1),
        start=np.arange(0, 8 * count + 1, 4),
        corners=np.concatenate([corners, corners]),
        cone_start=np.arange(count + 1),
        cone_normals=normals,
        half_angles=np.zeros(count),
        face_count=count,
        edge_count=0,
    )


def _sides(outline: Polygon) -> Floats:
    """(e, 4, 3) corners of each side, counter-clockwise from outside."""
    corners = outline.segments[:, [0, 1, 1, 0]]
    heights = np.array([-0.5, -0.5, 0.5, 0.5]) * outline.diameter
    return np.dstack([corners, np.broadcast_to(heights, corners.shape[:2])])
