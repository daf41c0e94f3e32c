"""The simulated finger: MuJoCo scene, sensors, pictures, Gymnasium environment.

Importing this package registers `palpate/Probe-v0`.
"""

import gymnasium

__all__ = ["ENV_ID"]

ENV_ID = "palpate/Probe-v0"

if ENV_ID not in gymnasium.registry:
    gymnasium.register(ENV_ID, entry_point="palpate.envs.probe_env:ProbeEnv")
