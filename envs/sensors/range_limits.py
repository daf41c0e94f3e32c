"""What range sensors refuse, with a word on what would do."""

from __future__ import annotations

import numpy as np

MOST_RAYS = 1_000_000
"""The most rays of one image, or of a probe's grids."""


def check_lengths(**lengths: float) -> None:
    """Refuse lengths that aren't above zero, by their names."""
    for name, value in lengths.items():
        if not (np.isfinite(value) and value > 0.0):
            raise ValueError(f"{name} is {value:g} m; it must be above zero")


def check_count(rays: int) -> None:
    """Refuse more rays than a probe can sensibly send."""
    if rays > MOST_RAYS:
        raise ValueError(f"{rays} rays a probe, and {MOST_RAYS} is the most; widen the spacing")


def check_start(lowest: float, reach: float, width: float) -> None:
    """Refuse rays that start below the plane: ``lowest`` is the height of the lowest, metres."""
    if lowest <= 0.0:
        raise ValueError(
            f"reach is {reach:g} m, and with a width of {width:g} m some rays would start below"
            " the plane; ask for more"
        )
