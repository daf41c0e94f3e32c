"""Thousands of random actions in one environment, and what came of them."""

from __future__ import annotations

import ctypes
import sys
import traceback
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

from ....envs.observation import Observation
from ....envs.planar.planar_env import PlanarProbeEnv
from ....envs.probe_env import ProbeEnv
from .actions import draw_action, draw_refused
from .paths import WatchedFinger, judge_last_probe

REFUSED_SHARE = 0.05
"""Of the steps, before how many something is sent that is no action."""
PLAYED_ON = 0.1
"""Of the episodes, how many are stepped on after their end."""
MOST_PLAYED_ON = 5
"""How many steps, at the most."""
QUARTERS = 4
"""Memory is least in the second quarter of the episodes, when every object has been touched, and in
the last. The least, because a belief of many hypotheses takes some while it lasts."""


@dataclass(kw_only=True)
class Soaked:
    """What came of soaking one environment."""

    steps: int = 0
    interrupted: bool = False
    episodes: int = 0
    raised: list[str] = field(default_factory=list)
    """What a step raised that should have been taken, and where."""
    refused: int = 0
    """Actions that are none, and were refused as such."""
    taken: list[str] = field(default_factory=list)
    """Actions that are none, and were not refused as is proper."""
    not_numbers: int = 0
    """Observations, rewards and poses that aren't finite."""
    outside: int = 0
    """Observations that aren't in their space."""
    ways: int = 0
    """Paths held against the object."""
    passed: list[str] = field(default_factory=list)
    """Those that went through it."""
    beyond: float = -np.inf
    """The farthest that any went beyond the first touch, metres."""
    tip_depth: float | None = None
    """The deepest that a finger's tip was in anything, metres."""
    memory: list[int] = field(default_factory=list)
    """Resident at the start of each episode, bytes."""
    seconds: list[float] = field(default_factory=list)
    """Processor time of each step."""

    @property
    def warm_memory(self) -> int:
        """The least in the second quarter of the episodes, bytes."""
        quarter = len(self.memory) // QUARTERS
        return min(self.memory[quarter : 2 * quarter + 1])

    @property
    def growth(self) -> int:
        """Of memory, from there to the least in the last quarter, bytes."""
        return min(self.memory[-1 - len(self.memory) // QUARTERS :]) - self.warm_memory


class Soak:
    """One environment under random actions."""

    def __init__(self, env: ProbeEnv | PlanarProbeEnv, seed: int) -> None:
        """Prepare; episode k is reset with ``seed`` + k, and its actions are drawn from that."""
        self._env, self._seed = env, seed
        self._numbers = int(np.prod(env.action_space.shape or ()))
        self._episode = seed - 1
        self._left = 0
        self.found = Soaked()

    def run(self, steps: Iterable[int]) -> Soaked:
        """Take a step for each of ``steps``; an interrupt ends it early."""
        found = self.found
        self._begin()
        try:
            for _ in steps:
                self._step()
        except KeyboardInterrupt:
            found.interrupted = True
        self._env.reset()
        found.memory.append(resident_memory())
        if isinstance(self._env, ProbeEnv) and isinstance(self._env.sensors[0], WatchedFinger):
            found.tip_depth = self._env.sensors[0].deepest
        return found

    def _begin(self) -> None:
        self._episode += 1
        self._rng = np.random.default_rng([self._episode, 1])
        observation, info = self._env.reset(seed=self._episode)
        self._look(observation, 0.0, info)
        self.found.episodes += 1
        self.found.memory.append(resident_memory())
        self._left = -1
        if self._rng.random() < PLAYED_ON:
            self._left = int(self._rng.integers(MOST_PLAYED_ON))

    def _step(self) -> None:
        """One action; a new episode where one is over."""
        rng, found = self._rng, self.found
        if rng.random() < REFUSED_SHARE:
            self._send_none(draw_refused(rng, self._numbers))
        action = draw_action(rng, self._numbers)
        found.steps += 1
        started = process_time()
        try:
            observation, reward, terminated, truncated, info = self._env.step(action)
        except Exception:
            found.raised.append(f"{self._place(action)}\n{traceback.format_exc()}")
            self._begin()
            return
        found.seconds.append(process_time() - started)
        self._look(observation, reward, info)
        self._judge(action, info)
        if terminated or truncated:
            self._left -= 1
            if self._left < 0:
                self._begin()

    def _send_none(self, action: Any) -> None:
        """Send what is no action: it is to be refused, and to change nothing."""
        env, found = self._env, self.found
        before = (len(env.touches), env.np_random.bit_generator.state)
        try:
            env.step(action)
        except ValueError:
            if (len(env.touches), env.np_random.bit_generator.state) == before:
                found.refused += 1
            else:
                found.taken.append(f"{self._place(action)}: refused, but not without a trace")
        except Exception as error:
            found.taken.append(f"{self._place(action)}: {type(error).__name__}: {error}")
        else:
            found.taken.append(f"{self._place(action)}: taken")

    def _look(self, observation: Observation, reward: float, info: dict[str, Any]) -> None:
        values = [*observation.values(), np.array(reward), info["truth"]["pose"]]
        self.found.not_numbers += not all(np.isfinite(value).all() for value in values)
        self.found.outside += not self._env.observation_space.contains(observation)

    def _judge(self, action: Any, info: dict[str, Any]) -> None:
        for way in judge_last_probe(self._env, np.asarray(action, np.float64), info):
            self.found.ways += 1
            self.found.beyond = max(self.found.beyond, way.beyond)
            if not way.sound:
                self.found.passed.append(
                    f"{self._place(action)}: {1e3 * way.beyond:.3g} mm beyond the first touch,"
                    f" {1e3 * way.allowed:.3g} allowed"
                )

    def _place(self, action: Any) -> str:
        return f"episode of seed {self._episode}, probe {len(self._env.touches)}, {action!r}"


def resident_memory() -> int:
    """Bytes of this process in memory; where the system doesn't tell, the most there ever were."""
    import resource

    # What is freed but kept for later by glibc isn't held; others have no such call.
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if trim is not None:
        trim(0)
    statistics = Path("/proc/self/statm")
    if statistics.exists():
        return int(statistics.read_text().split()[1]) * resource.getpagesize()
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return most if sys.platform == "darwin" else 1024 * most
