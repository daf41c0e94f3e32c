"""The probe that is expected to tell most, in bits or nats."""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import NDArray

from .outcomes.outcomes import Outcomes
from .outcomes.task import Observation, Task
from .outcomes.weighing import best_probe, precision

Floats = NDArray[np.float64]


class Information:
    """``argmax_a I(answer, pose; z_a)``: expected information gain.

    The outcome bins are soft: a pose belongs to the bin of another's report as far as noise and the
    poses' spread let it explain that, ``m_ij``. What a report tells is then
    ``-sum_i p_i log sum_j w_j m_ij``. If the goal is a pose, that is taken apart by the chain rule:
    what is told of the hypothesis, from the bins, and what is told of the pose within it, by a
    local normal law and as far as the goal's tolerance cares (`weighing.precision`).

    D. V. Lindley, "On a measure of the information provided by an experiment", 1956; for touch,
    K. Hsiao, L. Kaelbling and T. Lozano-Pérez, "Robust grasping under object pose uncertainty",
    Autonomous Robots 31, 2011.

    Before the first contact the probe is random; where no candidate tells anything, it settles the
    pose (`weighing.settling_probe`).
    """

    def __init__(self, task: Task) -> None:
        self.task = task

    def act(self, observation: Observation, rng: np.random.Generator) -> NDArray[np.float32]:
        """(3,) x, y and yaw in [-1, 1]."""
        return best_probe(self.task, observation, rng, partial(information, self.task, observation))


def information(task: Task, observation: Observation, outcomes: Outcomes) -> Floats:
    """(a,) nats about the answer and, if the goal is a pose, about the pose within it."""
    if task.goal == "object":
        return gain_of_answers(outcomes.left, outcomes.weights, outcomes.chances)
    return gain_of_hypotheses(outcomes) + precision(observation, outcomes)


def gain_of_hypotheses(outcomes: Outcomes) -> Floats:
    """(a,) nats about which hypothesis holds: of what is told of poses, not that within a family.

    ``-sum_i p_i log(sum_j w_j m_ij / sum_{j in h(i)} w_j m_ij * w_h(i))``.
    """
    weights, families = outcomes.weights, outcomes.samples.hypotheses
    family = families[:, None] == families
    shares = weights / np.einsum("ij,j->i", family, weights)[:, None]
    within = np.einsum("aij,ij->ai", outcomes.left, family * shares)
    told = gain_of_answers(outcomes.left, weights, outcomes.chances)
    return told + outcomes.expected(np.log(np.maximum(within, 1e-30)))


def gain_of_answers(left: NDArray[np.float32], weights: Floats, chances: Floats) -> Floats:
    """``-sum_i p_i log sum_j w_j m_ij``, in nats.

    Args:
        left: (..., s, s) how likely pose j is to be left by a report of pose i.
        weights: (s,) how much each counts as a rival.
        chances: (s,) how likely each is the true one.
    """
    # A pose of no weight has no bin to speak of; a report of it doesn't come either.
    bins = np.maximum(np.einsum("...ij,j->...i", left, weights), 1e-30)
    return -np.einsum("...i,i->...", np.log(bins), chances)
