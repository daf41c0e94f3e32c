"""Probes anywhere."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .outcomes.task import Observation, Task
from .outcomes.weighing import random_action


class RandomProbe:
    """A triad anywhere in the workspace, at any yaw, uniformly (memo, Section 4.4)."""

    def __init__(self, task: Task) -> None:
        self.task = task

    def act(self, observation: Observation, rng: np.random.Generator) -> NDArray[np.float32]:
        """(3,) x, y and yaw, uniform in [-1, 1]; the observation is not looked at."""
        return random_action(rng)
