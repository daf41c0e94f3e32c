"""A planar model: a part's outline as maximal straight edges, with its own rotational symmetries.

The plane's counterpart of `polyhedron`: what a face is to a solid, an edge is to an outline.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.distance import pdist

from .freezing import frozen
from .planar_kernels import segment_distances
from .polyhedron import MOST_FACES
from .symmetry import LENGTH_TOLERANCE

STRAIGHT = 1e-6
"""A corner nearer (share of the diameter) to the line between its neighbours is none: coordinates
in single precision are off by a tenth of that."""

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Polygon:
    """A model of the plane: one closed outline that doesn't meet itself, in its own frame, metres.

    Build one with `from_corners`. Edge ``k`` runs from corner ``k`` to corner ``k + 1``, with the
    inside on its left. All arrays are read-only.
    """

    name: str
    corners: Floats
    """(e, 2) corners, counter-clockwise; at each the outline turns."""
    straightness: float = 0.0
    """How far the corners that were left out lie off their edges at most, metres. A contact with
    the outline as it was given is that much less sure a contact with an edge."""

    @property
    def face_count(self) -> int:
        """How many edges there are."""
        return len(self.corners)

    @cached_property
    def segments(self) -> Floats:
        """(e, 2, 2) first and last point of each edge."""
        return frozen(np.stack([self.corners, np.roll(self.corners, -1, axis=0)], axis=1))

    @cached_property
    def lengths(self) -> Floats:
        """(e,) lengths of the edges, metres."""
        return frozen(np.linalg.norm(self.segments[:, 1] - self.segments[:, 0], axis=1))

    @cached_property
    def normals(self) -> Floats:
        """(e, 2) outward unit normals."""
        along = (self.segments[:, 1] - self.segments[:, 0]) / self.lengths[:, None]
        return frozen(np.column_stack([along[:, 1], -along[:, 0]]))

    @cached_property
    def offsets(self) -> Floats:
        """(e,) ``normal . x`` of each edge's line, metres."""
        return frozen((self.normals * self.segments.mean(axis=1)).sum(axis=1))

    @cached_property
    def diameter(self) -> float:
        """The largest distance between two corners, metres."""
        return float(pdist(self.corners).max())

    @cached_property
    def perimeter(self) -> float:
        """The length of the outline, metres."""
        return float(self.lengths.sum())

    @cached_property
    def area(self) -> float:
        """The enclosed area, square metres."""
        return _doubled_area(self.corners) / 2.0

    @cached_property
    def centroid(self) -> Floats:
        """(2,) the centre of the enclosed area."""
        first = self.corners - self.corners[0]
        second = np.roll(first, -1, axis=0)
        weights = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
        middle = (weights[:, None] * (first + second)).sum(axis=0) / (3.0 * weights.sum())
        return frozen(self.corners[0] + middle)

    @cached_property
    def symmetries(self) -> Floats:
        """(g, 2, 2) the proper rotations about `centroid` that map the outline onto itself.

        The identity comes first. A rotation keeps the corners' order, so it moves each on by the
        same number of places; the best rotation for each number is checked.
        """
        arms = (self.corners - self.centroid) @ np.array([1.0, 1j])
        found = [1.0 + 0.0j]
        for places in range(1, len(arms)):
            image = np.roll(arms, -places)
            towards = (image * arms.conj()).sum()
            turn = towards / max(abs(towards), 1e-300)
            if np.abs(turn * arms - image).max() < LENGTH_TOLERANCE * self.diameter:
                found.append(turn)
        return frozen(np.array([[[t.real, -t.imag], [t.imag, t.real]] for t in found]))

    @classmethod
    def from_corners(cls, corners: ArrayLike, *, name: str) -> Polygon:
        """Make a model of an outline.

        Repeated points and corners at which the outline goes straight on are left out; a clockwise
        outline is reversed. The first point may be repeated at the end.

        Args:
            corners: (v, 2) points in their order along the outline, metres.
            name: what to call the model.

        Raises:
            ValueError: points that aren't (v, 2) or aren't finite, fewer than three corners, an
                outline that encloses no area or meets itself, or more than `MOST_FACES` edges.
        """
        points = np.array(corners, dtype=np.float64, order="C")
        if points.ndim != 2 or points.shape[1] != 2:
            raise ValueError(f"{name}: corners must have shape (v, 2), not {points.shape}")
        bad = np.flatnonzero(~np.isfinite(points).all(axis=1))
        if bad.size:
            row = int(bad[0])
            raise ValueError(f"{name}: corner {row} is {points[row].tolist()}; it must be finite")
        distinct = np.unique(points, axis=0)
        if len(distinct) < 3:
            raise ValueError(f"{name}: {len(distinct)} distinct corners; an outline has at least 3")
        size = float(np.linalg.norm(np.ptp(points, axis=0)))
        kept = _maximal_edges(points, STRAIGHT * size)
        ring = points[kept]
        doubled = _doubled_area(ring)
        if len(kept) < 3 or abs(doubled) < STRAIGHT * size * size:
            raise ValueError(f"{name}: the outline encloses no area")
        if len(kept) > MOST_FACES:
            raise ValueError(
                f"{name}: {len(kept)} edges, and {MOST_FACES} is the most;"
                " is this a curve? Fewer points of it would do"
            )
        _check_simple(ring, STRAIGHT * size, name)
        if doubled < 0.0:
            # From the same first corner, the other way round.
            ring = np.roll(ring[::-1], 1, axis=0)
        return cls(name, frozen(np.ascontiguousarray(ring)), _largest_miss(points, kept))


