"""The probe that tells most pairs of rivals apart."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .outcomes.outcomes import Outcomes
from .outcomes.task import Observation, Task
from .outcomes.weighing import best_probe

Floats = NDArray[np.float64]


class Pairs:
    """``argmax_a sum_{i,j} p_i w_j [z_i tells j from i]``: greedy discriminating set.

    A pair counts if the noise can't make up for what the two poses predict: the depths differ by
    more than twice the bound (and the poses' own spread), or the normals do, or one touches where
    the other doesn't. To cover all pairs with as few probes as can be is a set cover, for which the
    greedy choice is the classical one (D. S. Johnson, 1974; for tests that tell faults apart,
    M. R. Garey and R. L. Graham, "Performance bounds on the splitting algorithm for binary
    testing", Acta Informatica 3, 1974).

    Before the first contact the probe is random; where no two answers are told apart, it settles
    the pose (`weighing.settling_probe`).
    """

    def __init__(self, task: Task) -> None:
        self.task = task

    def act(self, observation: Observation, rng: np.random.Generator) -> NDArray[np.float32]:
        """(3,) x, y and yaw in [-1, 1]."""
        return best_probe(self.task, observation, rng, pairs_told_apart)


def pairs_told_apart(outcomes: Outcomes) -> Floats:
    """(a,) the weight of ordered pairs of which the report of the first rules out the second."""
    told = np.einsum("aij,j->ai", outcomes.distances > 1.0, outcomes.weights)
    return outcomes.expected(told)
