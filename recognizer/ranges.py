"""Range tables: what two points on two given faces can be to each other (memo, Section 2.1).

Built once a model. For every pair of faces: the distances that points on them can have, the angle
of their normals, the component of the vector between the points along either normal (the memo's
extended direction constraint), and the tilt of that vector against the normal (its simple
direction constraint).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .polyhedron import Polyhedron
from .range_kernels import nearest_distances, tilt_ranges

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

    @property
    def face_count(self) -> int:
        """How many faces the tables are over."""
        return len(self.angle)

    @classmethod
    def of(cls, model: Polyhedron) -> PairTables:
        """Build the tables of a model."""
        order = np.argsort(model.triangle_faces, kind="stable")
        triangles = model.vertices[model.triangles[order]]
        first = np.searchsorted(model.triangle_faces[order], np.arange(model.face_count + 1))
        first = first.astype(np.int64)
        slack = ROUNDING * model.diameter + planarity(model)
        farthest = farthest_distances(model)
        heights_min, heights_max = height_ranges(model)
        tilt_min, tilt_max = tilt_ranges(triangles, first, model.normals, model.offsets)
        return cls(
            distance_min=nearest_distances(triangles, first) - slack,
            distance_max=farthest + slack,
            angle=normal_angles(model.normals),
            component_min=heights_min - slack,
            component_max=heights_max + slack,
            tilt_min=tilt_min - ROUNDING,
            tilt_max=tilt_max + ROUNDING,
        )


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


def farthest_distances(model: Polyhedron) -> Floats:
    """(f, f) largest distance between points of two faces, metres; it is reached at corners."""
    between = np.linalg.norm(model.hulls.corners[:, None] - model.hulls.corners, axis=2)
    first = model.hulls.start[:-1]
    return np.maximum.reduceat(np.maximum.reduceat(between, first, axis=0), first, axis=1)


def height_ranges(model: Polyhedron) -> tuple[Floats, Floats]:
    """(f, f) least and greatest height of face b's points above face a's plane, metres.

    A height is linear in the point, so its extremes over a face, concave or with holes, are at
    corners of its convex hull.
    """
    heights = model.normals @ model.hulls.corners.T - model.offsets[:, None]
    first = model.hulls.start[:-1]
    return (
        np.minimum.reduceat(heights, first, axis=1),
        np.maximum.reduceat(heights, first, axis=1),
    )
