"""Compile the sensors' kernels once, so that the first touch doesn't wait."""

from __future__ import annotations

import numpy as np

from .sensors.noise import SensorNoise


def warm_up() -> None:
    """Blur a touch."""
    noise = SensorNoise(position_error=0.01, normal_error=0.1)
    noise.blur(np.random.default_rng(0), np.ones(1, np.int8), np.zeros((1, 3)), np.eye(3)[:1])


PARTS = (warm_up,)
"""What can be compiled independently of all else."""
