"""The middle of the largest region of probes that tell the rivals apart."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, label

from .outcomes.outcomes import Outcomes
from .outcomes.task import Observation, Task
from .outcomes.weighing import (
    TELLS_NOTHING,
    Budget,
    as_action,
    chances_of,
    random_action,
    settling_probe,
    weighed,
)
from .pairs import pairs_told_apart

Floats = NDArray[np.float64]

YAWS, SIDE = 6, 8
"""Directions of triads looked at, and cells of the ray grid along either side of the workspace."""
THOROUGH = 32
"""Cells that are looked at thoroughly, at least."""
BUDGET = Budget(samples=40)
"""Fewer poses than other strategies have: each is held against all others in many cells."""
NEARLY = 0.9
"""A cell counts as safe if it tells at least this share of what the best cell does."""


class SafeRegion:
    """Probe where aiming error can't hurt: the centre of the largest safe region.

    For each of some directions of the triad, the workspace is cut into cells. A cell is safe if a
    probe there tells all pairs of rivals apart, their predicted intervals being disjoint; if no
    cell does, if it tells most: `NEARLY` as much weight of pairs as the best cell of all. Safe
    cells that share a side are a region; that with the largest clear disc around a cell is probed
    there, and of several such the one whose cell tells most.

    W. E. L. Grimson, "Disambiguating sensory interpretations using minimal sets of sensory data",
    ICRA 1986, and "Sensing strategies for disambiguating among multiple objects in known poses",
    IEEE J-RA 2(4), 1986.

    Only the cells that seem to tell most are looked at thoroughly; the others are not safe. The
    directions turn by a random angle each time. Before the first contact the probe is random;
    where no two answers are told apart, it settles the pose (`weighing.settling_probe`).
    """

    def __init__(self, task: Task) -> None:
        self.task = task

    def act(self, observation: Observation, rng: np.random.Generator) -> NDArray[np.float32]:
        """(3,) x, y and yaw in [-1, 1]."""
        samples = weighed(self.task, observation, BUDGET)
        if not len(samples):
            return random_action(rng)
        actions = ray_grid(YAWS, SIDE, rng.random())
        chances = chances_of(self.task, observation, samples)
        outcomes = Outcomes.of(self.task, samples, actions.reshape(-1, 3), chances)
        told = pairs_told_apart(outcomes)
        short = np.argsort(-told, kind="stable")[: max(BUDGET.shortlist(len(samples)), THOROUGH)]
        looked = pairs_told_apart(outcomes.thoroughly(short))
        told[:] = 0.0
        told[short] = looked
        if told.max() < TELLS_NOTHING:
            return settling_probe(self.task, observation, rng)
        return as_action(actions[safest_cell(told.reshape(YAWS, SIDE, SIDE))])


def ray_grid(yaws: int, side: int, turn: float) -> Floats:
    """(yaws, side, side, 3) probes in the middles of cells; ``turn`` shifts the yaws, in steps."""
    middles = (2.0 * np.arange(side) + 1.0) / side - 1.0
    turns = 2.0 * (np.arange(yaws) + turn) / yaws - 1.0
    yaw, x, y = np.meshgrid(turns, middles, middles, indexing="ij")
    return np.stack([x, y, yaw], axis=-1)


def connected(layer: NDArray[np.bool_]) -> tuple[NDArray[np.int32], int]:
    """Regions of cells that share a side, numbered from 1, and how many there are."""
    regions = np.empty(layer.shape, np.int32)
    return regions, int(label(layer, output=regions))  # pyright: ignore[reportArgumentType]


def safest_cell(told: Floats) -> tuple[int, int, int]:
    """The yaw and cell in the middle of the largest region of safe ones.

    Args:
        told: (yaws, side, side) the weight of pairs that each cell tells apart.
    """
    safe = told >= NEARLY * told.max()
    best: tuple[float, int, float] = (-1.0, -1, -1.0)
    chosen = (0, 0, 0)
    for yaw, layer in enumerate(safe):
        regions, count = connected(layer)
        # A miss of the workspace isn't safe: its border bounds a region like any unsafe cell.
        clear = np.asarray(distance_transform_edt(np.pad(layer, 1)))[1:-1, 1:-1]
        for region in range(1, count + 1):
            own = regions == region
            middle = np.where(own, clear + 1e-6 * told[yaw], -1.0)
            x, y = np.unravel_index(int(middle.argmax()), own.shape)
            size = (float(clear[x, y]), int(own.sum()), float(told[yaw, x, y]))
            if size > best:
                best, chosen = size, (yaw, int(x), int(y))
    return chosen
