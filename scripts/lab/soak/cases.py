"""What is soaked: every environment as it comes, and `Probe-v0` with each sensor and placement."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import gymnasium

from ....envs import ENV_ID, FINGER_ENV_ID, PLANAR_ENV_ID, REST_ENV_ID
from ....envs.planar.planar_env import PlanarProbeEnv
from ....envs.probe_env import ProbeEnv
from ....envs.sensors.finger_sensor import FingerSensor
from ....recognizer import SearchLimits
from .paths import WatchedFinger

CUT_SHORT = SearchLimits(budget=2, nodes=100)
"""The recogniser gives up at once: what is left is the environment."""


@dataclass(frozen=True)
class Setting:
    """An environment and its arguments."""

    env_id: str
    arguments: dict[str, Any] = field(default_factory=dict)

    def make(self, *, cut_short: bool = False) -> ProbeEnv | PlanarProbeEnv:
        """The environment itself, without wrappers; its finger, if any, is a watched one."""
        arguments = dict(self.arguments, **({"limits": CUT_SHORT} if cut_short else {}))
        env = gymnasium.make(self.env_id, disable_env_checker=True, **arguments).unwrapped
        if isinstance(env, ProbeEnv) and isinstance(env.sensors[0], FingerSensor):
            env.sensors = (WatchedFinger.like(env.sensors[0]),)
        if not isinstance(env, ProbeEnv | PlanarProbeEnv):
            raise ValueError(f"{self.env_id} is {type(env).__name__}, which is not soaked here")
        return env


MAIN = {
    "probe": Setting(ENV_ID),
    "rest": Setting(REST_ENV_ID),
    "finger": Setting(FINGER_ENV_ID),
    "planar": Setting(PLANAR_ENV_ID),
}
"""Every environment id, as it comes."""

VARIANTS = {
    "ball": Setting(ENV_ID, {"sensor": "ball"}),
    "ball-dropped": Setting(ENV_ID, {"sensor": "ball", "placement": "dropped"}),
    "ball-free-space": Setting(ENV_ID, {"sensor": "ball", "use_free_space": True}),
    "gaussian": Setting(ENV_ID, {"distribution": "gaussian"}),
    "range": Setting(ENV_ID, {"sensor": "range"}),
    "range-grid": Setting(ENV_ID, {"sensor": "range-grid", "placement": "resting"}),
    "rest-dropped": Setting(REST_ENV_ID, {"placement": "dropped"}),
    "finger-resting": Setting(FINGER_ENV_ID, {"placement": "resting"}),
    "finger-dropped": Setting(FINGER_ENV_ID, {"placement": "dropped"}),
    "finger-free-space": Setting(FINGER_ENV_ID, {"use_free_space": True}),
}

SETTINGS = {**MAIN, **VARIANTS}
