"""Constructors of convex solids, each given as the points whose convex hull it is.

A solid is a float64 array of shape ``(n, 3)``: its corners, in any order, in the unit that the
caller uses (``stand_ins`` works in inches). Profiles are float64 arrays of shape ``(n, 2)`` and
convex.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

Points = NDArray[np.float64]

# For each extrusion axis, the space axes along which the profile's two coordinates run.
_PROFILE_AXES = {"x": (1, 2, 0), "y": (0, 2, 1), "z": (0, 1, 2)}


def extrude(profile: ArrayLike, axis: str, low: float, high: float) -> Points:
    """Sweep a convex profile along one axis.

    Args:
        profile: ``(n, 2)`` corners; (y, z) for axis "x", (x, z) for "y", (x, y) for "z".
        axis: "x", "y" or "z".
        low, high: where the sweep starts and ends.

    Returns:
        ``(2n, 3)`` corners.

    Raises:
        ValueError: unknown axis, a profile that is not ``(n, 2)``, or ``low >= high``.
    """
    if axis not in _PROFILE_AXES:
        raise ValueError(f"axis is {axis!r}; it must be one of {', '.join(_PROFILE_AXES)}")
    corners = np.asarray(profile, dtype=np.float64)
    if corners.ndim != 2 or corners.shape[1] != 2 or len(corners) < 3:
        raise ValueError(f"profile has shape {corners.shape}; it must be (n, 2) with n >= 3")
    if not low < high:
        raise ValueError(f"the sweep runs from {low} to {high}; it must go upwards")
    first, second, along = _PROFILE_AXES[axis]
    points = np.empty((2 * len(corners), 3))
    points[:, first] = np.tile(corners[:, 0], 2)
    points[:, second] = np.tile(corners[:, 1], 2)
    points[:, along] = np.repeat([low, high], len(corners))
    return points


def box(x: tuple[float, float], y: tuple[float, float], z: tuple[float, float]) -> Points:
    """Axis-aligned box from its three intervals (low, high); ``(8, 3)`` corners."""
    return extrude([(x[0], y[0]), (x[1], y[0]), (x[1], y[1]), (x[0], y[1])], "z", *z)


def regular_polygon(sides: int, inradius: float) -> Points:
    """Regular polygon about the origin with one side facing +x; ``(sides, 2)`` corners.

    ``inradius`` is the distance from the centre to each side. With a multiple of four sides,
    sides also face -x, +y and -y.
    """
    angles = (2 * np.arange(sides) + 1) * np.pi / sides
    return inradius / np.cos(np.pi / sides) * np.column_stack([np.cos(angles), np.sin(angles)])


def chamfered_rectangle(half_x: float, half_y: float, chamfer: float) -> Points:
    """Rectangle about the origin whose four corners are cut at 45 degrees; ``(8, 2)`` corners.

    ``chamfer`` is the length cut from each side at each corner.
    """
    near_x, near_y = half_x - chamfer, half_y - chamfer
    quarter = [(half_x, near_y), (near_x, half_y)]
    signs = [(1, 1), (-1, 1), (-1, -1), (1, -1)]
    return np.array([(sx * x, sy * y) for sx, sy in signs for x, y in quarter], dtype=np.float64)


def place(solid: Points, tilt: float = 0.0, at: Sequence[float] = (0.0, 0.0, 0.0)) -> Points:
    """Turn a solid about the y axis, then move its origin.

    ``tilt`` (radians) leans the solid's z axis towards +x; ``at`` is where its origin goes.
    """
    cos, sin = np.cos(tilt), np.sin(tilt)
    rotation = np.array([[cos, 0.0, sin], [0.0, 1.0, 0.0], [-sin, 0.0, cos]])
    return solid @ rotation.T + np.asarray(at, dtype=np.float64)


def turn_half(solid: Points) -> Points:
    """The solid rotated by pi about the z axis, exactly (signs flip, nothing is rounded)."""
    return solid * np.array([-1.0, -1.0, 1.0])
