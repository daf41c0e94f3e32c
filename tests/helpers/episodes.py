"""Episodes with random actions, in space and in the plane."""

from __future__ import annotations

from typing import Any

import numpy as np
from helpers.digests import bytes_of

from palpate.recognizer import SearchLimits

CUT_SHORT = SearchLimits(budget=1, nodes=100)
"""For tests that are of the touch: the recogniser gives up at once."""


def play(env: Any, seed: int, probes: int | None = None) -> tuple[list[dict], dict]:
    """Observations of a random episode, and what the last step told.

    Args:
        env: an environment of palpate.
        seed: of the episode and of the actions.
        probes: the most; by default as many as the environment allows.
    """
    rng = np.random.default_rng(seed)
    observation, info = env.reset(seed=seed)
    trace, ended = [observation], False
    while not ended and (probes is None or len(trace) <= probes):
        action = rng.uniform(-1.0, 1.0, env.action_space.shape)
        observation, _, terminated, truncated, info = env.step(action)
        trace.append(observation)
        ended = terminated or truncated
    return trace, info


def digest(env: Any, seed: int) -> bytes:
    """All bytes of an episode's observations and of its truth."""
    trace, info = play(env, seed)
    return bytes_of([trace, info["truth"]])
