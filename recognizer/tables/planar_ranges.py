"""Range tables of the plane: what two points on two given edges can be to each other.

The memo's Section 2.1 for three degrees of freedom: angles from one edge's normal to another's, or
to a direction, have a sign here, so that an outline and its mirror image differ.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

from ..models.features import Features
from ..models.planar_kernels import segment_distances
from ..models.polygon import Polygon
from .planar_range_kernels import tilt_ranges
from .ranges import ROUNDING, PairTables

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PlanarTables:
    """What the tree knows of an outline: ranges over all pairs of its edges, (e, e) each.

    Entries are outer bounds: no two points of the edges lie outside them.
    """

    distance_min: Floats
    """Smallest distance between a point of edge a and a point of edge b, metres; exact."""
    distance_max: Floats
    """Largest such distance, metres; exact."""
    angle: Floats
    """Angle from a's outward normal counter-clockwise to b's, radians in [-pi, pi]."""
    component_min: Floats
    """Smallest component of the vector from a to b along a's normal, metres; exact."""
    component_max: Floats
    """Largest such component, metres; exact."""
    tilt_min: Floats
    """Angle from a's normal counter-clockwise to the first direction from a to b, radians; exact
    but from an edge to itself, where it is -pi: any."""
    tilt_max: Floats
    """The same to the last direction, from `tilt_min` on counter-clockwise; not above it by pi, but
    from an edge to itself."""

    @property
    def face_count(self) -> int:
        """How many edges the tables are over."""
        return len(self.angle)

    @classmethod
    def of(cls, polygon: Polygon) -> PlanarTables:
        """Build the tables of an outline."""
        segments, normals = polygon.segments, polygon.normals
        slack = ROUNDING * polygon.diameter
        # Distances and heights are convex in the points: their largest are at corners.
        farthest = cdist(polygon.corners, polygon.corners)
        for axis in (0, 1):
            farthest = np.maximum(farthest, np.roll(farthest, -1, axis=axis))
        heights = normals @ polygon.corners.T - polygon.offsets[:, None]
        ahead = np.roll(heights, -1, axis=1)
        tilt_min, tilt_max = tilt_ranges(segments, normals)
        return cls(
            distance_min=segment_distances(segments) - slack,
            distance_max=farthest + slack,
            angle=_turns(normals),
            component_min=np.minimum(heights, ahead) - slack,
            component_max=np.maximum(heights, ahead) + slack,
            tilt_min=tilt_min - ROUNDING,
            tilt_max=tilt_max + ROUNDING,
        )

    def in_space(self, features: Features) -> PairTables:
        """The same of the prism's sides, with angles that have no sign.

        Args:
            features: of the prism, see `models.prism.outline_features`.
        """
        nearest, farthest = _unsigned(self.tilt_min, self.tilt_max)
        return PairTables(
            distance_min=self.distance_min,
            distance_max=self.distance_max,
            angle=np.abs(self.angle),
            component_min=self.component_min,
            component_max=self.component_max,
            tilt_min=nearest,
            tilt_max=farthest,
            half_angles=features.half_angles,
            normals=features.normals,
            hull_corners=features.corners[: features.start[len(features)]],
            hull_start=features.start[: len(features) + 1],
        )


def _unsigned(first: Floats, last: Floats) -> tuple[Floats, Floats]:
    """The least and the largest angle, without its sign, from one angle on to another."""
    ends = np.abs(np.array([_wrapped(first), _wrapped(last)]))
    turn = 2.0 * np.pi
    ahead = np.floor(last / turn) >= first / turn
    behind = np.floor((last - np.pi) / turn) >= (first - np.pi) / turn
    return np.where(ahead, 0.0, ends.min(axis=0)), np.where(behind, np.pi, ends.max(axis=0))


def _wrapped(angles: Floats) -> Floats:
    """The same angles from -pi to pi."""
    return np.mod(angles + np.pi, 2.0 * np.pi) - np.pi


def _turns(normals: Floats) -> Floats:
    """(e, e) angles from each normal counter-clockwise to each other one, radians."""
    x, y = normals.T
    return np.arctan2(x[:, None] * y - y[:, None] * x, normals @ normals.T)
