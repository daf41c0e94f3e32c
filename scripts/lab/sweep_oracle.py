"""A ball swept along a ray against a closed triangle mesh, by plain geometry and without MuJoCo.

What a ball of radius r can't enter with its centre is the solid and all that is within r of it: the
union of the solid, a slab over each face, a cylinder around each edge and a ball around each
vertex. The first of these that the centre's ray enters is where the ball touches.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import RigidTransform

from ...recognizer import EDGE, FACE, VERTEX, Polyhedron

Floats = NDArray[np.float64]

SLACK = 1e-12
"""Of barycentric coordinates, so that nothing slips between two triangles."""
SAME = 1e-10
"""Places nearer to each other along a ray are one, metres; the simplest feature there counts."""
FLAT = 1e-4
"""Triangles that turn by less about a common edge are one face, radians."""


@dataclass(frozen=True, eq=False)
class Swept:
    """Where a ball first touches an object."""

    depth: float
    """How far its centre comes, metres; infinity if it passes by."""
    position_world: Floats
    """(3,) the contact, metres; NaN for none."""
    normal_world: Floats
    """(3,) unit vector from there to the centre; NaN for none."""
    kind: int
    """FACE, EDGE or VERTEX; -1 for none."""


class SweepOracle:
    """A solid that balls are swept against."""

    def __init__(self, model: Polyhedron) -> None:
        """Take triangles, edges and vertices off a model's mesh."""
        corners = model.vertices[model.triangles]
        crosses = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        sizes = np.linalg.norm(crosses, axis=1)
        self._corners = corners
        self._normals = crosses / sizes[:, None]
        self._areas = sizes
        self._vertices = model.vertices
        sides: dict[tuple[int, int], list[int]] = {}
        for triangle, (a, b, c) in enumerate(model.triangles.tolist()):
            for pair in ((a, b), (b, c), (c, a)):
                sides.setdefault((min(pair), max(pair)), []).append(triangle)
        self._edges = model.vertices[np.array(list(sides))]
        one, other = np.array(list(sides.values())).T
        turned = np.linalg.norm(np.cross(self._normals[one], self._normals[other]), axis=1)
        facing = (self._normals[one] * self._normals[other]).sum(axis=1)
        self._flat = (turned < FLAT) & (facing > 0.0)

    def sweep(
        self, T_world_object: RigidTransform, start: Floats, direction: Floats, radius: float
    ) -> Swept:
        """Move a ball along a ray until it touches the object.

        Args:
            T_world_object: where the object is.
            start: (3,) where the centre starts, outside, world frame, metres.
            direction: (3,) unit direction.
            radius: of the ball, metres.
        """
        T_object_world = T_world_object.inv()
        s = T_object_world.apply(start)
        d = T_object_world.rotation.apply(direction)
        faces, feet_on_faces = self._meet_faces(s, d, radius)
        edges, feet_on_edges = self._meet_edges(s, d, radius)
        vertices = _first_root(s - self._vertices, d, radius)
        # A diagonal of a face is no edge; a ball on it is on the face.
        found = (
            (FACE, faces, feet_on_faces),
            (FACE, np.where(self._flat, edges, np.inf), feet_on_edges),
            (EDGE, np.where(self._flat, np.inf, edges), feet_on_edges),
            (VERTEX, vertices, self._vertices),
        )
        first = min(float(depths.min()) for _, depths, _ in found)
        if not np.isfinite(first):
            return Swept(np.inf, np.full(3, np.nan), np.full(3, np.nan), -1)
        for kind, depths, feet in found:
            if depths.min() <= first + SAME:
                row = int(depths.argmin())
                normal = (s + depths[row] * d - feet[row]) / radius
                return Swept(
                    float(depths[row]),
                    T_world_object.apply(feet[row]),
                    T_world_object.rotation.apply(normal / np.linalg.norm(normal)),
                    kind,
                )
        raise AssertionError("one of them is the first")

    def _meet_faces(self, s: Floats, d: Floats, radius: float) -> tuple[Floats, Floats]:
        """(t,) depths at which the centre is so far over each triangle, and (t, 3) its feet."""
        a, b, c = self._corners.transpose(1, 0, 2)
        slopes = self._normals @ d
        with np.errstate(divide="ignore", invalid="ignore"):
            depths = (radius - ((s - a) * self._normals).sum(axis=1)) / slopes
            feet = s + depths[:, None] * d - radius * self._normals
            shares = [
                (np.cross(q - p, feet - p) * self._normals).sum(axis=1) / self._areas
                for p, q in ((a, b), (b, c), (c, a))
            ]
        inside = np.min(shares, axis=0) >= -SLACK
        return np.where((slopes < 0.0) & (depths >= 0.0) & inside, depths, np.inf), feet

    def _meet_edges(self, s: Floats, d: Floats, radius: float) -> tuple[Floats, Floats]:
        """(e,) depths at which the centre is so far from each edge, and (e, 3) its feet."""
        p = self._edges[:, 0]
        along = self._edges[:, 1] - p
        lengths = np.linalg.norm(along, axis=1)
        along = along / lengths[:, None]
        w = s - p
        across = d - (along @ d)[:, None] * along
        beside = w - (w * along).sum(axis=1)[:, None] * along
        depths = _first_root(beside, across, radius)
        with np.errstate(invalid="ignore"):
            where = ((w + depths[:, None] * d) * along).sum(axis=1)
            feet = p + where[:, None] * along
            inside = (where >= 0.0) & (where <= lengths)
        return np.where(inside, depths, np.inf), feet


def _first_root(w: Floats, d: Floats, radius: float) -> Floats:
    """(n,) the least t with |w + t d| = radius; infinity where there is none from zero on."""
    a = (d * d).sum(axis=-1)
    b = (w * d).sum(axis=-1)
    c = (w * w).sum(axis=-1) - radius**2
    square = b * b - a * c
    with np.errstate(divide="ignore", invalid="ignore"):
        t = (-b - np.sqrt(square)) / a
    return np.where((square >= 0.0) & (t >= 0.0), t, np.inf)
