"""Noise that keeps its word: uniform inside a bound, never beyond it (memo, Section 4)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def uniform_in_ball(rng: np.random.Generator, count: int, radius: float) -> Floats:
    """(count, 3) vectors uniform in the ball of ``radius``, in the radius's unit."""
    directions = rng.normal(size=(count, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return directions * radius * rng.random((count, 1)) ** (1.0 / 3.0)


def uniform_in_cone(rng: np.random.Generator, normals: Floats, half_angle: float) -> Floats:
    """Unit vectors uniform in the cones around others.

    Args:
        rng: source of randomness.
        normals: (n, 3) unit axes.
        half_angle: largest angle from the axis, radians.

    Returns:
        (n, 3) unit vectors, each within ``half_angle`` of its axis.
    """
    count = len(normals)
    # On a sphere, area is uniform in the cosine of the angle from the axis.
    cosines = 1.0 - rng.random(count) * (1.0 - np.cos(half_angle))
    sines = np.sqrt(1.0 - cosines**2)
    around = 2.0 * np.pi * rng.random(count)
    helper = np.eye(3)[np.abs(normals).argmin(axis=1)]
    u = np.cross(normals, helper)
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    v = np.cross(normals, u)
    tangents = np.cos(around)[:, None] * u + np.sin(around)[:, None] * v
    return cosines[:, None] * normals + sines[:, None] * tangents
