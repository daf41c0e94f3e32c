"""The probe that cuts most of what matters to the decision."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .outcomes.outcomes import Outcomes
from .outcomes.rivals import answers
from .outcomes.task import Observation, Task
from .outcomes.weighing import best_probe

Floats = NDArray[np.float64]


class DecisionRegion:
    """Expected weight of edges cut between poses that lead to different decisions.

    A decision is an object, or an object and a pose up to tolerance and symmetry. An edge joins any
    two poses of different decisions and weighs ``w_j w_k``; a report cuts it as soon as it removes
    either end. With ``b_ic`` the weight that a report of pose ``i`` leaves in decision ``c``, what
    remains is ``((sum_c b_ic)^2 - sum_c b_ic^2) / 2``, and the probe with the least of it in
    expectation over ``i`` is sent: poses of one decision need not be told apart.

    D. Golovin, A. Krause and D. Ray, "Near-optimal Bayesian active learning with noisy
    observations", NIPS 2010 (EC2); for decisions about grasps, S. Javdani et al., "Near optimal
    Bayesian active learning for decision making", AISTATS 2014.

    Before the first contact the probe is random; where no two decisions are told apart, it settles
    the pose (`weighing.settling_probe`).
    """

    def __init__(self, task: Task) -> None:
        self.task = task

    def act(self, observation: Observation, rng: np.random.Generator) -> NDArray[np.float32]:
        """(3,) x, y and yaw in [-1, 1]."""
        return best_probe(self.task, observation, rng, edges_cut)


def edges_cut(outcomes: Outcomes) -> Floats:
    """(a,) the share of the weight of edges that a probe is expected to cut."""
    weights = outcomes.weights
    decisions = answers(outcomes.same, weights)
    total = 1.0 - float((np.bincount(decisions, weights) ** 2).sum())
    if decisions.max() == 0 or total <= 0.0:
        return np.zeros(len(outcomes.actions))
    order = np.argsort(decisions, kind="stable")
    first = np.flatnonzero(np.diff(decisions[order], prepend=-1))
    left = outcomes.left[:, :, order] * weights[order].astype(np.float32)
    left = np.add.reduceat(left, first, axis=2)
    remaining = left.sum(axis=2) ** 2 - (left**2).sum(axis=2)
    return 1.0 - outcomes.expected(remaining) / total
