"""How many transforms poses come to, by the memo's rule and by palpate's (memo, Section 4.3)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from ...recognizer.poses.fits.pose import Poses

Floats = NDArray[np.float64]

DIRECTION_TOLERANCE = np.radians(1.5)
"""Directions of rotation less far apart are the same (memo, Section 4.3), radians."""
SHIFT_TOLERANCES_IN = (0.01, 0.05)
"""Translations less far apart are the same (memo, Table VI), inches."""


def count_transforms(
    poses: Poses, centroid: NDArray[np.float64]
) -> tuple[int, tuple[int, ...], tuple[int, ...]]:
    """How many transforms poses come to: by direction, with translations too, and by poses.

    Best fits come first; a pose opens a group of its own unless it is like the first of another.
    """
    poses = poses.take(np.lexsort((poses.costs, ~poses.proven)))
    axes, shifts = directions_of(poses.rotations), poses.translations
    centres = shifts + poses.rotations @ centroid
    # The product of two rotations' entries is the trace of the one between them: 1 + 2 cos of it.
    flat = poses.rotations.reshape(-1, 9)
    turned = (flat, 1.0 + 2.0 * np.cos(DIRECTION_TOLERANCE))
    aligned = (axes, np.cos(DIRECTION_TOLERANCE))
    return (
        count_groups(*aligned),
        tuple(count_groups(*aligned, shifts, tolerance) for tolerance in SHIFT_TOLERANCES_IN),
        tuple(count_groups(*turned, centres, tolerance) for tolerance in SHIFT_TOLERANCES_IN),
    )


def directions_of(rotations: Floats) -> Floats:
    """(m, 3) unit vectors about which (m, 3, 3) rotations turn, by an angle between 0 and π.

    A rotation by nothing has none; zeros stand for it.
    """
    from scipy.spatial.transform import Rotation

    turns = Rotation.from_matrix(rotations).as_rotvec()
    return turns / np.maximum(np.linalg.norm(turns, axis=1), 1e-300)[:, None]


def count_groups(
    turns: Floats,
    least_product: float,
    places: Floats | None = None,
    most_apart_in: float = np.inf,
) -> int:
    """How many groups poses form, each around the first pose that is in none before it.

    Args:
        turns: (m, k) rows whose products say how alike rotations are.
        least_product: of two that are alike.
        places: (m, 3) metres.
        most_apart_in: the largest distance of places that are alike, inches.
    """
    from ...envs.probe_env import INCH

    def alike(leader: int, others: NDArray[np.intp]) -> NDArray[np.bool_]:
        near = turns[others] @ turns[leader] >= least_product
        if places is not None:
            apart = np.linalg.norm(places[others] - places[leader], axis=1)
            near &= apart <= most_apart_in * INCH
        return near

    count = len(turns)
    rest, groups = np.arange(count), 0
    while len(rest):
        groups += 1
        rest = rest[1:][~alike(int(rest[0]), rest[1:])]
    return groups
