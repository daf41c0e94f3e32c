"""Features: what of a model a contact can lie on; its faces or, for a ball finger, edges and
vertices too.

A contact on a convex edge or vertex has any normal of the feature's normal cone: the arc between
the normals of the edge's two faces, or the spherical polygon of all directions that point away from
every line leaving the vertex along the surface.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from .polyhedron import Polyhedron

Floats = NDArray[np.float64]
FeatureKind = Literal["face", "edge", "vertex"]

FLAT = 1e-6
"""Sines below it are rounding: an edge so flat is none, a line so little off a plane is in it."""


@dataclass(frozen=True, eq=False)
class Features:
    """Features of a model in flat arrays, as the compiled kernels read them; faces come first.

    Feature ``f`` has polygon ``f`` for its convex hull (a segment for an edge, a point for a
    vertex) and polygons ``first[f]`` to ``first[f + 1]`` for its convex pieces.
    """

    normals: Floats
    """(f, 3) unit normals; of an edge or a vertex the middle of its cone."""
    offsets: Floats
    """(f,) ``normal . x`` of the feature's plane, or of a plane through it, metres."""
    first: NDArray[np.int64]
    """(f + 1,) the first piece of each feature."""
    start: NDArray[np.int64]
    """(p + 1,) the first corner of each polygon."""
    corners: Floats
    """(c, 3) corners, object frame, metres."""
    cone_start: NDArray[np.int64]
    """(f + 1,) the first normal of each feature's cone."""
    cone_normals: Floats
    """(k, 3) unit normals at the corners of the cones, in order around them."""
    half_angles: Floats
    """(f,) largest angle between a feature's normal and one of its cone, radians; 0 for a face."""
    face_count: int
    edge_count: int

    def __len__(self) -> int:
        return len(self.normals)

    def kind(self, feature: int) -> FeatureKind:
        """What a feature is."""
        if feature < self.face_count:
            return "face"
        return "edge" if feature < self.face_count + self.edge_count else "vertex"

    @property
    def middles(self) -> Floats:
        """(f, 3) a point inside each feature's hull, object frame, metres."""
        start = self.start[: len(self) + 1]
        sums = np.add.reduceat(self.corners[: start[-1]], start[:-1], axis=0)
        return sums / np.diff(start)[:, None]


def face_features(model: Polyhedron) -> Features:
    """A model's faces alone."""
    return _gather(model, [], [])


def all_features(model: Polyhedron) -> Features:
    """A model's faces, convex edges and convex vertices."""
    return _gather(model, convex_edges(model), convex_vertices(model))


def with_squares(features: Features, normals: Floats, middles: Floats, half: float) -> Features:
    """The same and, behind them, squares of given planes.

    Args:
        features: of a model.
        normals: (s, 3) unit normals of the squares.
        middles: (s, 3) their middles, object frame, metres.
        half: half a side, metres.
    """
    count, added = len(features), len(normals)
    hulls = int(features.start[count])
    leanest = np.eye(3)[np.abs(normals).argmin(axis=1)]
    one = _units(leanest - (leanest * normals).sum(axis=1)[:, None] * normals)
    other = np.cross(normals, one)
    signs = ((1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0))
    squares = middles[:, None] + half * np.stack([a * one + b * other for a, b in signs], axis=1)
    corners = squares.reshape(-1, 3)
    sizes = np.diff(features.start)
    sides = np.full(added, 4)
    pieces = int(features.first[-1]) + added
    return Features(
        normals=np.ascontiguousarray(np.vstack([features.normals, normals])),
        offsets=np.concatenate([features.offsets, (normals * middles).sum(axis=1)]),
        first=np.concatenate([features.first + added, pieces + 1 + np.arange(added)]),
        start=np.cumsum([0, *sizes[:count], *sides, *sizes[count:], *sides]).astype(np.int64),
        corners=np.ascontiguousarray(
            np.concatenate([features.corners[:hulls], corners, features.corners[hulls:], corners])
        ),
        cone_start=np.concatenate(
            [features.cone_start, features.cone_start[-1] + 1 + np.arange(added)]
        ),
        cone_normals=np.ascontiguousarray(np.vstack([features.cone_normals, normals])),
        half_angles=np.concatenate([features.half_angles, np.zeros(added)]),
        face_count=features.face_count,
        edge_count=features.edge_count,
    )


