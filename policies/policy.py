"""What a strategy is: observation in, probe out."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

import numpy as np
from numpy.typing import NDArray


class Policy(Protocol):
    """Chooses the next probe from what has been observed, and from nothing else."""

    def act(
        self, observation: Mapping[str, NDArray[np.generic]], rng: np.random.Generator
    ) -> NDArray[np.float32]:
        """The next probe.

        Args:
            observation: as `palpate/Probe-v0` gives it.
            rng: source of randomness.

        Returns:
            (3,) x, y and yaw of the triad, each in [-1, 1].
        """
        ...
