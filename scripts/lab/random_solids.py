"""Random solids, as vertices and triangles: four families, and two of about 500 faces."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import ConvexHull, HalfspaceIntersection

Floats = NDArray[np.float64]
Solid = tuple[Floats, NDArray[np.int64]]
"""(v, 3) vertices and (t, 3) triangles, counter-clockwise seen from outside."""


def random_hull(rng: np.random.Generator) -> Solid:
    """The convex hull of 5 to 22 points near an ellipsoid."""
    points = rng.normal(size=(rng.integers(5, 23), 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    points *= rng.uniform(0.8, 1.0, (len(points), 1)) * rng.uniform(0.4, 1.0, 3)
    return hull_of(points)


def cut_box(rng: np.random.Generator) -> Solid:
    """A box with up to 34 cuts across its corners and edges."""
    half = rng.uniform(0.4, 1.0, 3)
    cuts = rng.integers(35)
    towards = rng.uniform(0.3, 1.0, (cuts, 3)) * rng.choice([-1.0, 1.0], (cuts, 3))
    along_edge = rng.random(cuts) < 0.4
    towards[along_edge, rng.integers(3, size=int(along_edge.sum()))] = 0.0
    offsets = (np.abs(towards) @ half) * rng.uniform(0.7, 0.95, cuts)
    sides = np.concatenate([np.eye(3), -np.eye(3), towards])
    return convex_solid(sides, np.concatenate([half, half, offsets]))


def prism(rng: np.random.Generator) -> Solid:
    """A prism or frustum on an irregular polygon, its top level or slanted."""
    count = int(rng.integers(4, 39))
    step = 2.0 * np.pi / count
    around = step * (np.arange(count) + rng.uniform(-0.3, 0.3, count))
    lean = rng.uniform(-0.3, 0.3) * rng.integers(2)
    sides = np.column_stack([np.cos(around), np.sin(around), np.full(count, lean)])
    caps = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]])
    caps[0, :2] = rng.uniform(-0.4, 0.4, 2) * rng.integers(2)
    # Planes of a many-sided prism that differ by more than this would cut each other off.
    offsets = 1.0 + min(0.2, 0.2 * step**2) * rng.uniform(-1.0, 1.0, count)
    vertices, triangles = convex_solid(
        np.concatenate([sides, caps]), np.append(offsets, rng.uniform(0.3, 1.2, 2))
    )
    return vertices * np.append(rng.uniform(0.6, 1.0, 2), 1.0), triangles


def block(rng: np.random.Generator) -> Solid:
    """Three to fourteen cells of an irregular grid, joined at their sides; some are sheared."""
    shape = np.array([3, 3, 3])
    filled = np.zeros(shape, bool)
    at = tuple(rng.integers(shape))
    wanted = rng.integers(3, 15)
    while filled.sum() < wanted:
        filled[at] = True
        axis, cells = rng.integers(3), np.argwhere(filled)
        step = cells[rng.integers(len(cells))] + rng.choice([-1, 1]) * np.eye(3, dtype=int)[axis]
        if (step >= 0).all() and (step < shape).all():
            at = tuple(step)
    lines = [np.cumsum(rng.uniform(0.4, 1.2, size + 1)) for size in shape]
    vertices, triangles = cell_solid(filled, lines)
    shear = np.eye(3) + rng.integers(2) * np.triu(rng.uniform(-0.15, 0.15, (3, 3)), 1)
    return vertices @ shear.T, triangles


FAMILIES = (random_hull, cut_box, prism, block)
"""Each gives, most of the time, a closed solid of 6 to 40 faces."""


def bumpy_hull(rng: np.random.Generator) -> Solid:
    """A convex solid of 500 triangles without symmetry: 252 points, each near an ellipsoid."""
    # A Fibonacci spiral spreads them evenly; moved by this little, none is buried by the others.
    index = np.arange(252) + 0.5
    heights, around = 1.0 - 2.0 * index / 252, np.pi * (1.0 + 5.0**0.5) * index
    flat = np.sqrt(1.0 - heights**2)
    points = np.column_stack([flat * np.cos(around), flat * np.sin(around), heights])
    points *= rng.uniform(0.99, 1.0, (252, 1))
    return hull_of(points * (0.1, 0.07, 0.05))


def studded_block(rng: np.random.Generator, rows: int = 11, columns: int = 11) -> Solid:
    """A block with a pyramid of its own on each square of its top: 4 faces each, and 5 more."""
    x, y = np.meshgrid(np.arange(rows + 1.0), np.arange(columns + 1.0), indexing="ij")
    top = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, 2.0)])
    cells = np.stack(np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij"), axis=-1)
    cells = cells.reshape(-1, 2)
    middles = cells + rng.uniform(0.3, 0.7, cells.shape)
    apexes = np.column_stack([middles, 2.0 + rng.uniform(0.3, 1.2, len(cells))])
    grid = np.arange(x.size).reshape(x.shape)
    triangles = []
    for apex, (i, j) in enumerate(cells, start=x.size):
        ring = [grid[i, j], grid[i + 1, j], grid[i + 1, j + 1], grid[i, j + 1]]
        triangles += [(ring[k], ring[(k + 1) % 4], apex) for k in range(4)]
    ground = x.size + len(apexes)
    corners = [(0.0, 0.0), (rows, 0.0), (rows, columns), (0.0, columns)]
    rims = [grid[:, 0], grid[-1], grid[::-1, -1], grid[0, ::-1]]
    for side, rim in enumerate(rims):
        foot, next_foot = ground + side, ground + (side + 1) % 4
        triangles += [(foot, b, a) for a, b in pairwise(rim)]
        triangles.append((foot, next_foot, rim[-1]))
    triangles += [(ground, ground + 2, ground + 1), (ground, ground + 3, ground + 2)]
    bottom = np.column_stack([corners, np.zeros(4)])
    return np.concatenate([top, apexes, bottom]) * 0.01, np.array(triangles, np.int64)


def hull_of(points: Floats) -> Solid:
    """The convex hull of points; those inside are left unused."""
    simplices = ConvexHull(points).simplices.astype(np.int64)
    inwards = np.linalg.det(points[simplices] - points.mean(axis=0)) < 0.0
    return points, np.where(inwards[:, None], simplices[:, ::-1], simplices)


def convex_solid(normals: ArrayLike, offsets: ArrayLike) -> Solid:
    """The solid of all points behind planes: ``normal . x <= offset``, offsets above zero.

    Args:
        normals: (f, 3) outward normals of any length.
        offsets: (f,) their offsets; a plane that cuts nothing off is left out.
    """
    planes = np.column_stack([normals, -np.asarray(offsets, float)])
    planes /= np.linalg.norm(planes[:, :3], axis=1, keepdims=True)
    cut = HalfspaceIntersection(planes, np.zeros(3))
    rings: list[list[int]] = [[] for _ in planes]
    for corner, through in enumerate(cut.dual_facets):
        for plane in through:
            rings[plane].append(corner)
    triangles = []
    for plane, ring in enumerate(rings):
        if len(ring) < 3:
            continue
        spokes = cut.intersections[ring] - cut.intersections[ring].mean(axis=0)
        u = spokes[0]
        v = np.cross(planes[plane, :3], u)
        ring = np.array(ring)[np.argsort(np.arctan2(spokes @ v, spokes @ u))]
        triangles += [(ring[0], a, b) for a, b in pairwise(ring[1:])]
    return cut.intersections, np.array(triangles, np.int64)


def cell_solid(filled: NDArray[np.bool_], lines: Sequence[Floats]) -> Solid:
    """The union of the filled cells of a grid, two triangles a square.

    Args:
        filled: (x, y, z) which cells are part of the solid.
        lines: for each axis its grid lines, one more than there are cells.
    """
    padded = np.pad(filled, 1)
    size = np.array(padded.shape)
    triangles = []
    for axis in range(3):
        u, v = np.eye(3, dtype=int)[(axis + 1) % 3], np.eye(3, dtype=int)[(axis + 2) % 3]
        for side in (0, 1):
            beyond = np.roll(padded, 1 - 2 * side, axis)
            for cell in np.argwhere(padded & ~beyond) - 1:
                first = cell + side * np.eye(3, dtype=int)[axis]
                ring = [first, first + u, first + u + v, first + v][:: 1 if side else -1]
                a, b, c, d = (int(np.ravel_multi_index(tuple(corner), size)) for corner in ring)
                triangles += [(a, b, c), (a, c, d)]
    used, triangles = np.unique(np.array(triangles, np.int64), return_inverse=True)
    at = np.unravel_index(used, size)
    vertices = np.column_stack([axis[index] for axis, index in zip(lines, at, strict=True)])
    return vertices, triangles.reshape(-1, 3)
