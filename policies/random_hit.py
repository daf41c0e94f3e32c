"""Random probes that may touch the object."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..recognizer.predict.prediction import MET_OBJECT, predict
from .outcomes.task import Observation, Task
from .outcomes.weighing import random_action

TRIES = 64
"""Random probes looked at; if no pose says of any that it touches, the first is sent."""


class RandomHit:
    """A random probe of which at least one hypothesis says that it will touch the object.

    Every probe of which that is true is as likely as another. Before the first contact there is no
    hypothesis, and the probe is a random one.
    """

    def __init__(self, task: Task) -> None:
        self.task = task

    def act(self, observation: Observation, rng: np.random.Generator) -> NDArray[np.float32]:
        """(3,) x, y and yaw in [-1, 1]."""
        samples = self.task.samples(observation)
        first = random_action(rng)
        if not len(samples):
            return first
        actions = np.concatenate([first[None], [random_action(rng) for _ in range(TRIES - 1)]])
        told = predict(samples, self.task.space.rays(actions))
        touching = (told.outcomes == MET_OBJECT).any(axis=(0, 2))
        return actions[int(touching.argmax())]
