"""A model: a closed polyhedron as planar faces, with its own rotational symmetries."""

from __future__ import annotations

import os
import warnings
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import pdist

from .faces import (
    convex_hull_in_plane,
    convex_pieces,
    edge_neighbours,
    group_coplanar,
    plane_of,
    turned_against,
)
from .freezing import freeze, frozen
from .symmetry import FaceSummary, rotational_symmetries

if TYPE_CHECKING:
    import trimesh

MOST_FACES = 1000
"""Tables grow with the square of the number of faces; above this a mesh is hardly a polyhedron."""


@dataclass(frozen=True, eq=False)
class FacePolygons:
    """Planar polygons of all faces in flat arrays, as the compiled kernels read them.

    Face ``f`` owns polygons ``first[f]`` to ``first[f + 1]``; polygon ``k`` owns corners
    ``start[k]`` to ``start[k + 1]``, counter-clockwise about the outward normal.
    """

    first: NDArray[np.int64]
    """(f + 1,) the first polygon of each face."""
    start: NDArray[np.int64]
    """(p + 1,) the first corner of each polygon."""
    corners: NDArray[np.float64]
    """(c, 3) corners, object frame, metres."""

    def __post_init__(self) -> None:
        freeze(self)

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        freeze(self)

    @classmethod
    def of(cls, polygons: list[list[NDArray[np.float64]]]) -> FacePolygons:
        """Flatten a list of polygons a face."""
        flat = [polygon for face in polygons for polygon in face]
        return cls(
            first=np.cumsum([0, *map(len, polygons)], dtype=np.int64),
            start=np.cumsum([0, *map(len, flat)], dtype=np.int64),
            corners=np.ascontiguousarray(np.concatenate(flat)),
        )

    @cached_property
    def balls(self) -> NDArray[np.float64]:
        """(f, 4) centre and radius, metres, of a ball around each face."""
        firsts = self.start[self.first[:-1]]
        lows = np.minimum.reduceat(self.corners, firsts)
        centres = 0.5 * (lows + np.maximum.reduceat(self.corners, firsts))
        sizes = np.diff(np.append(firsts, len(self.corners)))
        away = np.linalg.norm(self.corners - np.repeat(centres, sizes, axis=0), axis=1)
        return frozen(np.column_stack([centres, np.maximum.reduceat(away, firsts)]))


@dataclass(frozen=True, eq=False)
class Polyhedron:
    """A model of the library: planar faces with outward normals, in its own frame, metres.

    Build one with `from_mesh`. Faces may be concave and may have holes; coplanar faces that
    don't touch are faces of their own. All arrays are read-only.
    """

    name: str
    vertices: NDArray[np.float64]
    """(v, 3) corners of the mesh."""
    triangles: NDArray[np.int64]
    """(t, 3) vertex indices, counter-clockwise seen from outside."""
    triangle_faces: NDArray[np.int64]
    """(t,) the planar face of each triangle."""
    normals: NDArray[np.float64]
    """(f, 3) outward unit normals."""
    offsets: NDArray[np.float64]
    """(f,) ``normal . x`` of each face's plane."""
    areas: NDArray[np.float64]
    """(f,) face areas, square metres."""
    hulls: FacePolygons
    """The convex hull of each face: one polygon a face."""
    pieces: FacePolygons
    """Convex polygons whose union is the face."""

    def __post_init__(self) -> None:
        freeze(self)

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        freeze(self)

    @property
    def face_count(self) -> int:
        """How many planar faces there are."""
        return len(self.normals)

    @cached_property
    def diameter(self) -> float:
        """The largest distance between two corners, metres."""
        return float(pdist(self.vertices).max())

    @cached_property
    def centroid(self) -> NDArray[np.float64]:
        """(3,) the centre of the enclosed volume, object frame."""
        corners = self.vertices[self.triangles]
        volumes = np.linalg.det(corners)
        middle = (volumes[:, None] * corners.sum(axis=1)).sum(axis=0) / (4.0 * volumes.sum())
        return frozen(middle)

    @cached_property
    def edges(self) -> NDArray[np.float64]:
        """(e, 2, 3) the segments where two faces meet, object frame."""
        pairs = edge_neighbours(self.triangles)
        between = self.triangle_faces[pairs[:, 0]] != self.triangle_faces[pairs[:, 1]]
        return frozen(self.vertices[pairs[between, 2:]])

    @cached_property
    def symmetries(self) -> NDArray[np.float64]:
        """(g, 3, 3) the proper rotations about `centroid` that map the solid onto itself.

        The identity comes first.
        """
        corners, summaries = [], []
        for face in range(self.face_count):
            triangles = self.triangles[self.triangle_faces == face]
            corners.append(np.unique(triangles))
            weights = _doubled_areas(self.vertices, triangles)
            middle = weights @ self.vertices[triangles].mean(axis=1) / weights.sum()
            summaries.append(middle - self.centroid)
        # A corner of the solid is where three faces meet; a mesh may have more vertices.
        meets = np.bincount(np.concatenate(corners), minlength=len(self.vertices))
        summary = FaceSummary(
            normals=self.normals,
            offsets=self.offsets - self.normals @ self.centroid,
            areas=self.areas,
            middles=np.array(summaries),
        )
        solid_corners = self.vertices[meets >= 3] - self.centroid
        return frozen(rotational_symmetries(summary, solid_corners, self.diameter))

    @classmethod
    def from_mesh(
        cls,
        mesh: trimesh.Trimesh | str | os.PathLike[str],
        *,
        name: str | None = None,
        scale: float = 1.0,
    ) -> Polyhedron:
        """Read planar faces off a closed mesh.

        Args:
            mesh: a trimesh mesh, or the path of a mesh file that trimesh reads (STL, OBJ, PLY,
                OFF, ...).
            name: what to call the model; by default the file's name without its ending.
            scale: metres in the mesh's unit of length.

        Raises:
            ValueError: a file that is missing or can't be read, a mesh that isn't closed, that
                encloses no volume, or that has more than `MOST_FACES` planar faces; a scale that
                isn't above zero.

        Warns:
            UserWarning: the winding was inverted or inconsistent and has been mended.
        """
        source = "mesh" if _is_mesh(mesh) else str(mesh)
        name = name or Path(source).stem
        if not (np.isfinite(scale) and scale > 0.0):
            raise ValueError(f"scale is {scale:g}; it must be above zero")
        try:
            vertices, triangles = _read(mesh)
            return cls._from_triangles(scale * vertices, triangles, name)
        except ValueError as error:
            raise ValueError(f"{source}: {error}") from error

    @classmethod
    def _from_triangles(
        cls, vertices: NDArray[np.float64], triangles: NDArray[np.int64], name: str
    ) -> Polyhedron:
        if len(triangles) < 4:
            raise ValueError(f"{len(triangles)} triangles can't enclose a volume")
        triangles = _outward(vertices, triangles, name)
        owner = group_coplanar(vertices, triangles)
        count = int(owner.max()) + 1
        if count > MOST_FACES:
            raise ValueError(
                f"{count} planar faces, and {MOST_FACES} is the most;"
                " is this a curved surface? A coarser mesh of it would do"
            )
        normals, offsets = np.empty((count, 3)), np.empty(count)
        areas = np.empty(count)
        hulls, pieces = [], []
        for face in range(count):
            members = triangles[owner == face]
            corners = vertices[np.unique(members)]
            try:
                normals[face], offsets[face] = plane_of(corners, members, vertices)
            except ValueError as error:
                raise ValueError(f"face {face}: {error}") from error
            areas[face] = _doubled_areas(vertices, members).sum() / 2.0
            hulls.append([convex_hull_in_plane(corners, normals[face])])
            pieces.append(convex_pieces(vertices, members, normals[face]))
        return cls(
            name=name,
            vertices=vertices,
            triangles=triangles,
            triangle_faces=owner,
            normals=normals,
            offsets=offsets,
            areas=areas,
            hulls=FacePolygons.of(hulls),
            pieces=FacePolygons.of(pieces),
        )


