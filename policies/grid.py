"""Probes on a regular grid."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .outcomes.task import Observation, Task
from .outcomes.weighing import as_action

SIDE = 5
"""Points of the grid along either side of the workspace."""
RAYS = 3
"""Of a triad."""


class Grid:
    """The memo's regular grid along three orthogonal directions (Section 4.3).

    The triads of one yaw meet in the middles of ``5 x 5`` equal squares of the workspace, so each
    of their three rays walks a regular grid along its own direction. They are sent far apart first,
    as the memo sorts its contacts; once the grid is through, it starts over at a yaw between the
    last. What has been found is not looked at, only how many rays were sent.
    """

    def __init__(self, task: Task) -> None:
        self.task = task
        middles = (2.0 * np.arange(SIDE) + 1.0) / SIDE - 1.0
        points = np.stack(np.meshgrid(middles, middles, indexing="ij"), axis=-1).reshape(-1, 2)
        self._points = points[_far_apart_first(points)]

    def act(self, observation: Observation, rng: np.random.Generator) -> NDArray[np.float32]:
        """(3,) x, y and yaw in [-1, 1]."""
        sent = int(observation["ray_count"][0]) // RAYS
        rounds, place = divmod(sent, len(self._points))
        return as_action(np.append(self._points[place], _halving(rounds)))


def _far_apart_first(points: NDArray[np.float64]) -> list[int]:
    """An order in which each point is as far as can be from all before it; the middle first."""
    order = [int(np.linalg.norm(points, axis=1).argmin())]
    nearest = np.full(len(points), np.inf)
    while len(order) < len(points):
        nearest = np.minimum(nearest, np.linalg.norm(points - points[order[-1]], axis=1))
        order.append(int(nearest.argmax()))
    return order


def _halving(number: int) -> float:
    """0, then points of [-1, 1) that halve the gaps between those before (van der Corput)."""
    value, share = 0.0, 0.5
    while number:
        value += share * (number & 1)
        number, share = number >> 1, 0.5 * share
    return float(np.mod(2.0 * value + 1.0, 2.0) - 1.0)
