"""Probes anywhere."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from .task import Task


class RandomProbe:
    """A triad anywhere in the workspace, at any yaw, uniformly (memo, Section 4.4)."""

    def __init__(self, task: Task | None = None) -> None:
        """Take the task, which it doesn't need."""

    def act(
        self, observation: Mapping[str, NDArray[np.generic]], rng: np.random.Generator
    ) -> NDArray[np.float32]:
        """(3,) x, y and yaw, uniform in [-1, 1]; the observation is not looked at."""
        return rng.uniform(-1.0, 1.0, 3).astype(np.float32)
