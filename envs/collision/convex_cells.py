"""Convex polygons and cells, and how a plane cuts them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...recognizer.models.faces import convex_hull_in_plane

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Plane:
    """The points with ``normal . x = offset``."""

    normal: Floats
    """(3,) unit."""
    offset: float
    """Metres."""

    def heights(self, points: Floats) -> Floats:
        """(n,) how far points are above it, metres."""
        return points @ self.normal - self.offset


def split_polygon(
    polygon: Floats, plane: Plane, slack: float
) -> tuple[Floats | None, Floats | None]:
    """The parts of a convex polygon below and above a plane.

    Corners within ``slack`` of the plane count as on it; what lies in the plane is in no part.

    Args:
        polygon: (k, 3) corners in order, metres; two of them are a segment.
        plane: where to cut.
        slack: metres.

    Returns:
        (k, 3) corners of the part below and of the part above; None where there is none.
    """
    heights = plane.heights(polygon)
    below, above = heights < -slack, heights > slack
    if not above.any():
        return (polygon, None) if below.any() else (None, None)
    if not below.any():
        return None, polygon
    lower: list[Floats] = []
    upper: list[Floats] = []
    sides = 1 if len(polygon) == 2 else len(polygon)
    for here in range(len(polygon)):
        if not above[here]:
            lower.append(polygon[here])
        if not below[here]:
            upper.append(polygon[here])
        after = (here + 1) % len(polygon)
        if here < sides and below[here] != below[after] and above[here] != above[after]:
            share = heights[here] / (heights[here] - heights[after])
            crossing = polygon[here] + share * (polygon[after] - polygon[here])
            lower.append(crossing)
            upper.append(crossing)
    return np.array(lower), np.array(upper)


@dataclass(frozen=True, eq=False)
class Cell:
    """A convex solid as the polygons around it."""

    facets: tuple[Floats, ...]
    """(k, 3) corners of each, in order, metres."""

    @classmethod
    def box(cls, low: Floats, high: Floats) -> Cell:
        """The box between two corners."""
        facets = []
        for axis in range(3):
            u, v = (axis + 1) % 3, (axis + 2) % 3
            for end in (low, high):
                facet = np.empty((4, 3))
                facet[:, axis] = end[axis]
                facet[:, u] = low[u], high[u], high[u], low[u]
                facet[:, v] = low[v], low[v], high[v], high[v]
                facets.append(facet)
        return cls(tuple(facets))

    @property
    def corners(self) -> Floats:
        """(n, 3) metres; each corner as often as there are facets at it."""
        return np.concatenate(self.facets)

    def split(self, plane: Plane, slack: float) -> tuple[Cell | None, Cell | None]:
        """The parts below and above a plane; None for one that would be thinner than ``slack``."""
        heights = plane.heights(self.corners)
        if heights.max() <= slack:
            return self, None
        if heights.min() >= -slack:
            return None, self
        halves = [split_polygon(facet, plane, slack) for facet in self.facets]
        lower = [below for below, _ in halves if below is not None]
        upper = [above for _, above in halves if above is not None]
        rim = np.concatenate(lower + upper)
        rim = rim[np.abs(plane.heights(rim)) <= slack]
        if not len(rim) or np.ptp(rim, axis=0).max() <= slack:
            # A needle, cut where it has no width: it stays whole.
            return (self, None) if heights.mean() < 0.0 else (None, self)
        cap = convex_hull_in_plane(rim, plane.normal)
        return Cell((*lower, cap)), Cell((*upper, cap))
