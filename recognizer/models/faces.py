"""From the triangles of a mesh to planar faces: who belongs to which plane, and convex pieces."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial.distance import pdist, squareform

COPLANAR_ANGLE = 1e-4
"""Adjacent triangles that turn by less (radians) are one face, however large they are."""
COPLANAR_OFFSET = 2e-6
"""Adjacent triangles that leave each other's plane by less (share of the diameter) are one face:
coordinates rounded to single precision, as STL has them, are off by up to 6e-8 of their size."""
STEEPEST_ROUNDING = 0.05
"""A turn larger than this (radians) is never taken for rounding."""
PLANARITY = 1e-5
"""How far a corner may lie off its face's plane, as a share of the diameter."""

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def edge_neighbours(triangles: Ints) -> Ints:
    """Pairs of triangles that share an edge: (e, 4) rows of triangle, triangle, vertex, vertex.

    Raises:
        ValueError: an edge that does not belong to exactly two triangles: the mesh isn't closed.
    """
    directed = np.stack([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]], axis=1)
    ends = np.sort(directed.reshape(-1, 2), axis=1)
    order = np.lexsort((ends[:, 1], ends[:, 0]))
    ends, owner = ends[order], np.repeat(np.arange(len(triangles)), 3)[order]
    first = np.flatnonzero(np.r_[True, (ends[1:] != ends[:-1]).any(axis=1)])
    shared_by = np.diff(np.r_[first, len(ends)])
    if (shared_by != 2).any():
        holes, crowded = int((shared_by == 1).sum()), int((shared_by > 2).sum())
        mending = "it has holes; 'fill holes' or 'repair' in a CAD or mesh program closes them"
        if not holes:
            mending = "surfaces meet inside it; 'make solid' or 'union' in a CAD program joins them"
        raise ValueError(
            f"the mesh isn't closed: {holes} edges belong to one triangle only"
            f" and {crowded} to more than two; each must belong to two ({mending})"
        )
    return np.column_stack([owner[first], owner[first + 1], ends[first]])


def turned_against(triangles: Ints) -> NDArray[np.bool_]:
    """Which triangles to reverse so that neighbours run along their common edge opposite ways.

    Args:
        triangles: (t, 3) vertex indices of a closed mesh.

    Raises:
        ValueError: the mesh isn't closed, or has one side only.
    """
    first, second, start, end = edge_neighbours(triangles).T
    along = [
        ((sides == start[:, None]) & (np.roll(sides, -1, axis=1) == end[:, None])).any(axis=1)
        for sides in (triangles[first], triangles[second])
    ]
    clash = along[0] == along[1]
    # Two nodes a triangle, as it is and reversed; ways of winding that go together are linked.
    count = len(triangles)
    links = np.concatenate([first, first + count])
    partners = np.concatenate([second + count * clash, second + count * ~clash])
    graph = coo_matrix((np.ones(len(links)), (links, partners)), (2 * count, 2 * count))
    kept, reversed_ = connected_components(graph, directed=False)[1].reshape(2, count)
    if (kept == reversed_).any():
        raise ValueError("the mesh has one side only; a solid's surface has an inside")
    return kept > reversed_


def group_coplanar(vertices: Floats, triangles: Ints) -> Ints:
    """The planar face each triangle belongs to, faces numbered in order of first appearance.

    Adjacent triangles in one plane are merged; coplanar faces that don't touch stay apart.

    Args:
        vertices: (v, 3) corners, object frame, metres.
        triangles: (t, 3) vertex indices of a closed mesh.

    Returns:
        (t,) face indices.
    """
    diameter = float(np.ptp(vertices, axis=0).max())
    pairs = edge_neighbours(triangles)
    sides = vertices[triangles]
    crosses = np.cross(sides[:, 1] - sides[:, 0], sides[:, 2] - sides[:, 0])
    doubled = np.linalg.norm(crosses, axis=1)
    normals = crosses / np.maximum(doubled, np.finfo(float).tiny)[:, None]

    first, second = pairs[:, 0], pairs[:, 1]
    turn = np.arccos(np.clip((normals[first] * normals[second]).sum(axis=1), -1.0, 1.0))
    # Each triangle has one corner off the shared edge; how far does it leave the other's plane?
    apexes = vertices[triangles[pairs[:, :2]].sum(axis=2) - pairs[:, 2:].sum(axis=1)[:, None]]
    on_edge = vertices[pairs[:, 2]]
    lift = np.maximum(
        np.abs(((apexes[:, 0] - on_edge) * normals[second]).sum(axis=1)),
        np.abs(((apexes[:, 1] - on_edge) * normals[first]).sum(axis=1)),
    )
    rounding = (lift < COPLANAR_OFFSET * diameter) & (turn < STEEPEST_ROUNDING)

    # A needle has no normal to speak of: it goes with the neighbour across its longest edge,
    # along which it lies.
    length = np.linalg.norm(vertices[pairs[:, 2]] - vertices[pairs[:, 3]], axis=1)
    longest = np.zeros(len(triangles))
    np.maximum.at(longest, first, length)
    np.maximum.at(longest, second, length)
    needle = doubled < COPLANAR_OFFSET * diameter * longest
    along = (needle[first] & (length >= longest[first])) | (
        needle[second] & (length >= longest[second])
    )
    merged = (turn < COPLANAR_ANGLE) | rounding | along
    size = len(triangles)
    graph = coo_matrix((np.ones(int(merged.sum())), (first[merged], second[merged])), (size, size))
    labels = connected_components(graph, directed=False)[1]
    _, appearance, inverse = np.unique(labels, return_index=True, return_inverse=True)
    return np.argsort(np.argsort(appearance))[inverse]


