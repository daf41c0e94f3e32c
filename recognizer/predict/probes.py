"""Triads: the rays that a commanded probe sends (memo, Section 4.4)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

LEVEL, DOWN = np.sqrt(2.0 / 3.0), -np.sqrt(1.0 / 3.0)
"""How far a ray of a triad goes along the plane and upwards, a unit of length."""
MOST_YAW = np.pi / 3.0
"""The yaw at 1, radians: a triad repeats every 2 pi / 3."""


@dataclass(frozen=True, eq=False)
class TriadRays:
    """The rays of a number of probes: ``k`` each, three of a triad, one of a straight touch."""

    starts_world: Floats
    """(a, k, 3) where each ray starts, metres."""
    directions_world: Floats
    """(a, k, 3) unit directions."""


@dataclass(frozen=True)
class ProbeSpace:
    """The probes that may be sent: triads that meet in a square of the plane z = 0, at any yaw."""

    half_width: float
    """Half a side of the square, metres."""
    reach: float
    """How far before the point where they meet the rays start, metres."""

    def rays(self, actions: NDArray[np.floating]) -> TriadRays:
        """The rays that actions stand for.

        Args:
            actions: (a, 3) x, y and yaw, each in [-1, 1].
        """
        actions = np.asarray(actions, np.float64)
        yaws = MOST_YAW * actions[:, 2, None] + np.array([0.0, 2.0, 4.0]) * np.pi / 3.0
        directions = np.stack(
            [LEVEL * np.cos(yaws), LEVEL * np.sin(yaws), np.full(yaws.shape, DOWN)], axis=2
        )
        meeting = np.zeros((len(actions), 1, 3))
        meeting[:, 0, :2] = self.half_width * actions[:, :2]
        return TriadRays(meeting - self.reach * directions, directions)
