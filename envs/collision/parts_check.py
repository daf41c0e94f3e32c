"""How far the union of convex parts strays from the solid that they stand for.

Every part is taken a little smaller and a little larger, about its own middle. If no triangle of
the solid's surface enters a smaller one, they lie in the solid; if the larger ones cover every
triangle, no part is missing. Both are decided by cutting polygons, not by sampling.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from ...assets import ConvexPart
from ...recognizer import Polyhedron
from .convex_cells import Plane, split_polygon
from .winding import winding_numbers

Floats = NDArray[np.float64]
HalfSpaces = tuple[Floats, Floats]
"""(p, 3) outward unit normals and (p,) offsets of the planes around a convex solid."""

LEVELS = tuple(step * 10.0**power for power in range(-9, -5) for step in (1, 2, 5)) + (1e-5,)
"""Distances that are tried, least first, as shares of the diameter. The least is far above
rounding, so that a yes or a no doesn't hang on it."""


def stray(model: Polyhedron, parts: Sequence[ConvexPart]) -> float | None:
    """How far the union of convex parts strays from a solid.

    Within that distance of the solid is every point of a part; within it of a part is every point
    of the solid's surface; and no point of that surface is deeper than it inside a part.

    Args:
        model: the solid.
        parts: convex parts, object frame, metres.

    Returns:
        The least of `LEVELS` for which this is proved, metres; None if there is none, or a part is
        flat.
    """
    middles = np.array([part.vertices.mean(axis=0) for part in parts]).reshape(-1, 3)
    # A part that no surface enters is inside as a whole if one point of it is.
    if not len(parts) or (winding_numbers(model, middles) < 0.5).any():
        return None
    try:
        hulls = [ConvexHull(part.vertices) for part in parts]
    except (QhullError, ValueError):
        return None
    triangles = model.vertices[model.triangles]
    for level in LEVELS:
        distance = level * model.diameter
        if not any(_enters(triangles, _resized(hull, -distance)) for hull in hulls) and _covered(
            triangles, [_resized(hull, distance) for hull in hulls]
        ):
            return distance
    return None


def _resized(hull: ConvexHull, distance: float) -> HalfSpaces:
    """A hull scaled about its middle so that its farthest corner moves by a distance.

    No point of it moves farther, and what is between the two is within the distance of either.
    """
    normals = np.unique(hull.equations[:, :3], axis=0)
    middle = hull.points.mean(axis=0)
    room = ((hull.points - middle) @ normals.T).max(axis=0)
    radius = float(np.linalg.norm(hull.points - middle, axis=1).max())
    return normals, normals @ middle + (1.0 + distance / radius) * room


def _enters(triangles: Floats, solid: HalfSpaces) -> bool:
    """Whether some triangle has a point inside a convex solid."""
    normals, offsets = solid
    heights = triangles @ normals.T - offsets
    return any(
        _inside(triangles[row], solid)
        for row in np.flatnonzero((heights.min(axis=1) < 0.0).all(axis=1))
    )


def _inside(polygon: Floats, solid: HalfSpaces) -> bool:
    """Whether a convex polygon has a point inside a convex solid."""
    left: Floats | None = polygon
    for normal, offset in zip(*solid, strict=True):
        left, _ = split_polygon(left, Plane(normal, float(offset)), 0.0)
        if left is None:
            return False
    return True


def _covered(triangles: Floats, solids: list[HalfSpaces]) -> bool:
    """Whether convex solids together hold every point of every triangle."""
    heights = [triangles @ normals.T - offsets for normals, offsets in solids]
    meets = np.array([(above.min(axis=1) <= 0.0).all(axis=1) for above in heights])
    holds = np.array([(above.max(axis=1) <= 0.0).all(axis=1) for above in heights])
    for row in np.flatnonzero(~holds.any(axis=0)):
        left = [triangles[row]]
        for solid in np.flatnonzero(meets[:, row]):
            left = [part for polygon in left for part in _outside(polygon, solids[solid])]
        if left:
            return False
    return True


def _outside(polygon: Floats, solid: HalfSpaces) -> list[Floats]:
    """Convex polygons that make up what of a convex polygon is outside a convex solid."""
    parts: list[Floats] = []
    left = polygon
    for normal, offset in zip(*solid, strict=True):
        below, above = split_polygon(left, Plane(normal, float(offset)), 0.0)
        if above is not None:
            parts.append(above)
            if below is None:
                return parts
            left = below
    return parts
