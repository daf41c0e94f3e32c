"""Bounds on what is felt, as the memo gives them."""

from __future__ import annotations

import numpy as np

from ...envs.probe_env import INCH
from ...envs.sensors.noise import SensorNoise

__all__ = ["noise_of"]


def noise_of(pi_over: float, inches: float) -> SensorNoise:
    """Bounds as the memo gives them: pi over a number, radians, and inches."""
    return SensorNoise(position_error=inches * INCH, normal_error=np.pi / pi_over)