def _maximal_edges(points: Floats, slack: float) -> NDArray[np.intp]:
    """The rows of ``points`` at which the outline turns by more than ``slack``, metres."""
    kept = np.arange(len(points))
    while len(kept) > 2:
        ring = points[kept]
        near = _distances(ring, np.roll(ring, 1, axis=0), np.roll(ring, -1, axis=0)) < slack
        # Of neighbours only every other one at a time: each is measured against the other.
        drop = np.zeros(len(kept), bool)
        for row in np.flatnonzero(near):
            drop[row] = not (drop[row - 1] or drop[(row + 1) % len(kept)])
        if not drop.any():
            break
        kept = kept[~drop]
    return kept


def _largest_miss(points: Floats, kept: NDArray[np.intp]) -> float:
    """How far the points between two kept ones lie off the edge between those, metres."""
    edge = (np.searchsorted(kept, np.arange(len(points)), side="right") - 1) % len(kept)
    starts, ends = points[kept[edge]], points[kept[(edge + 1) % len(kept)]]
    return float(_distances(points, starts, ends).max())


def _check_simple(ring: Floats, slack: float, name: str) -> None:
    """Refuse an outline of which two edges cross, touch or fold back on each other."""
    ends = np.roll(ring, -1, axis=0)
    count = len(ring)
    apart = segment_distances(np.stack([ring, ends], axis=1))
    edges = np.arange(count)
    following = (edges + 1) % count
    # Neighbours share a corner; they may not run back along each other.
    folded = np.minimum(
        _distances(ring, ends, np.roll(ring, -2, axis=0)),
        _distances(np.roll(ring, -2, axis=0), ring, ends),
    )
    apart[edges, edges] = np.inf
    apart[edges, following] = apart[following, edges] = folded
    one, other = np.unravel_index(int(apart.argmin()), apart.shape)
    if apart[one, other] < slack:
        raise ValueError(
            f"{name}: the outline meets itself: the edge from {ring[one].tolist()}"
            f" to {ends[one].tolist()} and the one from {ring[other].tolist()}"
            f" to {ends[other].tolist()}"
        )


def _distances(points: Floats, starts: Floats, ends: Floats) -> Floats:
    """(n,) distances of points from segments, (n, 2) each."""
    along = ends - starts
    squares = (along**2).sum(axis=1)
    shares = ((points - starts) * along).sum(axis=1) / np.where(squares > 0.0, squares, 1.0)
    nearest = starts + np.clip(shares, 0.0, 1.0)[:, None] * along
    return np.linalg.norm(points - nearest, axis=1)


def _doubled_area(ring: Floats) -> float:
    """Twice the signed area, positive for counter-clockwise corners."""
    # About a corner, so that an outline far from its origin loses no digits.
    first = ring - ring[0]
    second = np.roll(first, -1, axis=0)
    return float((first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]).sum())
