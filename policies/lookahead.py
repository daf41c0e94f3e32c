"""The probe that tells most together with the next."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .information import gain_of_answers, information
from .outcomes.task import Observation, Task
from .outcomes.weighing import best_probe

Floats = NDArray[np.float64]

FIRST, SECOND = 16, 48
"""How many of the best probes are thought of as the first, and as the second of two."""


class Lookahead:
    """``argmax_a max_b I(answer; z_a, z_b)``: two probes ahead.

    The joint bins are the products of the single ones: a pose is left by both reports if by each.
    The best few probes by `information` are paired with some more of them, and what either tells of
    the pose within an answer counts half, as one of them comes later.

    Looking further than the greedy choice pays where two probes tell together what neither does
    alone: K. Hsiao, L. P. Kaelbling and T. Lozano-Pérez, "Task-driven tactile exploration", RSS
    2010.

    Before the first contact the probe is random; where no candidate tells anything, it settles the
    pose (`weighing.settling_probe`).
    """

    def __init__(self, task: Task) -> None:
        self.task = task

    def act(self, observation: Observation, rng: np.random.Generator) -> NDArray[np.float32]:
        """(3,) x, y and yaw in [-1, 1]."""
        return best_probe(
            self.task,
            observation,
            rng,
            lambda outcomes: two_ahead(
                outcomes.left,
                outcomes.weights,
                outcomes.chances,
                information(self.task, observation, outcomes),
            ),
        )


def two_ahead(left: NDArray[np.float32], weights: Floats, chances: Floats, alone: Floats) -> Floats:
    """(a,) what each probe tells together with the best second; of the worst at first, nothing.

    Args:
        left: (a, s, s) how likely pose j is to be left by a report of pose i.
        weights: (s,) how much each counts as a rival.
        chances: (s,) how likely each is the true one.
        alone: (a,) what each probe tells alone, nats.
    """
    order = np.argsort(-alone, kind="stable")
    beyond = np.maximum(alone - gain_of_answers(left, weights, chances), 0.0)
    seconds = order[:SECOND]
    worth = np.zeros(len(alone))
    for first in order[:FIRST]:
        joint = gain_of_answers(left[first] * left[seconds], weights, chances)
        joint += 0.5 * (beyond[first] + beyond[seconds])
        # The tie goes to what tells more at once.
        worth[first] = joint.max() + 0.1 * alone[first]
    return worth
