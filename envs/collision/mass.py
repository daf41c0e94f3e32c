"""Mass, centre and inertia of a solid of one density, from its exact surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...recognizer import Polyhedron

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class MassProperties:
    """What a rigid body's motion depends on."""

    mass: float
    """Kilograms."""
    centre_object: Floats
    """(3,) centre of mass, object frame, metres."""
    inertia_object: Floats
    """(3, 3) about the centre of mass, along the object frame's axes, kg m²."""


def volume(model: Polyhedron) -> float:
    """What a solid's surface encloses, cubic metres."""
    corners = model.vertices[model.triangles] - model.centroid
    return float(np.linalg.det(corners).sum()) / 6.0


def mass_properties(model: Polyhedron, density: float) -> MassProperties:
    """Mass, centre and inertia of a solid, from the tetrahedra over its triangles.

    Args:
        model: the solid.
        density: kilograms a cubic metre.

    Raises:
        ValueError: a density that isn't above zero.
    """
    if not (np.isfinite(density) and density > 0.0):
        raise ValueError(f"density is {density:g} kg/m³; it must be above zero")
    corners = model.vertices[model.triangles] - model.centroid
    # Over the tetrahedron of the origin, a, b and c, the integral of x xᵀ is
    # det(a, b, c) (aaᵀ + bbᵀ + ccᵀ + ssᵀ) / 120 with s = a + b + c.
    sums = np.concatenate([corners, corners.sum(axis=1, keepdims=True)], axis=1)
    second = np.einsum("t,tki,tkj->ij", np.linalg.det(corners), sums, sums) / 120.0
    inertia = density * (np.trace(second) * np.eye(3) - second)
    return MassProperties(density * volume(model), np.array(model.centroid), inertia)
