"""The probe after which least is left at worst."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .outcomes.outcomes import Outcomes
from .outcomes.task import Observation, Task
from .outcomes.weighing import best_probe

Floats = NDArray[np.float64]

TIE = 1e-2
"""What the expected share counts beside the worst: enough to decide between probes alike in it."""
UNLIKELY = 0.05
"""A pose less likely than this, beside the likeliest, isn't reckoned with as the worst case."""


class Minimax:
    """``argmin_a max_i sum_j w_j P(j left | i true)``: the lightest heaviest outcome bin.

    The bin of a report holds every pose that it would leave standing. A pose that a probe misses
    leaves everything where a miss is no evidence, so at first the worst is often all; then the
    expected share decides.

    The rule is D. E. Knuth's for Mastermind ("The computer as master mind", 1977): what is left at
    worst counts.

    Before the first contact the probe is random; where no two answers are told apart, it settles
    the pose (`weighing.settling_probe`).
    """

    def __init__(self, task: Task) -> None:
        self.task = task

    def act(self, observation: Observation, rng: np.random.Generator) -> NDArray[np.float32]:
        """(3,) x, y and yaw in [-1, 1]."""
        return best_probe(self.task, observation, rng, worst_case, least=1e-2 * TIE)


def worst_case(outcomes: Outcomes) -> Floats:
    """(a,) the share of the belief that goes at worst, and a little of what is expected to."""
    gone = 1.0 - outcomes.left @ outcomes.weights.astype(np.float32)
    likely = outcomes.chances >= UNLIKELY * outcomes.chances.max()
    return gone[:, likely].min(axis=1) + TIE * outcomes.expected(gone)
