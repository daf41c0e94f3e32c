"""From a range image to a small number of contacts (memo, Section 5)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...recognizer import FACE, Contacts
from .patch_bounds import normal_bound
from .patches import ARM, best_of_blocks, fit_patches, patch_residuals, spread_out
from .range_image import RangeImage

Floats = NDArray[np.float64]

FLAT = 1.25
"""The largest residual of a patch that is kept and of its neighbours, in range errors. Of patches
on one face about one in twenty has more."""
STEEPEST = np.radians(80.0)
"""Faces turned further than this from the scanner are not measured."""


@dataclass(frozen=True, eq=False)
class RangePoints:
    """Points of an image where a plane fits very well."""

    contacts: Contacts
    starts_world: Floats
    """(n, 3) where the ray of each starts, metres."""


def measure_points(
    image: RangeImage,
    usable: NDArray[np.bool_],
    *,
    spacing: tuple[float, float],
    range_error: float,
    normal_error: float,
    most: int,
) -> RangePoints:
    """Choose flat patches of an image that are far apart and differ in their normals.

    Args:
        image: what was read.
        usable: (m, n) which of its readings patches may be made of.
        spacing: of its columns and rows, metres.
        range_error: how far off a reading is at most, metres.
        normal_error: no patch is kept whose normal may be further off, radians.
        most: the most points.
    """
    depths = np.where(usable, image.depths, np.nan)
    fits = fit_patches(depths)
    patches = best_of_blocks(fits, FLAT * range_error)
    slopes = fits.slopes[tuple(patches.T)] / spacing
    bounds = np.full(len(patches), np.pi)

    def sure_enough(row: int) -> bool:
        patch = (int(patches[row, 0]), int(patches[row, 1]))
        residuals = patch_residuals(depths, fits, patch)
        bounds[row] = normal_bound(fits.slopes[patch], residuals, spacing, range_error)
        steepest = np.arctan(np.linalg.norm(slopes[row])) + bounds[row]
        return bool(bounds[row] <= normal_error and steepest <= STEEPEST)

    middles = tuple((patches + ARM).T)
    points, normals = image.points_world[middles], image.view.normals(slopes)
    kept = spread_out(points, normals, most, sure_enough)
    contacts = Contacts(
        points[kept],
        normals[kept],
        # The reading in the middle: on the face under it, but for its error along the ray.
        position_error=np.full(len(kept), range_error),
        normal_error=bounds[kept],
        approaches=np.tile(image.view.direction_world, (len(kept), 1)),
        kinds=FACE,
    )
    return RangePoints(contacts, image.starts_world[middles][kept])
