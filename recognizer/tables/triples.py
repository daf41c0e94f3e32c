"""Constraints on triples: what the triangle of three points on given faces can be (Section 2.1).

The memo's alternative form of the direction constraint, useful when no normals are known: each
angle of the triangle of three contacts must be one that points of their faces can form. And one it
names in passing: so must its area. Where the memo combines two cones of directions we add what the
tables of tilts say about them, and bounds from the corners of the faces (`triple_range_kernels`):
two faces that touch have no cone narrower than a half-space.

All ranges are outer bounds over the faces' convex hulls, which hold concave faces and holes too.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

from ..contacts.contacts import Contacts
from . import triple_kernels
from .triple_range_kernels import CORNER_TERMS, DUST, direction_cones, triple_range

SLACK = 1e-8
"""Every contact's bound is widened by this share of the diameter, and by what the pair tables are
widened by. It makes up for `DUST`: rounding turns a leg as if its end were off by far less."""
MOST_CORNERS = 12
"""Hulls of more corners are replaced by a polygon around them; the work grows with the cube."""
FIRST_SLOTS, MOST_SLOTS = 1 << 12, 1 << 21
"""Room for ranges that are remembered; half of it is used, and then all is forgotten."""

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class TriangleRanges:
    """What the triangles of points on three faces can be: outer bounds, for m triples of faces."""

    angle_min: Floats
    """(m, 3) least angle at the point of each face, radians; below 0 for none."""
    angle_max: Floats
    """(m, 3) greatest such angle, radians; above pi for none."""
    area_min: Floats
    """(m,) least area, square metres."""
    area_max: Floats
    """(m,) greatest area, square metres; exact where hulls have at most `MOST_CORNERS` corners."""


class TripleTables:
    """Ranges over triples of a model's faces, each computed when it is first needed."""

    def __init__(
        self,
        *,
        normals: Floats,
        hull_corners: Floats,
        hull_start: Ints,
        distances: tuple[Floats, Floats],
        tilts: tuple[Floats, Floats],
    ) -> None:
        """Prepare what is known of pairs; some milliseconds for a hundred faces.

        Args:
            normals: (f, 3) as of `ranges.PairTables`, as is all else.
            hull_corners: (c, 3) see there.
            hull_start: (f + 1,) see there.
            distances: (f, f) least and greatest, metres.
            tilts: (f, f) least and greatest, radians.
        """
        diameter = float(distances[1].max())
        corners, start = _few_corners(hull_corners, hull_start, normals)
        cones, half_angles = direction_cones(corners, start, 0.1 * SLACK * diameter)
        shape = (len(normals), len(normals), 3)
        own = np.broadcast_to(normals[:, None], shape)
        # A face is at least distance 0 from itself, so this is what the tables were widened by:
        # corners are off the face's plane by less, to either side.
        self.slack = SLACK * diameter - 2.0 * float(distances[0].diagonal().min())
        """How far a point of a face may be off its hull, metres."""
        self._dust = DUST * diameter**2
        self._geometry = (
            corners,
            start,
            _lifts(corners, start),
            # Directions from a to b: a cone, and their tilts against a's and against b's normal.
            np.ascontiguousarray(np.stack([cones, own, own.swapaxes(0, 1)], axis=2)),
            np.stack([np.zeros(shape[:2]), tilts[0], np.pi - tilts[1].T], axis=2),
            np.stack([half_angles, tilts[1], np.pi - tilts[0].T], axis=2),
        )
        self._terms = np.empty((int(np.diff(start).max()) ** 3, CORNER_TERMS))
        self._known = (np.full(FIRST_SLOTS, -1), np.empty((FIRST_SLOTS, 4, 2)), 0)

    def ranges(self, faces: NDArray[np.integer]) -> TriangleRanges:
        """Ranges over given triples of faces.

        Args:
            faces: (m, 3) faces, in any order, repeated or not.
        """
        found = np.empty((len(faces), 4, 2))
        for row, (a, b, c) in enumerate(np.asarray(faces)):
            triple = (int(a), int(b), int(c))
            triple_range(*self._geometry, triple, self._dust, self._terms, found[row])
        angles, areas = found[:, :3], found[:, 3]
        return TriangleRanges(angles[..., 0], angles[..., 1], areas[:, 0], areas[:, 1])

    def possible(
        self, rows: NDArray[np.int32], contacts: Contacts, *, angles: bool, areas: bool
    ) -> NDArray[np.bool_]:
        """Which interpretations have only triangles with their last contact that can be.

        Args:
            rows: (m, k) a face for each of the first k contacts.
            contacts: at least k contacts.
            angles: whether to look at the angles of triangles.
            areas: whether to look at their areas.

        Returns:
            (m,) False where no three points of the three faces can be what was felt.
        """
        keep = np.ones(len(rows), np.bool_)
        self._known = triple_kernels.filter_triples(
            rows,
            contacts.positions,
            contacts.position_error + self.slack,
            angles,
            areas,
            self._geometry,
            self._dust,
            MOST_SLOTS,
            *self._known,
            self._terms,
            keep,
        )
        return keep


def _few_corners(corners: Floats, start: Ints, normals: Floats) -> tuple[Floats, Ints]:
    """Hulls of at most `MOST_CORNERS` corners that hold the given ones."""
    hulls = []
    for face, normal in enumerate(normals):
        hull = corners[start[face] : start[face + 1]]
        if len(hull) > MOST_CORNERS:
            # Lines that touch the hull from evenly spaced directions; each meets the next.
            heights = hull @ normal
            middle = hull[0] + (0.5 * (heights.min() + heights.max()) - heights[0]) * normal
            u = np.cross(normal, hull[1] - hull[0])
            u /= np.linalg.norm(u)
            turn = 2.0 * np.pi / MOST_CORNERS
            around = turn * np.arange(MOST_CORNERS)
            out = np.outer(np.cos(around), u) + np.outer(np.sin(around), np.cross(normal, u))
            reach = (out @ (hull - middle).T).max(axis=1)
            along = (np.roll(reach, -1) - reach * np.cos(turn)) / np.sin(turn)
            hull = middle + reach[:, None] * out + along[:, None] * np.cross(normal, out)
        hulls.append(hull)
    return np.concatenate(hulls), np.cumsum([0, *map(len, hulls)])


def _lifts(corners: Floats, start: Ints) -> Floats:
    """(c,) squared distance of each corner from the middle between its face's farthest two."""
    lifts = np.empty(len(corners))
    for first, last in pairwise(start):
        hull = corners[first:last]
        apart = cdist(hull, hull)
        ends = np.unravel_index(int(apart.argmax()), apart.shape)
        lifts[first:last] = ((hull - hull[list(ends)].mean(axis=0)) ** 2).sum(axis=1)
    return lifts
