"""Convex hulls with one plane a facet and true corners only."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from ...assets import ConvexPart

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Hull:
    """A convex solid: its corners and the planes of its facets."""

    corners: Floats
    """(n, 3) metres."""
    triangles: NDArray[np.int64]
    """(m, 3) indices of corners, counter-clockwise seen from outside."""
    normals: Floats
    """(p, 3) outward unit normals."""
    offsets: Floats
    """(p,) ``normal . x`` on each plane, metres."""
    volume: float
    """Cubic metres."""
    area: float
    """Square metres."""

    @classmethod
    def around(cls, points: Floats, slack: float) -> Hull | None:
        """The convex hull of points; None if it is no thicker than ``slack``.

        Args:
            points: (n, 3) metres.
            slack: points so near each other are one, and facets so near each other's plane, metres.
        """
        points = _apart(points, slack)
        hull = _qhull(points)
        if hull is None or hull.volume <= slack * hull.area:
            return None
        planes = _facet_planes(hull, slack)
        # Three planes meet in a corner; where a cut met a facet or an edge there are fewer.
        touching = np.abs(points @ planes[:, :3].T + planes[:, 3]) <= slack
        corners = np.sort(hull.vertices[touching[hull.vertices].sum(axis=1) >= 3])
        sharp = _qhull(points[corners])
        if sharp is None or sharp.volume < hull.volume - slack * hull.area:
            sharp = hull
        return cls._of(sharp, slack)

    @classmethod
    def _of(cls, hull: ConvexHull, slack: float) -> Hull:
        kept = np.sort(hull.vertices)
        corners = np.ascontiguousarray(hull.points[kept])
        triangles = np.searchsorted(kept, hull.simplices).astype(np.int64)
        sides = corners[triangles]
        turned = np.cross(sides[:, 1] - sides[:, 0], sides[:, 2] - sides[:, 0])
        back = (turned * hull.equations[:, :3]).sum(axis=1) < 0.0
        triangles[back] = triangles[back][:, ::-1]
        planes = _facet_planes(hull, slack)
        return cls(
            corners=corners,
            triangles=triangles,
            normals=np.ascontiguousarray(planes[:, :3]),
            offsets=-planes[:, 3],
            volume=float(hull.volume),
            area=float(hull.area),
        )

    @property
    def part(self) -> ConvexPart:
        """The same as vertices and triangles."""
        return ConvexPart(self.corners, self.triangles)

    def heights(self, points: Floats) -> Floats:
        """(n, p) how far points are above each of its planes, metres."""
        return points @ self.normals.T - self.offsets


def _apart(points: Floats, slack: float) -> Floats:
    """Those points that are not within ``slack`` of an earlier one."""
    kept: list[Floats] = []
    for point in points:
        if not kept or np.abs(np.array(kept) - point).max(axis=1).min() > slack:
            kept.append(point)
    return np.array(kept)


def _qhull(points: Floats) -> ConvexHull | None:
    """The hull of points; None if they are in one plane or too few."""
    try:
        return ConvexHull(points)
    except (QhullError, ValueError):
        return None


def _facet_planes(hull: ConvexHull, slack: float) -> Floats:
    """(p, 4) normal and negative offset of each facet, the largest first.

    A triangle is of a facet already there if its corners are within ``slack`` of that one's plane.
    """
    corners = hull.points[hull.simplices]
    crosses = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    kept: list[Floats] = []
    for row in np.argsort(-np.linalg.norm(crosses, axis=1), kind="stable"):
        plane = hull.equations[row]
        known = np.array(kept).reshape(-1, 4)
        off = np.abs(corners[row] @ known[:, :3].T + known[:, 3]).max(axis=0)
        if not ((off <= slack) & (known[:, :3] @ plane[:3] > 0.0)).any():
            kept.append(plane)
    return np.array(kept)
