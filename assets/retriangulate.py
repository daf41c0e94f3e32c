"""One triangulation for each solid, whatever triangulation it comes with (needs manifold3d).

A boolean library divides planar faces as it likes: with slivers, with left-over vertices in the
middle of an edge, and differently from one version to the next. Here each planar face is read off
as its boundary loops and divided anew, by the constrained Delaunay triangulation (no slivers that
the face's shape does not force); where that leaves a choice, the least vertex index decides.
"""

from __future__ import annotations

from collections import Counter, defaultdict

import numpy as np
from manifold3d import triangulate
from numpy.typing import NDArray

from .obj_file import TriangleMesh, canonical

_COPLANAR = 1e-6  # radians between adjacent triangles of one face; real dihedrals exceed 0.2
_COCIRCULAR = 1e-7  # radians; within it, four vertices lie on a circle and both diagonals are good

Triangles = list[tuple[int, int, int]]


def retriangulate(mesh: TriangleMesh) -> TriangleMesh:
    """The same closed surface with true corners only and a canonical triangulation.

    Raises:
        ValueError: the mesh is not a closed manifold.
    """
    mesh = canonical(mesh)
    labels = _face_labels(mesh)
    faces_at: dict[int, set[int]] = defaultdict(set)
    for triangle, label in zip(mesh.triangles.tolist(), labels, strict=True):
        for vertex in triangle:
            faces_at[vertex].add(label)
    # Where fewer than three faces meet, the surface is flat or a straight edge runs through.
    corners = {vertex for vertex, faces in faces_at.items() if len(faces) >= 3}
    triangles: Triangles = []
    for label in range(max(labels) + 1):
        members = mesh.triangles[np.array(labels) == label]
        loops = [[v for v in loop if v in corners] for loop in _boundary_loops(members.tolist())]
        flat = _project(mesh.vertices, members)
        divided = triangulate([flat[loop] for loop in loops])
        order = [vertex for loop in loops for vertex in loop]
        own = [(order[a], order[b], order[c]) for a, b, c in np.asarray(divided).tolist()]
        triangles += _flip_to_delaunay(own, flat)
    used = sorted(corners)
    index = {vertex: i for i, vertex in enumerate(used)}
    renumbered = np.array([[index[v] for v in triangle] for triangle in triangles])
    return canonical(TriangleMesh(mesh.name, mesh.vertices[used], renumbered))


def _face_labels(mesh: TriangleMesh) -> list[int]:
    """For each triangle the number of its planar face: coplanar neighbours share one."""
    corners = mesh.vertices[mesh.triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.linalg.norm(normals, axis=1)
    normals /= areas[:, None]
    neighbour = _triangle_at_edge(mesh.triangles.tolist())
    labels = [-1] * len(mesh.triangles)
    count = 0
    # Large triangles first: their normals are the exact ones.
    for seed in np.argsort(-areas, kind="stable").tolist():
        if labels[seed] >= 0:
            continue
        labels[seed], front = count, [seed]
        while front:
            a, b, c = mesh.triangles[front.pop()].tolist()
            for edge in ((b, a), (c, b), (a, c)):
                if edge not in neighbour:
                    raise ValueError(f"{mesh.name}: edge {edge} has a triangle on one side only")
                other = neighbour[edge]
                bend = np.linalg.norm(normals[other] - normals[seed])
                if labels[other] < 0 and bend < _COPLANAR:
                    labels[other] = count
                    front.append(other)
        count += 1
    return labels


def _triangle_at_edge(triangles: list[list[int]]) -> dict[tuple[int, int], int]:
    return {edge: i for i, (a, b, c) in enumerate(triangles) for edge in ((a, b), (b, c), (c, a))}


def _boundary_loops(triangles: list[list[int]]) -> list[list[int]]:
    """Directed boundary of a set of triangles, as closed loops of vertices."""
    edges = _triangle_at_edge(triangles)
    boundary = [(a, b) for a, b in edges if (b, a) not in edges]
    if any(count > 1 for count in Counter(a for a, _ in boundary).values()):
        raise ValueError("a face touches itself at a vertex")
    following = dict(boundary)
    loops = []
    while following:
        start, vertex = following.popitem()
        loop = [start]
        while vertex != start:
            loop.append(vertex)
            vertex = following.pop(vertex)
        loops.append(loop)
    return loops


def _project(vertices: NDArray[np.float64], triangles: NDArray[np.int64]) -> NDArray[np.float64]:
    """All vertices in the plane of the largest of the triangles; ``(n, 2)``, seen from outside."""
    first, second, third = vertices[triangles].transpose(1, 0, 2)
    normals = np.cross(second - first, third - first)
    largest = np.linalg.norm(normals, axis=1).argmax()
    along = second[largest] - first[largest]
    along /= np.linalg.norm(along)
    outward = normals[largest] / np.linalg.norm(normals[largest])
    across = np.asarray(np.cross(outward, along), dtype=np.float64)
    return vertices @ np.column_stack([along, across])


def _flip_to_delaunay(triangles: Triangles, flat: NDArray[np.float64]) -> Triangles:
    """Flip inner edges until each satisfies Delaunay's condition (Lawson 1977)."""
    triangles = list(triangles)
    settled = False
    while not settled:
        settled = True
        at_edge = _triangle_at_edge([list(t) for t in triangles])
        for (a, b), left in at_edge.items():
            right = at_edge.get((b, a))
            if right is None:
                continue
            c, d = sum(triangles[left]) - a - b, sum(triangles[right]) - a - b
            if _should_flip(flat, a, b, c, d):
                triangles[left], triangles[right] = (c, d, b), (d, c, a)
                settled = False
                break
    return triangles


def _should_flip(flat: NDArray[np.float64], a: int, b: int, c: int, d: int) -> bool:
    """Whether diagonal c-d is better than a-b in the quadrilateral a, d, b, c."""
    excess = _angle(flat, a, c, b) + _angle(flat, b, d, a) - np.pi
    if abs(excess) < _COCIRCULAR:
        return min(c, d) < min(a, b)
    return bool(excess > 0)


def _angle(flat: NDArray[np.float64], start: int, apex: int, end: int) -> float:
    """Angle of a counter-clockwise triangle at its apex, radians."""
    u, v = flat[start] - flat[apex], flat[end] - flat[apex]
    return float(np.arctan2(abs(u[0] * v[1] - u[1] * v[0]), u @ v))
