"""Range tables: what two points on two given features can be to each other (memo, Section 2.1).

Built once a model. For every pair of faces: the distances that points on them can have, the angle
of their normals, the component of the vector between the points along either normal (the memo's
extended direction constraint), and the tilt of that vector against the normal (its simple
direction constraint).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..models.features import Features, face_features
from ..models.polyhedron import Polyhedron
from .range_kernels import nearest_distances, tilt_ranges
from .triples import TripleTables

ROUNDING = 1e-9
"""Every range is widened by this share of the diameter (or this angle, radians): far above what
double precision loses in building it, far below any bound on a touch. Lengths are widened by the
mesh's own rounding too, see `planarity`."""

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PairTables:
    """What the tree knows of a model: ranges over all pairs of its faces, (f, f) each.

    Entries are outer bounds: no two points of the faces lie outside them.
    """

    distance_min: Floats
    """Smallest distance between a point of face a and a point of face b, metres; exact."""
    distance_max: Floats
    """Largest such distance, metres; exact."""
    angle: Floats
    """Angle between the two outward normals, radians."""
    component_min: Floats
    """Smallest component of the vector from a to b along a's normal, metres; exact."""
    component_max: Floats
    """Largest such component, metres; exact."""
    tilt_min: Floats
    """Smallest angle between a's normal and a direction from a to b, radians."""
    tilt_max: Floats
    """Largest such angle, radians."""
    half_angles: Floats
    """(f,) how far a feature's normals may lean from the one that the tables are about, radians:
    0 for a face."""
    normals: Floats
    """(f, 3) the outward unit normals that the tables are about, object frame."""
    hull_corners: Floats
    """(c, 3) corners of the convex hulls of all features, object frame, metres."""
    hull_start: NDArray[np.int64]
    """(f + 1,) the first corner of each feature's hull."""

    @property
    def face_count(self) -> int:
        """How many faces the tables are over."""
        return len(self.angle)

    @cached_property
    def triples(self) -> TripleTables:
        """Ranges over three faces, built when first asked for."""
        return TripleTables(
            normals=self.normals,
            hull_corners=self.hull_corners,
            hull_start=self.hull_start,
            distances=(self.distance_min, self.distance_max),
            tilts=(self.tilt_min, self.tilt_max),
        )

    @classmethod
    def of(cls, model: Polyhedron, features: Features | None = None) -> PairTables:
        """Build the tables of a model, over its faces or over other features of it."""
        features = features or face_features(model)
        order = np.argsort(model.triangle_faces, kind="stable")
        triangles = model.vertices[model.triangles[order]]
        first = np.searchsorted(model.triangle_faces[order], np.arange(model.face_count + 1))
        first = first.astype(np.int64)
        slack = ROUNDING * model.diameter + planarity(model)
        farthest = farthest_distances(features)
        heights_min, heights_max = height_ranges(features)
        nearest = nearest_distances(triangles, first)
        tilts = tilt_ranges(triangles, first, model.normals, model.offsets)
        return cls(
            distance_min=_over_features(nearest, features, 0.0) - slack,
            distance_max=farthest + slack,
            angle=normal_angles(features.normals),
            component_min=heights_min - slack,
            component_max=heights_max + slack,
            tilt_min=_over_features(tilts[0], features, 0.0) - ROUNDING,
            tilt_max=_over_features(tilts[1], features, np.pi) + ROUNDING,
            half_angles=features.half_angles,
            normals=features.normals,
            hull_corners=features.corners[: features.start[len(features)]],
            hull_start=features.start[: len(features) + 1],
        )


def _over_features(table: Floats, features: Features, widest: float) -> Floats:
    """A table over faces, with what is always true where an edge or a vertex is involved."""
    if len(features) == len(table):
        return table
    wide = np.full((len(features), len(features)), widest)
    wide[: len(table), : len(table)] = table
    return wide


def planarity(model: Polyhedron) -> float:
    """How far corners lie off their faces' planes at most, metres: coordinates are rounded."""
    faces = np.repeat(np.arange(model.face_count), np.diff(model.hulls.start))
    heights = (model.hulls.corners * model.normals[faces]).sum(axis=1) - model.offsets[faces]
    return float(np.abs(heights).max())


def normal_angles(normals: Floats) -> Floats:
    """(f, f) angles between unit normals (f, 3), radians; accurate near 0 and pi too."""
    apart = np.linalg.norm(normals[:, None] - normals, axis=2)
    together = np.linalg.norm(normals[:, None] + normals, axis=2)
    return 2.0 * np.arctan2(apart, together)


def farthest_distances(features: Features) -> Floats:
    """(f, f) largest distance between points of two features, metres; it is reached at corners."""
    corners, first = _hull_corners(features)
    between = np.linalg.norm(corners[:, None] - corners, axis=2)
    return np.maximum.reduceat(np.maximum.reduceat(between, first, axis=0), first, axis=1)


def height_ranges(features: Features) -> tuple[Floats, Floats]:
    """(f, f) least and greatest component of the vector from a to b along a's normal, metres.

    It is linear in both points, so its extremes over two features, concave faces or faces with
    holes too, are at corners of their convex hulls; on a face, a's end of it is constant.
    """
    corners, first = _hull_corners(features)
    heights = features.normals @ corners.T
    owner = np.repeat(np.arange(len(features)), np.diff([*first, len(corners)]))
    own = heights[owner, np.arange(len(corners))]
    # A face's own corners are on its plane up to rounding, which `planarity` accounts for.
    face = np.arange(len(features)) < features.face_count
    highest = np.where(face, features.offsets, np.maximum.reduceat(own, first))
    lowest = np.where(face, features.offsets, np.minimum.reduceat(own, first))
    return (
        np.minimum.reduceat(heights, first, axis=1) - highest[:, None],
        np.maximum.reduceat(heights, first, axis=1) - lowest[:, None],
    )


def _hull_corners(features: Features) -> tuple[Floats, NDArray[np.int64]]:
    start = features.start[: len(features) + 1]
    return features.corners[: start[-1]], start[:-1]


def pack_tables(tables: PairTables) -> Floats:
    """The tables as `mask_kernels` reads them: all rows about one feature side by side.

    Returns:
        (f, `mask_kernels.COLUMNS`, f): distances, angles widened by both features' cones,
        components along the row's normal and along the column's, tilts, the columns' half-angles.
        Along the varying normal of an edge or a vertex any component is allowed.
    """
    half = tables.half_angles
    fixed = half == 0.0
    columns = (
        tables.distance_min,
        tables.distance_max,
        tables.angle - half[:, None] - half,
        tables.angle + half[:, None] + half,
        tables.component_min,
        tables.component_max,
        np.where(fixed, tables.component_min.T, -np.inf),
        np.where(fixed, tables.component_max.T, np.inf),
        tables.tilt_min,
        tables.tilt_max,
        np.broadcast_to(half, tables.angle.shape),
    )
    return np.ascontiguousarray(np.stack(columns, axis=1))
