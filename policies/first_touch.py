"""Touches before the first contact: across a region, from where nothing has been yet."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..recognizer import FreeSpace
from .outcomes.reports import Purpose, Suggestion
from .straight import Reach

Floats = NDArray[np.float64]

SIDE = 5
"""Touches along either side of a region's cross-section that are thought of."""
STOPS = 9
"""Points of a way at which it is looked how near another has come."""


def first_touches(reach: Reach, misses: FreeSpace, count: int) -> tuple[Suggestion, ...]:
    """Touches to find a part with: the middle first, then as far as can be from all before.

    They go along the first of the named directions, straight down if there is a choice, and along
    others where none of these can be made. What has missed counts as made.

    Args:
        reach: which touches can be made.
        misses: ways that met nothing.
        count: how many touches, at most.
    """
    grids = (reach.grid(direction, SIDE) for direction in reach.named)
    touches = next((grid for grid in grids if len(grid)), None)
    if touches is None:
        return ()
    stops = np.linspace(0.0, 1.0, STOPS)[:, None]
    ways = (
        touches.starts[:, None] + stops * (touches.lengths[:, None] * touches.directions)[:, None]
    )
    size = reach.region.diagonal
    apart = np.full(len(touches), size)
    for start, end in zip(misses.starts, misses.ends, strict=True):
        apart = np.minimum(apart, _mean_distance(ways, start, end))
    # Of touches as far from all that was tried, the one nearest to the middle.
    central = np.linalg.norm(ways.mean(axis=1) - reach.region.middle, axis=1)
    chosen: list[Suggestion] = []
    for _ in range(min(count, len(touches))):
        best = int(np.argmax(apart - 1e-6 * central))
        if apart[best] <= 0.0:
            break
        start, direction = touches.starts[best], touches.directions[best]
        length = float(touches.lengths[best])
        score = float(apart[best] / size)
        chosen.append(Suggestion(start, direction, length, Purpose.FIND, score, 0.0, ()))
        apart = np.minimum(apart, _mean_distance(ways, start, start + length * direction))
        apart[best] = 0.0
    return tuple(chosen)


def _mean_distance(ways: Floats, start: Floats, end: Floats) -> Floats:
    """(a,) how far, on average, points of ways (a, k, 3) are from a segment, metres."""
    along = end - start
    squared = max(float(along @ along), np.finfo(float).tiny)
    share = np.clip((ways - start) @ along / squared, 0.0, 1.0)
    return np.linalg.norm(ways - start - share[..., None] * along, axis=2).mean(axis=1)
