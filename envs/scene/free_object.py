"""An object that nothing holds: its mass and friction, and how it comes to rest in a scene."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import RigidTransform, Rotation

from ...recognizer import Polyhedron
from ...recognizer.contacts.support import stable_faces
from ..collision.mass import mass_properties, volume

Floats = NDArray[np.float64]

DENSITY = 1000.0
"""Kilograms a cubic metre, where no mass is given."""
SOFTNESS = 1e-3
"""Time constant of contacts between object and plane, seconds; how deep the object sinks goes with
its square. Two time steps are the least."""
TIME_STEP = 5e-4
"""While it comes to rest, seconds."""
LOOK = 20
"""Steps between two looks at whether it lies still."""
STILL = 1e-4
"""Share of its diameter that no point of an object at rest goes in a look, at most."""
STILL_LOOKS = 5
"""How often in a row it must be found still."""
LONGEST = 10.0
"""Seconds after which an object that still rolls is stopped where it is."""
LEAST_INERTIA = 2e-14
"""Kg m²; MuJoCo takes what is below 1e-14 for none."""
SINK = 1e-5
"""How deep the plane may give way under an object at rest, metres. What was measured is a tenth of
it or less."""


@dataclass(frozen=True, kw_only=True)
class FreeObject:
    """What the motion of an object that nothing holds depends on, besides its shape."""

    mass: float | None = None
    """Kilograms; None: that of its volume in water."""
    friction: float = 0.5
    """Coefficient of sliding friction between object and plane."""

    def __post_init__(self) -> None:
        if self.mass is not None and not (np.isfinite(self.mass) and self.mass > 0.0):
            raise ValueError(f"mass is {self.mass:g} kg; it must be above zero")
        if not (np.isfinite(self.friction) and self.friction > 0.0):
            raise ValueError(f"friction is {self.friction:g}; it must be above zero")

    def density(self, model: Polyhedron) -> float:
        """Kilograms a cubic metre."""
        return DENSITY if self.mass is None else self.mass / volume(model)


def set_free(
    spec: mujoco.MjSpec, body: mujoco.MjsBody, model: Polyhedron, free: FreeObject
) -> None:
    """Let a body of a specification move, its frame's origin at the object's centroid.

    Args:
        spec: with the body's geometry and the plane in it, but nothing else.
        body: the object.
        model: the object; its mass is spread evenly over its exact volume.
        free: how it moves.

    Raises:
        ValueError: it is too light to be simulated.
    """
    properties = mass_properties(model, free.density(model))
    inertia = properties.inertia_object
    least = float(np.linalg.eigvalsh(inertia).min())
    if least < LEAST_INERTIA:
        raise ValueError(
            f"{model.name}: a mass of {properties.mass:.3g} kg is too light to be simulated in an"
            f" object of {model.diameter:g} m; give at least"
            f" {1.01 * properties.mass * LEAST_INERTIA / least:.3g} kg"
        )
    body.add_freejoint(name="object")
    body.explicitinertial = True
    body.mass = properties.mass
    body.ipos = properties.centre_object - model.centroid
    body.fullinertia[:] = *np.diag(inertia), inertia[0, 1], inertia[0, 2], inertia[1, 2]
    for mesh in spec.meshes:
        # The inertia of a part isn't used, and that of a small volume is refused.
        mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
    for geom in spec.geoms:
        geom.solref[:] = SOFTNESS, 1.0
        geom.friction[0] = free.friction
    # As for a finger: a body at rest on a slope of the cone would creep.
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.impratio = 10.0


class FreeBody:
    """The free object of a compiled scene."""

    def __init__(self, mj_model: mujoco.MjModel, mj_data: mujoco.MjData, model: Polyhedron) -> None:
        """Find the object in a scene where it is free."""
        joint = mj_model.joint("object")
        self._model, self._data = mj_model, mj_data
        self._place = slice(int(joint.qposadr[0]), int(joint.qposadr[0]) + 7)
        self._speeds = slice(int(joint.dofadr[0]), int(joint.dofadr[0]) + 6)
        self._body = mj_model.body("object").id
        self._object, self._centroid, self._size = model, model.centroid, model.diameter
        self._faces = stable_faces(model)

    def put(self, T_world_object: RigidTransform) -> None:
        """Have it at a pose, at rest."""
        turn = T_world_object.rotation.as_quat(scalar_first=True)
        self._data.qpos[self._place] = *T_world_object.apply(self._centroid), *turn
        self._data.qvel[self._speeds] = 0.0

    def pose(self) -> RigidTransform:
        """Where the simulation has it: at the start of its last step, as its contacts are."""
        rotation = Rotation.from_quat(self._data.xquat[self._body], scalar_first=True)
        origin = self._data.xpos[self._body] - rotation.apply(self._centroid.copy())
        return RigidTransform.from_components(origin, rotation)

    def come_to_rest(self) -> bool:
        """Go on until it lies still, everything else being held as it is.

        Returns:
            False where it was stopped, after `LONGEST`.
        """
        usual, self._model.opt.timestep = self._model.opt.timestep, TIME_STEP
        still = 0
        for _ in range(int(LONGEST / (LOOK * TIME_STEP))):
            mujoco.mj_step(self._model, self._data, LOOK)
            velocity = self._data.qvel[self._speeds]
            # The centroid is inside the bounding box of the object.
            fastest = np.linalg.norm(velocity[:3]) + self._size * np.linalg.norm(velocity[3:])
            still = still + 1 if fastest * LOOK * TIME_STEP < STILL * self._size else 0
            if still == STILL_LOOKS:
                break
        self._data.qvel[self._speeds] = 0.0
        self._model.opt.timestep = usual
        mujoco.mj_forward(self._model, self._data)
        return still == STILL_LOOKS

    def stands(self, error: float) -> bool:
        """Whether it is on the plane as a `SupportPlane` of this error (metres) promises."""
        pose = self.pose()
        lowest = float(pose.apply(self._object.vertices)[:, 2].min())
        heights = (pose.apply(face.corners)[:, 2] for face in self._faces)
        return lowest >= -error and any(np.abs(height).max() <= error for height in heights)


def free_object(
    free: bool, placement: str, mass: float | None, friction: float | None
) -> FreeObject | None:
    """How an environment's object moves; None if it is held.

    Raises:
        ValueError: a mass or a friction of an object that is held, or one that is free but doesn't
            stand.
    """
    if not free:
        for name, value in (("mass", mass), ("friction", friction)):
            if value is not None:
                raise ValueError(f"{name} is {value:g}, but the object is held: give free=True")
        return None
    if placement == "across":
        raise ValueError("a free object has to stand: placement must be 'resting' or 'dropped'")
    return FreeObject(mass=mass) if friction is None else FreeObject(mass=mass, friction=friction)
