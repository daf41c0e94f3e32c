"""The simulated finger: MuJoCo scene, sensors, pictures, Gymnasium environments.

Importing this package registers, with these arguments of the class unless others are given:

| id | class | arguments |
|---|---|---|
| palpate/Probe-v0 | `probe_env.ProbeEnv` | none: an object held anyhow, touched by rays |
| palpate/ProbeRest-v0 | the same | placement="resting": it stands on a plane that is known |
| palpate/ProbeFinger-v0 | the same | sensor="finger": a ball tip that force-limited motors drive |
| palpate/ProbePlanar-v0 | `planar.planar_env.PlanarProbeEnv` | none: outlines, touched by rays |
"""

from typing import Any

import gymnasium

__all__ = ["ENV_ID", "FINGER_ENV_ID", "PLANAR_ENV_ID", "REST_ENV_ID"]

ENV_ID = "palpate/Probe-v0"
REST_ENV_ID = "palpate/ProbeRest-v0"
FINGER_ENV_ID = "palpate/ProbeFinger-v0"
PLANAR_ENV_ID = "palpate/ProbePlanar-v0"

_READY: dict[str, tuple[str, dict[str, Any]]] = {
    ENV_ID: ("probe_env:ProbeEnv", {}),
    REST_ENV_ID: ("probe_env:ProbeEnv", {"placement": "resting"}),
    FINGER_ENV_ID: ("probe_env:ProbeEnv", {"sensor": "finger"}),
    PLANAR_ENV_ID: ("planar.planar_env:PlanarProbeEnv", {}),
}

for _name, (_entry_point, _arguments) in _READY.items():
    if _name not in gymnasium.registry:
        gymnasium.register(_name, f"palpate.envs.{_entry_point}", kwargs=_arguments)
