"""A solid as the kernels of the predictor cast rays at it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..models.polyhedron import Polyhedron

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]
Rows = NDArray[np.int64]

LARGER = 1e-5
"""By how much the box around a face is larger, as a share of the solid's radius: more than the
slack at its edges."""


@dataclass(frozen=True, eq=False)
class RayTargets:
    """The faces of a solid as convex polygons in the two coordinates that show them widest.

    All but `exact` is about the solid's centroid, in single precision.
    """

    exact: tuple[Floats, Floats]
    """(f, 3) outward unit normals and (f,) ``normal . x`` of each plane, object frame."""
    faces: tuple[Singles, Singles, Rows, Rows, Rows]
    """The same about the centroid; (f, 2) the coordinates that each face is looked at in; (f + 1,)
    its first polygon; (p + 1,) the first edge of each polygon."""
    boxes: Singles
    """(f, 4) the middle and half the sides of the box around each face in these coordinates."""
    edges: Singles
    """(e, 3) ``a, b, c`` of each edge: ``a x + b y + c`` is its distance in these coordinates from
    the box's middle, metres, above zero inside."""
    solid: tuple[Floats, float]
    """(3,) the centroid, object frame, and the radius about it that holds the solid, metres."""

    @classmethod
    def of(cls, model: Polyhedron) -> RayTargets:
        """Of a model."""
        pieces, normals = model.pieces, model.normals
        radius = float(np.linalg.norm(model.vertices - model.centroid, axis=1).max())
        axes = np.sort(np.argsort(np.abs(normals), axis=1)[:, :2], axis=1)
        sizes = np.diff(pieces.start)
        polygons = np.repeat(np.arange(len(sizes)), sizes)
        faces = np.repeat(np.arange(len(normals)), np.diff(pieces.first))[polygons]
        corners = pieces.corners - model.centroid
        flat = np.take_along_axis(corners, axes[faces], axis=1)
        low, high = (
            ufunc.reduceat(flat, pieces.start[pieces.first[:-1]], axis=0)
            for ufunc in (np.minimum, np.maximum)
        )
        middles = 0.5 * (low + high)
        flat = flat - middles[faces]
        rows = np.arange(len(flat))
        after = np.where(rows + 1 == pieces.start[polygons + 1], pieces.start[polygons], rows + 1)
        along = flat[after] - flat
        # Corners go counter-clockwise about the outward normal; seen along -n, or in x and z
        # (whose cross product is -y), clockwise.
        dropped = 3 - axes.sum(axis=1)
        signs = np.sign(normals[np.arange(len(normals)), dropped]) * np.where(dropped == 1, -1, 1)
        inwards = np.stack([-along[:, 1], along[:, 0]], axis=1) * signs[faces, None]
        inwards /= np.linalg.norm(inwards, axis=1, keepdims=True)
        shifts = -(inwards * flat).sum(axis=1)
        offsets = model.offsets - normals @ model.centroid
        halves = 0.5 * (high - low) + LARGER * radius
        return cls(
            (np.ascontiguousarray(normals), model.offsets),
            (_single(normals), _single(offsets), axes, pieces.first, pieces.start),
            _single(np.hstack([middles, halves])),
            _single(np.column_stack([inwards, shifts])),
            (model.centroid, radius),
        )


def _single(numbers: Floats) -> Singles:
    return np.ascontiguousarray(numbers, np.float32)
