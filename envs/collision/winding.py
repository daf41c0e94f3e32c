"""Whether points are inside a solid."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...recognizer import Polyhedron

Floats = NDArray[np.float64]

AT_ONCE = 1_000_000
"""Pairs of point and triangle worked on at once, so that memory stays small."""


def winding_numbers(model: Polyhedron, points: Floats) -> Floats:
    """How often a solid's surface goes round points: 1 inside, 0 outside.

    Each triangle's solid angle is that of Van Oosterom and Strackee, "The Solid Angle of a Plane
    Triangle", IEEE Transactions on Biomedical Engineering 30(2), 1983.

    Args:
        model: the solid.
        points: (n, 3) object frame, metres, none of them on the surface.

    Returns:
        (n,) whole numbers but for rounding.
    """
    step = max(1, AT_ONCE // len(model.triangles))
    parts = [points[start : start + step] for start in range(0, len(points), step)]
    return np.concatenate([np.zeros(0), *(_winding(model, part) for part in parts)])


def _winding(model: Polyhedron, points: Floats) -> Floats:
    a, b, c = (model.vertices[ends][None] - points[:, None] for ends in model.triangles.T)
    la, lb, lc = (np.linalg.norm(side, axis=-1) for side in (a, b, c))
    volume = np.einsum("pti,pti->pt", a, np.cross(b, c))
    ab, bc, ca = ((u * v).sum(axis=-1) for u, v in ((a, b), (b, c), (c, a)))
    beside = la * lb * lc + ab * lc + bc * la + ca * lb
    return np.arctan2(volume, beside).sum(axis=1) / (2.0 * np.pi)
