"""The probe that best fixes the pose of the one hypothesis left."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .information import Information
from .outcomes.outcomes import Outcomes
from .outcomes.pose_information import gain
from .outcomes.task import Observation, Task
from .outcomes.weighing import expected_gain, settling_probe

Floats = NDArray[np.float64]


class Refine:
    """``argmax_a log det(L + J_a^T J_a / sigma^2)``: D-optimal choice of contacts.

    ``L`` is what the contacts so far tell of the pose of the hypothesis left, and a row of ``J`` is
    ``n . [-[arm]x, I]`` for a ray that is predicted to touch a face with normal ``n``, ``arm`` away
    from the centroid; normals felt add their part. A probe that misses adds nothing.

    V. V. Fedorov, "Theory of Optimal Experiments", 1972; for localising by touch, A. Petrovskaya
    and O. Khatib, "Global localization of objects via touch", IEEE T-RO 27(3), 2011.

    As long as several hypotheses are left the probe is that of `information`, and before the first
    contact a random one.
    """

    def __init__(self, task: Task) -> None:
        self.task = task
        self._until_then = Information(task)

    def act(self, observation: Observation, rng: np.random.Generator) -> NDArray[np.float32]:
        """(3,) x, y and yaw in [-1, 1]."""
        if int(observation["hypothesis_count"][0]) != 1:
            return self._until_then.act(observation, rng)
        return settling_probe(self.task, observation, rng, log_determinant)


def log_determinant(observation: Observation, outcomes: Outcomes) -> Floats:
    """(a,) by how much each probe is expected to raise the log determinant of the information."""
    return expected_gain(observation, outcomes, lambda _, before, added: gain(before, added))
