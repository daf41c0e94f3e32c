"""What of a solid a contact lies on: a face, an edge or a vertex."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...recognizer import EDGE, FACE, VERTEX, Polyhedron
from ...recognizer.models.features import convex_edges, convex_vertices

Floats = NDArray[np.float64]

SAME_NORMAL = 2e-6
"""Sine of an angle below which two directions are one: rounding of what the simulation gives."""


class FeatureKinds:
    """Tells the kind of feature that a ball touches, from where and along which normal.

    Away from convex edges it is a face. Near one, a ball on the face has the face's normal, one on
    the edge a normal across it, and one on the vertex at its end neither.
    """

    def __init__(self, model: Polyhedron, rounding: float) -> None:
        """Prepare a solid.

        Args:
            model: the solid.
            rounding: how far off a place on it may be, metres.
        """
        segments = np.array([ends for ends, _ in convex_edges(model)]).reshape(-1, 2, 3)
        along = segments[:, 1] - segments[:, 0]
        self._lengths = np.linalg.norm(along, axis=1)
        self._starts = segments[:, 0]
        self._along = along / self._lengths[:, None]
        corners = [points for points, _ in convex_vertices(model)]
        self._vertices = np.concatenate([np.zeros((0, 3)), *corners])
        self._normals = model.normals
        self._offsets = model.offsets
        self._rounding = rounding

    def kind(self, point_object: Floats, normal_object: Floats) -> int:
        """FACE, EDGE or VERTEX.

        Args:
            point_object: (3,) a place on the surface, object frame, metres.
            normal_object: (3,) unit vector from there to the centre of the ball.
        """
        from_starts = point_object - self._starts
        where = np.clip((from_starts * self._along).sum(axis=1), 0.0, self._lengths)
        away = np.linalg.norm(from_starts - where[:, None] * self._along, axis=1)
        near = away <= self._rounding
        if not near.any() or self._on_face(point_object, normal_object):
            return FACE
        across = np.abs(self._along[near] @ normal_object) < SAME_NORMAL
        far = np.linalg.norm(self._vertices - point_object, axis=1) > self._rounding
        return EDGE if across.any() or far.all() else VERTEX

    def _on_face(self, point: Floats, normal: Floats) -> bool:
        """Whether a place is on the plane of a face with this normal."""
        heights = np.abs(self._normals @ point - self._offsets)
        off = np.linalg.norm(self._normals - normal, axis=1)
        return bool(((off < SAME_NORMAL) & (heights <= self._rounding)).any())
