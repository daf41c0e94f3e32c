"""Patches of a range image: planes through 5 x 5 readings, and which to keep (memo, Section 5)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

Floats = NDArray[np.float64]

ARM = 2
"""Readings from the middle of a patch to its rim."""
SIDE = 2 * ARM + 1

PLACES = np.arange(-ARM, ARM + 1.0)
"""Rows and columns of a patch, counted from its middle."""


@dataclass(frozen=True, eq=False)
class PatchFits:
    """Least-squares planes through every patch of an image; ``[i, j]`` is the one whose middle is
    the reading ``[i + ARM, j + ARM]``."""

    slopes: Floats
    """(m - 4, n - 4, 2) how depth grows from one column to the next and from one row to the next,
    metres; NaN where a reading is missing."""
    heights: Floats
    """(m - 4, n - 4) depths of the planes in the middle, metres."""
    residuals: Floats
    """(m - 4, n - 4) how far the reading farthest off its plane is off, metres."""

    @property
    def flatness(self) -> Floats:
        """(m - 4, n - 4) the largest residual of a patch and its eight neighbours, metres.

        Infinite on the rim, where neighbours are missing, and where readings are.
        """
        worst = np.full(self.residuals.shape, np.inf)
        if min(worst.shape) >= 3:
            known = np.where(np.isnan(self.residuals), np.inf, self.residuals)
            worst[1:-1, 1:-1] = sliding_window_view(known, (3, 3)).max(axis=(2, 3))
        return worst


def fit_patches(depths: Floats) -> PatchFits:
    """Fit a plane to the 5 x 5 readings around each reading of an image.

    Args:
        depths: (m, n) metres, NaN where nothing was read; at least 5 of each.
    """
    windows = sliding_window_view(depths, (SIDE, SIDE))
    # Rows and columns of a full grid are orthogonal to each other and to a constant, so each
    # number of the fit is a weighted sum of its own.
    squares = SIDE * (PLACES**2).sum()
    first = np.einsum("mnij,i->mn", windows, PLACES) / squares
    second = np.einsum("mnij,j->mn", windows, PLACES) / squares
    heights = windows.mean(axis=(2, 3))
    largest = np.zeros(heights.shape)
    for i, j in np.ndindex(SIDE, SIDE):
        fitted = heights + PLACES[i] * first + PLACES[j] * second
        np.maximum(largest, np.abs(windows[:, :, i, j] - fitted), out=largest)
    return PatchFits(np.stack([first, second], axis=-1), heights, largest)


def patch_residuals(depths: Floats, fits: PatchFits, patch: tuple[int, int]) -> Floats:
    """(5, 5) how far the readings of a patch are beyond its plane, metres.

    Args:
        depths: (m, n) the image that was fitted.
        fits: what `fit_patches` made of it.
        patch: the first two indices of the patch in ``fits``.
    """
    i, j = patch
    across = fits.slopes[i, j, 0] * PLACES[:, None] + fits.slopes[i, j, 1] * PLACES[None, :]
    return depths[i : i + SIDE, j : j + SIDE] - fits.heights[i, j] - across


def best_of_blocks(fits: PatchFits, most: float) -> NDArray[np.int64]:
    """Flat patches that don't overlap: of each 5 x 5 block of middles the one with least residual.

    Args:
        fits: planes through all patches.
        most: the largest residual that a patch and each of its eight neighbours may have, metres.

    Returns:
        (c, 2) indices into the arrays of ``fits``.
    """
    flat = np.argwhere(fits.flatness <= most)
    residuals = fits.residuals[tuple(flat.T)]
    flat = flat[np.argsort(residuals, kind="stable")]
    blocks = flat // SIDE
    first = np.unique(blocks, axis=0, return_index=True)[1]
    return flat[np.sort(first)]


def spread_out(
    points: Floats,
    normals: Floats,
    count: int,
    accept: Callable[[int], bool],
) -> list[int]:
    """Choose places far from each other, the first three with normals as independent as can be.

    The second normal makes the largest angle with the first, the third the largest volume with
    both: so three are independent wherever three of those accepted are. After that each place is
    the farthest from all before it.

    Args:
        points: (c, 3) metres, the most welcome first.
        normals: (c, 3) unit vectors.
        count: the most to choose.
        accept: asked once about a place that is to be chosen; it may refuse.

    Returns:
        Rows, in the order in which they were chosen.
    """
    open_to = np.ones(len(points), bool)
    chosen: list[int] = []
    scores = -np.arange(len(points), dtype=float)
    while open_to.any() and len(chosen) < count:
        best = int(np.where(open_to, scores, -np.inf).argmax())
        open_to[best] = False
        if not accept(best):
            continue
        chosen.append(best)
        scores = _welcome(points, normals, chosen)
    return chosen


def _welcome(points: Floats, normals: Floats, chosen: list[int]) -> Floats:
    """(c,) how welcome each place is after those chosen; the scale changes with their number."""
    across = np.cross(normals[chosen[0]], normals)
    if len(chosen) == 1:
        return np.linalg.norm(across, axis=1)
    if len(chosen) == 2:
        return np.abs(across @ normals[chosen[1]])
    apart = points[:, None, :] - points[None, chosen, :]
    return np.linalg.norm(apart, axis=2).min(axis=1)
