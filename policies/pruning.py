"""The probe that is expected to remove most of the belief."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .outcomes.outcomes import Outcomes
from .outcomes.task import Observation, Task
from .outcomes.weighing import best_probe

Floats = NDArray[np.float64]


class Pruning:
    """``argmax_a sum_i p_i sum_j w_j (1 - P(j left | i true))``: hypothesis pruning.

    The expected weight of hypotheses removed. It is adaptive submodular, so the greedy choice is
    nearly the best of any: S. Javdani, M. Klingensmith, J. A. Bagnell, N. S. Pollard and
    S. S. Srinivasa, "Efficient touch based localization through submodularity", ICRA 2013
    (weighted hypothesis pruning: noise removes a hypothesis in part).

    Before the first contact the probe is random; where no two answers are told apart, it settles
    the pose (`weighing.settling_probe`).
    """

    def __init__(self, task: Task) -> None:
        self.task = task

    def act(self, observation: Observation, rng: np.random.Generator) -> NDArray[np.float32]:
        """(3,) x, y and yaw in [-1, 1]."""
        return best_probe(self.task, observation, rng, weight_removed)


def weight_removed(outcomes: Outcomes) -> Floats:
    """(a,) the share of the belief that a probe is expected to remove."""
    return outcomes.expected(1.0 - outcomes.kept)