def _doubled_areas(
    vertices: NDArray[np.float64], triangles: NDArray[np.int64]
) -> NDArray[np.float64]:
    corners = vertices[triangles]
    sides = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return np.linalg.norm(sides, axis=1)


def _is_mesh(mesh: object) -> bool:
    """Whether something is a trimesh mesh, without importing trimesh to ask."""
    return hasattr(mesh, "vertices") and hasattr(mesh, "faces")


def _read(
    mesh: trimesh.Trimesh | str | os.PathLike[str],
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Merged vertices and triangles."""
    import trimesh  # a second of import time that a caller with ready models does not need

    if isinstance(mesh, trimesh.Trimesh):
        loaded = mesh.copy()
    elif isinstance(mesh, str | os.PathLike):
        path = Path(mesh)
        if not path.is_file():
            raise ValueError("no such mesh file")
        try:
            loaded = trimesh.load_mesh(path, process=False)
        except Exception as error:  # trimesh raises whatever its parsers raise
            raise ValueError(f"not a mesh that can be read ({error})") from error
        if not isinstance(loaded, trimesh.Trimesh) or not len(loaded.faces):
            raise ValueError("not a mesh that can be read (it holds no triangles)")
    else:
        raise ValueError(f"a mesh must be a trimesh.Trimesh or a path, not {type(mesh).__name__}")
    # Before merging, which rounds coordinates to integers, and NaN to any.
    bad = np.flatnonzero(~np.isfinite(loaded.vertices).all(axis=1))
    if bad.size:
        corner = loaded.vertices[bad[0]].tolist()
        raise ValueError(f"vertex {bad[0]} is {corner}; it must be finite")
    loaded.merge_vertices(merge_tex=True, merge_norm=True)
    triangles = np.asarray(loaded.faces, dtype=np.int64).reshape(-1, 3)
    distinct = (np.diff(np.sort(triangles, axis=1), axis=1) > 0).all(axis=1)
    triangles = triangles[distinct]
    used, triangles = np.unique(triangles, return_inverse=True)
    vertices = np.array(loaded.vertices, dtype=np.float64, order="C")[used]
    return vertices, np.ascontiguousarray(triangles.reshape(-1, 3))


def _outward(
    vertices: NDArray[np.float64], triangles: NDArray[np.int64], name: str
) -> NDArray[np.int64]:
    """The triangles, all counter-clockwise seen from outside; says so where it had to mend."""
    against = turned_against(triangles)
    if against.any():
        triangles = np.where(against[:, None], triangles[:, ::-1], triangles)
        warnings.warn(f"{name}: its winding was inconsistent; mended", UserWarning, stacklevel=4)
    corners = vertices[triangles]
    size = float(np.ptp(vertices, axis=0).max())
    volume = float(np.linalg.det(corners - vertices.mean(axis=0)).sum()) / 6.0
    if abs(volume) < 1e-9 * size**3:
        raise ValueError(f"it encloses no volume ({volume:.3g} cubic metres)")
    if volume < 0.0:
        triangles = triangles[:, ::-1]
        warnings.warn(
            f"{name}: its winding was inverted (normals pointed inwards); mended",
            UserWarning,
            stacklevel=4,
        )
    return np.ascontiguousarray(triangles)
