"""The simulated finger: MuJoCo scene, sensors, pictures, Gymnasium environments.

Importing this package registers `palpate/Probe-v0`, `palpate/ProbeRest-v0`,
`palpate/ProbeFinger-v0` and `palpate/ProbePlanar-v0`.
"""

import gymnasium

__all__ = ["ENV_ID", "FINGER_ENV_ID", "PLANAR_ENV_ID", "REST_ENV_ID"]

ENV_ID = "palpate/Probe-v0"
REST_ENV_ID = "palpate/ProbeRest-v0"
FINGER_ENV_ID = "palpate/ProbeFinger-v0"
PLANAR_ENV_ID = "palpate/ProbePlanar-v0"

for _name, _entry_point in (
    (ENV_ID, "probe_env:ProbeEnv"),
    (REST_ENV_ID, "ready_envs:ProbeRestEnv"),
    (FINGER_ENV_ID, "ready_envs:ProbeFingerEnv"),
    (PLANAR_ENV_ID, "planar_env:PlanarProbeEnv"),
):
    if _name not in gymnasium.registry:
        gymnasium.register(_name, entry_point=f"palpate.envs.{_entry_point}")