def plane_of(corners: Floats, triangles: Ints, vertices: Floats) -> tuple[Floats, float]:
    """The outward unit normal and the offset ``normal . x`` of a face's plane.

    Raises:
        ValueError: the corners leave the plane by more than rounding allows.
    """
    sides = vertices[triangles]
    normal = np.cross(sides[:, 1] - sides[:, 0], sides[:, 2] - sides[:, 0]).sum(axis=0)
    normal /= np.linalg.norm(normal)
    heights = corners @ normal
    offset = 0.5 * float(heights.min() + heights.max())
    stray = float(np.ptp(heights)) / 2.0
    if stray > PLANARITY * float(np.ptp(vertices, axis=0).max()):
        raise ValueError(f"its corners leave its plane by up to {stray:.3g} m")
    return normal, offset


def convex_hull_in_plane(corners: Floats, normal: Floats) -> Floats:
    """The convex hull of coplanar points, counter-clockwise about ``normal``, collinear ones out.

    Args:
        corners: (k, 3) points of a plane.
        normal: (3,) unit normal of that plane.

    Returns:
        (h, 3) corners of the hull.
    """
    # Sorted along the line between the two farthest apart, the first and the last are corners
    # for certain: no other comes near them in that order, whatever rounding does to it.
    apart = squareform(pdist(corners))
    first, last = np.unravel_index(int(apart.argmax()), apart.shape)
    u = corners[last] - corners[first]
    u -= (u @ normal) * normal
    u /= np.linalg.norm(u)
    v = np.asarray(np.cross(normal, u), dtype=np.float64)
    flat: Floats = np.column_stack([corners @ u, corners @ v])
    order = np.lexsort((flat[:, 1], flat[:, 0]))
    slack = 1e-12 * float(np.ptp(flat, axis=0).max()) ** 2

    def half(indices: NDArray[np.intp]) -> list[int]:
        chain: list[int] = []
        for index in indices:
            while len(chain) > 1 and _turn(flat, chain[-2], chain[-1], int(index)) <= slack:
                chain.pop()
            chain.append(int(index))
        return chain[:-1]

    return corners[half(order) + half(order[::-1])]


def _turn(flat: Floats, a: int, b: int, c: int) -> float:
    ab, bc = flat[b] - flat[a], flat[c] - flat[b]
    return float(ab[0] * bc[1] - ab[1] * bc[0])


def convex_pieces(vertices: Floats, triangles: Ints, normal: Floats) -> list[Floats]:
    """Convex polygons, counter-clockwise about ``normal``, whose union is a planar face.

    Triangles are joined across shared edges while the result stays convex (Hertel and Mehlhorn).

    Args:
        vertices: (v, 3) corners of the mesh.
        triangles: (t, 3) the face's triangles.
        normal: (3,) outward unit normal of the face.

    Returns:
        A list of (k, 3) polygons.
    """
    corners = vertices[np.unique(triangles)]
    sides = vertices[triangles]
    doubled = np.cross(sides[:, 1] - sides[:, 0], sides[:, 2] - sides[:, 0]) @ normal
    size = float(np.ptp(corners, axis=0).max())
    hull = convex_hull_in_plane(corners, normal)
    if _doubled_area(hull, normal) - float(doubled.sum()) <= 1e-9 * size**2:
        return [hull]
    rings = [
        list(map(int, ring)) for ring, area in zip(triangles, doubled, strict=True) if area > 0
    ]
    merged = True
    while merged:
        merged = False
        for left in range(len(rings)):
            for right in range(left + 1, len(rings)):
                ring = _joined(rings[left], rings[right])
                if ring is not None and _is_convex(vertices[ring], normal, size):
                    rings[left] = ring
                    del rings[right]
                    merged = True
                    break
            if merged:
                break
    return [convex_hull_in_plane(vertices[ring], normal) for ring in rings]


def _doubled_area(polygon: Floats, normal: Floats) -> float:
    return float(np.cross(polygon, np.roll(polygon, -1, axis=0)).sum(axis=0) @ normal)


def _joined(left: list[int], right: list[int]) -> list[int] | None:
    """The ring of two polygons that share an edge, which runs the other way in the second."""
    for i, a in enumerate(left):
        b = left[(i + 1) % len(left)]
        for j, c in enumerate(right):
            if c == b and right[(j + 1) % len(right)] == a:
                ring = left[i + 1 :] + left[: i + 1] + (right[j:] + right[:j])[2:]
                return ring if len(set(ring)) == len(ring) else None
    return None


def _is_convex(polygon: Floats, normal: Floats, size: float) -> bool:
    edges = np.roll(polygon, -1, axis=0) - polygon
    turns = np.cross(edges, np.roll(edges, -1, axis=0)) @ normal
    return bool((turns >= -1e-12 * size**2).all())
