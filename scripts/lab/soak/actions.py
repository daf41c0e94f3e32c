"""Actions that are random, extreme, or none at all."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

EXTREME_SHARE = 0.1
"""Of the actions, how many are extreme."""

EXTREMES: tuple[Callable[[NDArray[np.float64]], Any], ...] = (
    lambda at: np.sign(at).astype(np.float32),  # a corner of the box
    lambda at: np.where(at == at.max(), np.sign(at), at),  # a side of it
    lambda at: np.zeros_like(at),
    lambda at: 3.0 * np.sign(at) + at,  # beyond it
    lambda at: 1e30 * at,
    lambda at: np.copysign(np.finfo(np.float64).max, at),
    lambda at: np.copysign(np.finfo(np.float64).smallest_subnormal, at),
    lambda at: at.astype(np.float16),
    lambda at: np.repeat(at, 2)[::2],  # not in one piece
    lambda at: at.tolist(),
    lambda at: np.sign(at).astype(int).tolist(),
    lambda at: tuple(at),
)
"""Made of an action in the box; each is to be taken, to the nearest one in the box."""

REFUSED: tuple[Callable[[NDArray[np.float64]], Any], ...] = (
    lambda at: np.full_like(at, np.nan),
    lambda at: np.where(at == at.max(), np.nan, at),
    lambda at: np.where(at == at.max(), np.inf, at),
    lambda at: np.full(len(at), -np.inf, np.float32),
    lambda at: [*at.tolist()[:-1], float("nan")],
    lambda at: at[:-1],
    lambda at: np.append(at, 0.0),
    lambda at: at[None],
    lambda at: float(at[0]),
    lambda at: [],
    lambda at: None,
    lambda at: "probe",
    lambda at: [at.tolist(), [0.0]],
)
"""Likewise; each is to be refused with a ValueError."""


def draw_action(rng: np.random.Generator, numbers: int) -> Any:
    """An action that is to be taken: random in the box, or now and then extreme."""
    inside = rng.uniform(-1.0, 1.0, numbers)
    if rng.random() < EXTREME_SHARE:
        return EXTREMES[int(rng.integers(len(EXTREMES)))](inside)
    return inside.astype(np.float32)


def draw_refused(rng: np.random.Generator, numbers: int) -> Any:
    """What is no action."""
    inside = rng.uniform(-1.0, 1.0, numbers)
    return REFUSED[int(rng.integers(len(REFUSED)))](inside)
