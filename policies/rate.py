"""The probe that tells most a second."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .information import information
from .outcomes.outcomes import Outcomes
from .outcomes.task import Observation, Task
from .outcomes.weighing import best_probe

Floats = NDArray[np.float64]


class Rate:
    """``argmax_a I(a) / T(a)``: information a second of travel, probing and computing.

    ``I`` is that of `information`. ``T`` is the way from where the last probe began to where this
    one begins, at the speed of travel; the way down each ray as far as it is expected to go and
    back, at the speed of a guarded move; and the time to think.

    Information a cost as the greedy choice for sensing: A. Krause and C. Guestrin, "A note on the
    budgeted maximization of submodular functions", 2005.

    Before the first contact the probe is random; where no candidate tells anything, it settles the
    pose (`weighing.settling_probe`).
    """

    def __init__(
        self,
        task: Task,
        *,
        travel_speed: float = 0.25,
        probe_speed: float = 0.02,
        probe_length: float = 0.05,
        thinking: float = 0.1,
    ) -> None:
        """Set what time is spent on.

        Args:
            task: what is public of the episode.
            travel_speed: of free motion, metres a second: that of a slow arm.
            probe_speed: of a guarded move, metres a second.
            probe_length: of each ray, the last part before where it is predicted to touch that is
                gone at the speed of a guarded move, metres; the rest is travel.
            thinking: seconds a probe.

        Raises:
            ValueError: a speed or a time that isn't above zero, a length below zero.
        """
        for name, value in (
            ("travel_speed", travel_speed),
            ("probe_speed", probe_speed),
            ("thinking", thinking),
        ):
            if not value > 0.0:
                raise ValueError(f"{name} is {value}; it must be above zero")
        if not probe_length >= 0.0:
            raise ValueError(f"probe_length is {probe_length}; it must be zero or more")
        self.task = task
        self._travel_speed, self._probe_speed = travel_speed, probe_speed
        self._probe_length, self._thinking = probe_length, thinking

    def act(self, observation: Observation, rng: np.random.Generator) -> NDArray[np.float32]:
        """(3,) x, y and yaw in [-1, 1]."""
        return best_probe(
            self.task,
            observation,
            rng,
            lambda outcomes: (
                information(self.task, observation, outcomes) / self.seconds(observation, outcomes)
            ),
            least=1e-4,
        )

    def seconds(self, observation: Observation, outcomes: Outcomes) -> Floats:
        """(a,) how long each probe takes.

        Args:
            observation: tells where the last ray ended.
            outcomes: what is predicted of the probes.
        """
        starts = outcomes.rays.starts_world
        expected = np.einsum("s,sak->ak", outcomes.chances, outcomes.predictions.depths)
        guarded = np.minimum(expected, self._probe_length)
        between = np.linalg.norm(np.roll(starts, -1, axis=1) - starts, axis=2)[:, :2].sum(axis=1)
        sent = int(observation["ray_count"][0])
        last = observation["ray_starts"][sent - 1] if sent else starts[:, 0].mean(axis=0)
        travel = np.linalg.norm(starts[:, 0] - last, axis=1) + between
        travel += (2.0 * expected - guarded).sum(axis=1)
        return (
            travel / self._travel_speed + guarded.sum(axis=1) / self._probe_speed + self._thinking
        )
