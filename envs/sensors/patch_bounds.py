"""How far the plane of a patch may be off the face under its middle.

A patch is 5 x 5 readings of depth, each off by at most a known error; ``residuals`` are what they
are beyond the least-squares plane. Let F be the face that the ray in the middle truly met. The
bound is the largest angle between the fitted plane and a plane that F's could be, given the
readings, and it holds in each of three cases, whatever else the patch shows:

1. **A quarter.** F is what the patch shows in at least one quarter of it: a right angle of rows and
   columns, turned any way, with its corner in the middle. That is so in the middle of a face, where
   one edge or one step crosses the patch, however high or slight it is, and at corners seen under
   90 degrees or more. F's plane is then within the error of all readings of some quarter. Which one
   isn't known: all sixteen that differ in their readings are tried.
2. **It bulges.** The surface that the patch shows is convex, of however many faces. F's plane is
   then nowhere behind it, so nowhere behind a reading by more than the error, and in the middle
   within the error of the reading.
3. **It is hollow.** The same from the other side.

In each case, how the plane may differ from the fitted one is a polytope of three numbers (two
slopes and a height) that linear inequalities bound, and its corners decide: slopes of planes
within an angle of a given one, if that is below a right angle, are a convex set.

What none of the cases covers is a face of which less than a quarter shows around the middle of a
patch that is neither convex nor hollow: a sliver between steps, a saddle, a groove, a fin. A patch
is kept only if it and its eight neighbours are flat within little more than the error, so such a
detail would have to be as shallow as the error over 7 x 7 readings. `RangeScanner` refuses objects
with edges so short; `tests/envs/sensors/test_patches.py` looks for others that slip through.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from itertools import combinations, product

import numpy as np
from numpy.typing import NDArray

from .patches import PLACES

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

GRID = np.array([(i, j) for i in PLACES for j in PLACES])
"""(25, 2) columns and rows of a patch's readings, counted from its middle."""
MIDDLE = len(GRID) // 2

SLACK = 1e-6
"""By how much of the error a corner of a polytope may seem to break an inequality: rounding of
depths of a metre is a ten-thousandth of that at an error of a micrometre. Keeping a corner too
many only widens a bound."""


@dataclass(frozen=True, eq=False)
class _Corners:
    """Where three of some inequalities are equations: what can be a corner of a polytope."""

    triples: Integers
    """(t, 3) the readings in question."""
    inverses: Floats
    """(t, 3, 3) from what a plane is at these to its two slopes and its height."""
    idle: NDArray[np.bool_]
    """(t, 25) readings that don't bear on it."""

    @classmethod
    def among(cls, readings: Integers) -> _Corners:
        """All corners that three of (k,) readings can make."""
        triples = np.array(list(combinations(readings, 3)))
        matrices = np.concatenate([GRID[triples], np.ones((len(triples), 3, 1))], axis=2)
        # Twice the area of a triangle of the grid, so a whole number; zero is no triangle.
        good = np.abs(np.linalg.det(matrices)) > 0.5
        idle = ~np.isin(np.arange(len(GRID)), readings)
        inverses = np.asarray(np.linalg.inv(matrices[good]), np.float64)
        return cls(triples[good], inverses, np.tile(idle, (len(inverses), 1)))

    def slopes(self, low: Floats, high: Floats) -> Floats:
        """(v, 2) slopes of the corners of a polytope of planes.

        Args:
            low: (25,) the least that a plane may be at each reading, minus infinity for any.
            high: (25,) the most, likewise.
        """
        slack = SLACK * (high[MIDDLE] - low[MIDDLE])
        found = []
        for sides in product((low, high), repeat=3):
            values = np.stack([side[self.triples[:, k]] for k, side in enumerate(sides)], axis=1)
            real = np.isfinite(values).all(axis=1)
            planes = np.einsum("tij,tj->ti", self.inverses[real], values[real])
            at = planes[:, :2] @ GRID.T + planes[:, 2:]
            within = (at >= low - slack) & (at <= high + slack) | self.idle[real]
            found.append(planes[within.all(axis=1), :2])
        return np.concatenate(found)


@cache
def _quarter_corners() -> _Corners:
    """Corners of the sixteen quarters that differ in their readings."""
    bearings = np.arctan2(GRID[:, 1], GRID[:, 0])
    around = np.delete(np.arange(len(GRID)), MIDDLE)
    # The readings lie in 16 directions, a quarter turn maps them onto each other, and so every
    # right angle that starts between two of them holds the next four.
    directions, which = np.unique(np.round(bearings[around], 9), return_inverse=True)
    parts = []
    for first in range(len(directions)):
        held = (which - first) % len(directions) < len(directions) // 4
        parts.append(_Corners.among(np.append(around[held], MIDDLE)))
    return _Corners(
        np.concatenate([part.triples for part in parts]),
        np.concatenate([part.inverses for part in parts]),
        np.concatenate([part.idle for part in parts]),
    )


@cache
def _whole_corners() -> _Corners:
    """Corners of the whole patch."""
    return _Corners.among(np.arange(len(GRID)))


def possible_slopes(residuals: Floats, error: float) -> Floats:
    """How the face under the middle of a patch may slope against the fitted plane.

    Args:
        residuals: (5, 5) how far the readings are beyond the fitted plane, metres.
        error: how far off a reading may be, metres.

    Returns:
        (v, 2) metres a column and a row: corners of what is possible in one of the three cases.
    """
    read = residuals.ravel()
    low, high = read - error, read + error
    bulging, hollow = np.full(len(read), -np.inf), np.full(len(read), np.inf)
    bulging[MIDDLE], hollow[MIDDLE] = low[MIDDLE], high[MIDDLE]
    return np.concatenate(
        [
            _quarter_corners().slopes(low, high),
            _whole_corners().slopes(bulging, high),
            _whole_corners().slopes(low, hollow),
        ]
    )


def normal_bound(
    slopes: Floats, residuals: Floats, spacing: tuple[float, float], error: float
) -> float:
    """The largest angle between a patch's plane and the face under its middle, radians.

    It is pi where it would be beyond a right angle, and if no plane is possible at all: then none
    of the three cases can be.

    Args:
        slopes: (2,) of the fitted plane, metres a column and a row.
        residuals: (5, 5) how far the readings are beyond it, metres.
        spacing: of columns and rows, metres.
        error: how far off a reading may be, metres.
    """
    others = slopes + possible_slopes(residuals, error)
    if not len(others):
        return float(np.pi)
    fitted = np.append(slopes / spacing, 1.0)
    planes = np.column_stack([others / spacing, np.ones(len(others))])
    cosines = planes @ fitted
    if (cosines <= 0.0).any():
        return float(np.pi)
    sines = np.linalg.norm(np.cross(planes, fitted), axis=1)
    return float(np.arctan2(sines, cosines).max())
