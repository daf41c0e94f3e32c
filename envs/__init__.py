"""The simulated finger: MuJoCo scene, sensors, pictures, Gymnasium environments.

Importing this package registers `palpate/Probe-v0` and `palpate/ProbePlanar-v0`.
"""

import gymnasium

__all__ = ["ENV_ID", "PLANAR_ENV_ID"]

ENV_ID = "palpate/Probe-v0"
PLANAR_ENV_ID = "palpate/ProbePlanar-v0"

if ENV_ID not in gymnasium.registry:
    gymnasium.register(ENV_ID, entry_point="palpate.envs.probe_env:ProbeEnv")
if PLANAR_ENV_ID not in gymnasium.registry:
    gymnasium.register(PLANAR_ENV_ID, entry_point="palpate.envs.planar_env:PlanarProbeEnv")
