"""The support plane: what the object lies on, or at least doesn't reach through."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from ..models.faces import convex_hull_in_plane
from ..models.polyhedron import Polyhedron
from .contacts import Contacts

Floats = NDArray[np.float64]

COPLANAR = 1e-6
"""How far off a plane, as a share of the diameter, corners count as on it: rounding of meshes."""

MOST_TILT = 0.5
"""Sine of the tilt of a face's plane against the support; above it, standing says too little."""

FOOTING = 16.0
"""Half a side of the squares that stand for planes of support, in diameters."""


@dataclass(frozen=True, kw_only=True)
class SupportPlane:
    """A plane that the object does not reach below, as far as ``error`` goes.

    ``resting`` adds that it stands on it under gravity along the plane's normal: all corners of a
    stable face of its convex hull are within ``error`` of the plane. A face is stable if the
    centre of the volume is above it (uniform density).
    """

    height: float = 0.0
    """``normal . x`` of the points on it, metres."""
    error: float
    """How far a corner may be below it or, of the face it stands on, off it, metres."""
    normal: tuple[float, float, float] = (0.0, 0.0, 1.0)
    """Unit, world frame, towards the object."""
    resting: bool = False

    def __post_init__(self) -> None:
        if not np.isfinite(self.height):
            raise ValueError(f"height is {self.height}; it must be finite")
        if not (np.isfinite(self.error) and self.error > 0.0):
            raise ValueError(f"error is {self.error}; it must be above zero")
        length = float(np.linalg.norm(self.normal))
        if len(self.normal) != 3 or not abs(length - 1.0) < 1e-3:
            raise ValueError(f"normal is {self.normal}; it must be three numbers, of length 1")

    @property
    def up(self) -> Floats:
        """(3,) `normal`, of length 1 to rounding."""
        return np.array(self.normal) / np.linalg.norm(self.normal)

    def touch(
        self, face: StableFace, diameter: float, contacts: Contacts, outliers: int
    ) -> Contacts | None:
        """The support as a contact on the plane of a face that the object stands on.

        All corners of the face are within ``error`` of the support, so its plane tilts by no more
        than twice that over its width, and farther out it is off by no more than the tilt makes of
        the way there.

        Args:
            face: of the object's hull.
            diameter: the object's, metres.
            contacts: what was felt of the object.
            outliers: how many of these, at most, are not on it.

        Returns:
            One contact; None if the bounds are so wide that it would say nothing.
        """
        largest = float(contacts.position_error.max())
        sine = 2.0 * self.error / face.width
        if sine > MOST_TILT or largest > diameter or 2 * outliers >= len(contacts):
            return None
        if outliers:
            # Each coordinate of the median is between those of contacts that are on the object.
            over = np.median(contacts.positions, axis=0)
            away = np.sqrt(3.0) * (diameter + 2.0 * largest)
        else:
            over = contacts.positions.mean(axis=0)
            away = 0.0
        # From the face to a contact of the object, and from that to this place.
        away += diameter + largest
        foot = over + (self.height - over @ self.up) * self.up
        return Contacts(
            foot[None],
            -self.up[None],
            position_error=self.error + sine * away,
            normal_error=float(np.arcsin(sine)),
        )


@dataclass(frozen=True, eq=False)
class StableFace:
    """A face of a convex hull that the solid can stand on."""

    normal: Floats
    """(3,) outward, object frame."""
    offset: float
    """``normal . x`` of its plane."""
    corners: Floats
    """(k, 3) its corners, object frame, metres."""
    width: float
    """The least distance of two parallel lines in its plane that hold it, metres."""


def hull_corners(model: Polyhedron) -> Floats:
    """(v, 3) the corners of a solid's convex hull, object frame, metres."""
    return np.ascontiguousarray(model.vertices[np.sort(ConvexHull(model.vertices).vertices)])


def stable_faces(model: Polyhedron) -> list[StableFace]:
    """The faces of a solid's convex hull that it can stand on."""
    corners = hull_corners(model)
    slack = COPLANAR * model.diameter
    faces: list[StableFace] = []
    for plane in ConvexHull(model.vertices).equations:
        normal = plane[:3] / np.linalg.norm(plane[:3])
        along = corners @ normal
        offset = float(along.max())
        if any(normal @ known.normal > 1.0 - 1e-9 for known in faces):
            continue
        outline = convex_hull_in_plane(corners[along > offset - slack], normal)
        if len(outline) < 3:
            continue
        edges = np.roll(outline, -1, axis=0) - outline
        inwards = np.cross(normal, edges)
        inwards /= np.linalg.norm(inwards, axis=1, keepdims=True)
        # Less the slack on both sides of it: the width bounds how far the face may tilt.
        heights = (outline[None] - outline[:, None]) @ inwards[:, :, None]
        width = float(heights[..., 0].max(axis=1).min()) - 2.0 * slack
        standing = ((model.centroid - outline) * inwards).sum(axis=1) >= -slack
        if standing.all() and width > 0.0:
            faces.append(StableFace(normal, offset, outline, width))
    return faces
