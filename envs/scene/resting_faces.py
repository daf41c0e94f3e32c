"""On which face an object comes to rest, and how often, if it is dropped anyhow.

K. Y. Goldberg, B. V. Mirtich, Y. Zhuang, J. Craig, B. R. Carlisle and J. Canny, "Part Pose
Statistics: Estimators and Experiments", IEEE Transactions on Robotics and Automation 15(5), 1999:
without inertia, a part dropped at a random orientation first comes down on the facet of its hull
that is below its centre of mass, seen along gravity, so with a probability that is the facet's
solid angle from there over 4 pi. If it can't stand on that, it rolls over the edge beyond which its
centre is, and so on.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ...recognizer import Polyhedron
from ...recognizer.contacts.support import COPLANAR, StableFace, stable_faces
from ...recognizer.models.faces import convex_hull_in_plane
from ..collision.hull import Hull

Floats = NDArray[np.float64]

SAME_FACE = 1e-3
"""Normals that differ by less, radians, are of one face of the hull, found in two ways."""


@dataclass(frozen=True, eq=False)
class RestingFaces:
    """The faces that an object can stand on, and how often it comes to stand on each."""

    faces: tuple[StableFace, ...]
    shares: Floats
    """(f,) of random drops without inertia; their sum is 1."""


@lru_cache(maxsize=64)
def resting_faces(model: Polyhedron) -> RestingFaces:
    """The faces that an object can stand on, and how often it comes to stand on each.

    Remembered for the models last asked for: it takes as long as many probes do.

    Args:
        model: the object, of one density.
    """
    faces = stable_faces(model)
    facets = _facets(model)
    shares = np.zeros(len(faces))
    for start in facets:
        shares[_rolled_to(start, facets, faces, model)] += _solid_angle(
            start.outline - model.centroid
        )
    return RestingFaces(tuple(faces), shares / shares.sum())


@dataclass(frozen=True, eq=False)
class _Facet:
    """A facet of a convex hull."""

    normal: Floats
    outline: Floats
    """(k, 3) corners, counter-clockwise seen from outside."""


def _facets(model: Polyhedron) -> list[_Facet]:
    slack = COPLANAR * model.diameter
    hull = Hull.around(model.vertices, slack)
    assert hull is not None  # a solid has a volume
    on_plane = np.abs(hull.heights(hull.corners)) <= slack
    return [
        _Facet(normal, convex_hull_in_plane(hull.corners[on], normal))
        for normal, on in zip(hull.normals, on_plane.T, strict=True)
    ]


def _rolled_to(
    facet: _Facet, facets: list[_Facet], faces: list[StableFace], model: Polyhedron
) -> int:
    """The face on which an object ends that comes down on a facet."""
    normals = np.array([face.normal for face in faces])
    for _ in facets:
        turns = np.linalg.norm(normals - facet.normal, axis=1)
        if turns.min() < SAME_FACE:
            return int(turns.argmin())
        facet = _over_the_edge(facet, facets, model)
    return int(np.linalg.norm(normals - facet.normal, axis=1).argmin())


def _over_the_edge(facet: _Facet, facets: list[_Facet], model: Polyhedron) -> _Facet:
    """The facet beside the edge that the centre of mass is farthest beyond."""
    ends = np.roll(facet.outline, -1, axis=0)
    outwards = np.cross(ends - facet.outline, facet.normal)
    outwards /= np.linalg.norm(outwards, axis=1, keepdims=True)
    edge = int(((model.centroid - facet.outline) * outwards).sum(axis=1).argmax())
    one, other = facet.outline[edge], ends[edge]

    def farther_end(beside: _Facet) -> float:
        return max(np.linalg.norm(beside.outline - end, axis=1).min() for end in (one, other))

    return min((beside for beside in facets if beside is not facet), key=farther_end)


def _solid_angle(outline: Floats) -> float:
    """Solid angle of a convex polygon seen from the origin (Van Oosterom and Strackee 1983)."""
    a, b, c = outline[0], outline[1:-1], outline[2:]
    la, lb, lc = np.linalg.norm(a), np.linalg.norm(b, axis=1), np.linalg.norm(c, axis=1)
    volumes = np.cross(b, c) @ a
    beside = la * lb * lc + (b @ a) * lc + (b * c).sum(axis=1) * la + (c @ a) * lb
    return 2.0 * float(np.arctan2(volumes, beside).sum())