def _gather(
    model: Polyhedron,
    edges: list[tuple[Floats, Floats]],
    vertices: list[tuple[Floats, Floats]],
) -> Features:
    others = edges + vertices
    points = [points for points, _ in others]
    cones = [cone for _, cone in others]
    middles = [_unit(cone.sum(axis=0)) for cone in cones]
    count = model.face_count + len(others)
    hulls, pieces = model.hulls, model.pieces
    hull_start = np.cumsum([0, *np.diff(hulls.start), *map(len, points)])
    # Faces have pieces of their own behind all hulls; the others are their own only piece.
    piece_first = pieces.first + count
    lone = np.arange(model.face_count, count)
    piece_start = pieces.start + hull_start[-1]
    lone_points = np.concatenate([*points, np.zeros((0, 3))])
    lone_start = piece_start[-1] + np.cumsum([0, *map(len, points)])
    cone_sizes = [1] * model.face_count + [len(cone) for cone in cones]
    half = [
        float(np.arccos(np.clip(c @ m, -1.0, 1.0)).max())
        for c, m in zip(cones, middles, strict=True)
    ]
    return Features(
        normals=np.ascontiguousarray(np.vstack([model.normals, *middles])),
        offsets=np.concatenate(
            [model.offsets, [m @ p.mean(axis=0) for m, p in zip(middles, points, strict=True)]]
        ).astype(float),
        first=np.concatenate([piece_first, piece_first[-1] + 1 + np.arange(len(lone))]),
        start=np.concatenate([hull_start[:-1], piece_start[:-1], lone_start]).astype(np.int64),
        corners=np.ascontiguousarray(
            np.concatenate([hulls.corners, lone_points, pieces.corners, lone_points])
        ),
        cone_start=np.cumsum([0, *cone_sizes]).astype(np.int64),
        cone_normals=np.ascontiguousarray(np.vstack([model.normals, *cones])),
        half_angles=np.concatenate([np.zeros(model.face_count), half]),
        face_count=model.face_count,
        edge_count=len(edges),
    )


def convex_edges(model: Polyhedron) -> list[tuple[Floats, Floats]]:
    """The convex edges of a model: (2, 3) ends and (2, 3) normals of the two faces, each."""
    sides: dict[tuple[int, int], int] = {}
    for t, corners in enumerate(model.triangles):
        for k in range(3):
            sides[int(corners[k]), int(corners[(k + 1) % 3])] = t
    segments: dict[tuple[int, int], list[tuple[int, int]]] = {}
    for (a, b), t in sides.items():
        other = sides[b, a]
        f, g = int(model.triangle_faces[t]), int(model.triangle_faces[other])
        if f >= g:
            continue
        along = model.vertices[b] - model.vertices[a]
        # Counter-clockwise on f: the edge turns outwards if the normals turn about its direction.
        turn = np.cross(model.normals[f], model.normals[g]) @ along
        if turn > FLAT * np.linalg.norm(along):
            segments.setdefault((f, g), []).append((a, b))
    found = []
    for (f, g), pairs in segments.items():
        for a, b in _joined(pairs):
            found.append((model.vertices[[a, b]], model.normals[[f, g]]))
    return found


def _joined(pairs: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """Directed segments on one line, those that follow on each other joined."""
    after = dict(pairs)
    ends = {b for _, b in pairs}
    joined = []
    for a in after:
        if a in ends:
            continue
        b = after[a]
        while b in after:
            b = after[b]
        joined.append((a, b))
    return joined


def convex_vertices(model: Polyhedron) -> list[tuple[Floats, Floats]]:
    """The convex vertices of a model: (1, 3) point and (k, 3) corners of its normal cone, each."""
    leaving: dict[int, set[int]] = {}
    touching: dict[int, set[int]] = {}
    sides: dict[tuple[int, int], int] = {}
    for t, corners in enumerate(model.triangles):
        for k in range(3):
            a, b = int(corners[k]), int(corners[(k + 1) % 3])
            sides[a, b] = int(model.triangle_faces[t])
            leaving.setdefault(a, set()).add(b)
            leaving.setdefault(b, set()).add(a)
            touching.setdefault(a, set()).add(int(model.triangle_faces[t]))
    found = []
    for vertex, neighbours in leaving.items():
        if len(touching[vertex]) < 3:
            continue
        ends = sorted(neighbours)
        lines = _units(model.vertices[ends] - model.vertices[vertex])
        cone = _polar_cone(lines)
        if len(cone) < 3:
            continue
        # A corner and the pocket that it would fill have the same lines; their edges turn
        # differently. Those on the outline of the lines say which it is.
        turns = [
            np.cross(model.normals[sides[vertex, end]], model.normals[sides[end, vertex]]) @ line
            for end, line in zip(ends, lines, strict=True)
            if line @ cone[0] > -FLAT
        ]
        if max(turns, key=abs) > 0.0:
            found.append((model.vertices[[vertex]], cone))
    return found


def _polar_cone(lines: Floats) -> Floats:
    """(k, 3) corners of the cone of directions that lean on no line, in order; empty if flat."""
    corners: list[Floats] = []
    for one, other in combinations(lines, 2):
        across = np.cross(one, other)
        length = np.linalg.norm(across)
        if length < FLAT:
            continue
        for normal in (across / length, -across / length):
            known = any(np.linalg.norm(normal - c) < FLAT for c in corners)
            if not known and (lines @ normal < FLAT).all():
                corners.append(normal)
    if len(corners) < 3:
        return np.zeros((0, 3))
    cone = np.array(corners)
    middle = _unit(cone.sum(axis=0))
    if (cone @ middle < FLAT).any():
        return np.zeros((0, 3))
    first = _unit(cone[0] - (cone[0] @ middle) * middle)
    second = np.cross(middle, first)
    return cone[np.argsort(np.arctan2(cone @ second, cone @ first))]


def _unit(vector: Floats) -> Floats:
    return vector / np.linalg.norm(vector)


def _units(vectors: Floats) -> Floats:
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
