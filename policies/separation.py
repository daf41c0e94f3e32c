"""The probe at which all rivals answer differently: Gaston and Lozano-Pérez's next point."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .outcomes.outcomes import Outcomes
from .outcomes.task import Observation, Task
from .outcomes.weighing import best_probe

Floats = NDArray[np.float64]

ENOUGH = 1.0
"""Two reports this far apart, in twice the bounds, are told apart whatever the noise."""


class Separation:
    """``argmax_a min_{i<j} D(z_i, z_j)``: keep the two most alike predictions apart.

    ``D`` is the difference in depth over twice the bound on positions, or the angle between the
    normals over twice that on normals, whichever is more, of the ray that differs most; infinite
    between touch and miss. As long as there are many rivals, some two of them look alike from
    everywhere and the minimum is zero; among probes alike in it, the one with the larger mean of
    ``min(D, 1)`` over pairs is sent, each pair by its weight.

    P. C. Gaston and T. Lozano-Pérez, "Tactile Recognition and Localization Using Object Models: The
    Case of Polyhedra on a Plane", IEEE PAMI 6(3), 1984, look for the point where the contacts of
    all interpretations are widely separated.

    Before the first contact the probe is random; where no two answers are told apart, it settles
    the pose (`weighing.settling_probe`).
    """

    def __init__(self, task: Task) -> None:
        self.task = task

    def act(self, observation: Observation, rng: np.random.Generator) -> NDArray[np.float32]:
        """(3,) x, y and yaw in [-1, 1]."""
        return best_probe(self.task, observation, rng, separation)


def separation(outcomes: Outcomes) -> Floats:
    """(a,) the least distance of two rivals, capped at 1, and in ties their mean distance."""
    distances = np.minimum(outcomes.distances, ENOUGH)
    rivals = ~outcomes.same
    if not rivals.any():
        return np.zeros(len(outcomes.actions))
    both = np.maximum(distances, distances.transpose(0, 2, 1))
    least = both[:, rivals].min(axis=1)
    mean = outcomes.expected(np.einsum("aij,j->ai", distances, outcomes.weights))
    return least + mean
