"""Convex decomposition: a solid cut along the planes of faces beside its notches.

B. Chazelle, "Convex Partitions of Polyhedra: A Lower Bound and Worst-Case Optimal Algorithm", SIAM
Journal on Computing 13(3), 1984: a solid is cut along planes through its reflex edges until none is
left. Here it is all of space that is cut, as in a binary space partition, so that every piece is a
convex cell and rounding can't tear the surface; each cut is the plane of a face beside a reflex
edge, where one is left, else that of any face. Then cells that are convex together are joined.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...recognizer import Polyhedron
from ...recognizer.models.faces import edge_neighbours
from .convex_cells import Cell, Plane, split_polygon
from .convex_joins import joined
from .hull import Hull
from .winding import winding_numbers

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

REFLEX = 1e-6
"""Least sine of the angle of a notch; the faces of a model turn by 1e-4 at least."""
SLACK = 1e-9
"""Corners so near a plane, as a share of the diameter, are on it; rounding is far below it."""
MOST_CELLS = 20_000
"""Cells, inside and outside, after which a solid is given up as too intricate."""


def convex_cuts(model: Polyhedron) -> list[Hull]:
    """Convex parts with no volume in common whose union is the solid.

    Args:
        model: the solid.

    Returns:
        Parts in the object frame, metres, exact to a few times what the mesh's own corners are off
        the planes of its faces.

    Raises:
        ValueError: more than `MOST_CELLS` cells.
    """
    slack = plane_slack(model)
    hulls = [Hull.around(cell.corners, slack) for cell in _empty_cells(model, slack)]
    solid = [hull for hull in hulls if hull is not None]
    middles = np.array([hull.corners.mean(axis=0) for hull in solid])
    inside = winding_numbers(model, middles) > 0.5
    return joined([hull for hull, kept in zip(solid, inside, strict=True) if kept], slack)


def plane_slack(model: Polyhedron) -> float:
    """How near a plane a point counts as on it, metres.

    A few times more than the mesh's own corners are off the planes of its faces.
    """
    owner = model.triangle_faces
    corners = model.vertices[model.triangles]
    heights = np.einsum("tkd,td->tk", corners, model.normals[owner]) - model.offsets[owner, None]
    return max(SLACK * model.diameter, 4.0 * float(np.abs(heights).max()))


@dataclass(frozen=True, eq=False)
class _Region:
    """A cell and what of the solid's surface runs through it."""

    cell: Cell
    faces: Ints
    """(n,) the face of each polygon."""
    polygons: list[Floats]
    """Convex pieces of faces."""
    beside: Ints
    """(m, 2) the two faces beside each notch."""
    notches: list[Floats]
    """(2, 3) ends of reflex edges."""


def _empty_cells(model: Polyhedron, slack: float) -> list[Cell]:
    """Cells that fill the box around a solid and that no face of it runs through."""
    waiting, empty = [_everything(model)], []
    while waiting:
        region = waiting.pop()
        if not region.polygons:
            empty.append(region.cell)
        else:
            waiting += _cut(model, region, _best_face(model, region, slack), slack)
        if len(waiting) + len(empty) > MOST_CELLS:
            raise ValueError(
                f"{model.name}: its faces divide the space around it into more than {MOST_CELLS}"
                " convex cells, too many for a simulation; a coarser mesh of it would do"
            )
    return empty


def _everything(model: Polyhedron) -> _Region:
    pieces = model.pieces
    first, start = pieces.first, pieces.start
    polygons = [pieces.corners[start[piece] : start[piece + 1]] for piece in range(len(start) - 1)]
    low, high = model.vertices.min(axis=0), model.vertices.max(axis=0)
    room = 0.1 * model.diameter
    beside, ends = reflex_edges(model)
    faces = np.repeat(np.arange(model.face_count), np.diff(first))
    return _Region(Cell.box(low - room, high + room), faces, polygons, beside, list(ends))


def reflex_edges(model: Polyhedron) -> tuple[Ints, Floats]:
    """The edges at which a solid's faces form a notch.

    Returns:
        (m, 2) the two faces beside each, and (m, 2, 3) its ends, object frame, metres.
    """
    first, second, start, end = edge_neighbours(model.triangles).T
    faces = np.column_stack([model.triangle_faces[first], model.triangle_faces[second]])
    ring = model.triangles[first]
    onwards = (ring == start[:, None]) & (np.roll(ring, -1, axis=1) == end[:, None])
    ends = model.vertices[np.column_stack([start, end])]
    along = np.where(onwards.any(axis=1)[:, None], 1.0, -1.0) * (ends[:, 1] - ends[:, 0])
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    # From the edge into the first face; a notch if that leads above the second.
    inwards = np.cross(model.normals[faces[:, 0]], along)
    rises = (inwards * model.normals[faces[:, 1]]).sum(axis=1) > REFLEX
    reflex = rises & (faces[:, 0] != faces[:, 1])
    return faces[reflex], ends[reflex]


def _best_face(model: Polyhedron, region: _Region, slack: float) -> int:
    """The face whose plane is to be the next cut.

    The one that most notches end at, less those it cuts in two; among equals, the one that cuts
    the fewest polygons.
    """
    faces = np.unique(region.beside if len(region.notches) else region.faces)
    normals, offsets = model.normals[faces], model.offsets[faces]

    def sides(lines: list[Floats]) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        low, high = _spans(lines, normals, offsets)
        return (low >= -slack) & (high <= slack), (low < -slack) & (high > slack)

    _, crossed = sides(region.polygons)
    gain = np.zeros(len(faces), np.int64)
    if len(region.notches):
        ended, parted = sides(region.notches)
        gain = ended.sum(axis=0) - parted.sum(axis=0)
    return int(faces[np.lexsort((crossed.sum(axis=0), -gain))[0]])


def _spans(lines: list[Floats], normals: Floats, offsets: Floats) -> tuple[Floats, Floats]:
    """(n, p) the least and the greatest height of each polygon above each plane."""
    heights = np.concatenate(lines) @ normals.T - offsets
    at = np.cumsum([0, *map(len, lines[:-1])])
    return np.minimum.reduceat(heights, at), np.maximum.reduceat(heights, at)


def _cut(model: Polyhedron, region: _Region, face: int, slack: float) -> list[_Region]:
    """What of a region is on either side of a face's plane."""
    plane = Plane(model.normals[face], float(model.offsets[face]))
    # What is left of the face itself is on the plane, whatever rounding has made of it.
    others = np.flatnonzero(region.faces != face)
    polygons = _sides([region.polygons[k] for k in others], plane, slack)
    notches = _sides(region.notches, plane, slack)
    return [
        _Region(
            cell,
            region.faces[others[polygons[side][0]]],
            polygons[side][1],
            region.beside[notches[side][0]],
            notches[side][1],
        )
        for side, cell in enumerate(region.cell.split(plane, slack))
        if cell is not None
    ]


def _sides(
    lines: list[Floats], plane: Plane, slack: float
) -> tuple[tuple[Ints, list[Floats]], tuple[Ints, list[Floats]]]:
    """Below and above a plane: which polygons have a part there, and those parts."""
    halves = [split_polygon(line, plane, slack) for line in lines]
    below = [(k, part) for k, (part, _) in enumerate(halves) if part is not None]
    above = [(k, part) for k, (_, part) in enumerate(halves) if part is not None]

    def unzipped(found: list[tuple[int, Floats]]) -> tuple[Ints, list[Floats]]:
        return np.array([k for k, _ in found], np.int64), [part for _, part in found]

    return unzipped(below), unzipped(above)
