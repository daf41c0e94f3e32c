"""Dropping an object on the plane until it lies still.

Under gravity and dry friction a body's size sets the pace of its fall and nothing else (Froude's
law of similarity), so every object is dropped as one of a tenth of a metre: with the same settings
for all, and far from what single precision does to the very small and the very large.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import RigidTransform, Rotation

from ...assets import ConvexPart
from ...recognizer import Polyhedron
from ...recognizer.contacts.support import StableFace, stable_faces
from ..collision.mass import mass_properties

Floats = NDArray[np.float64]

DIAMETER = 0.1
"""Of every object as it is dropped, metres."""
DENSITY = 1000.0
"""Kilograms a cubic metre; where it comes to rest doesn't depend on it."""
LEAST_INERTIA = 1e-12
"""Of a body, kg m^2; MuJoCo refuses a hundredth of it. Needles are made heavier."""
THINNEST = 1e-6
"""Least moment of inertia, as a share of the greatest, of what can be dropped. A rod has it that is
not a thousandth as wide as long; the time step is too long for how fast that turns."""
HEIGHT = 0.05
"""Of its lowest point above the plane at first, in diameters."""
TIME_STEP = 5e-4
"""Seconds."""
SOFTNESS = 1e-3
"""Time constant of a contact, seconds; two steps are the least. How deep bodies sink, and so how
far they tilt at rest, goes with its square."""
LOOK = 40
"""Steps between two looks at whether it lies still."""
STILL = 1e-3
"""Speed of no point above which it lies still, metres a second."""
STILL_LOOKS = 5
"""How often in a row it must be found still: for a tenth of a second in all."""
LONGEST = 10.0
"""Seconds after which a drop that hasn't come to rest is given up."""
MOST_TILT = 0.01
"""Angle of the face that it stands on from the plane, radians, at most. What is measured is a
tenth of a milliradian or less: contacts of a simulation are soft, and give more where more rests
on them."""
MOST_DROPS = 100
"""Drops after which an object is given up."""


@dataclass(frozen=True, eq=False)
class Settled:
    """How an object lay when it had come to rest."""

    T_world_object: RigidTransform
    """As simulated, scaled to the object's size."""
    face: StableFace
    """The face that it stands on."""
    tilt: float
    """Of that face from the plane, radians, at most `MOST_TILT`."""
    sunk: float
    """How far its lowest point is below the plane, metres."""

    @property
    def upright(self) -> Rotation:
        """Its rotation without the tilt: the face exactly on the plane, and the turn kept."""
        return onto_plane(self.T_world_object.rotation, self.face)


def onto_plane(rotation: Rotation, face: StableFace) -> Rotation:
    """A rotation followed by the least one that puts a face's normal straight down."""
    down = rotation.apply(face.normal)
    axis = np.cross(down, [0.0, 0.0, -1.0])
    sine, cosine = float(np.linalg.norm(axis)), -float(down[2])
    if sine == 0.0:
        return rotation if cosine > 0.0 else Rotation.from_rotvec([np.pi, 0.0, 0.0]) * rotation
    return Rotation.from_rotvec(axis / sine * np.arctan2(sine, cosine)) * rotation


class DropScene:
    """A plane and one object that falls on it, in MuJoCo."""

    def __init__(
        self, model: Polyhedron, parts: Sequence[ConvexPart], friction: float = 1.0
    ) -> None:
        """Compile the scene.

        Args:
            model: the object; its mass, centre and inertia are those of its exact surface.
            parts: the convex parts that it collides with.
            friction: coefficient of sliding friction.

        Raises:
            ValueError: a friction that isn't above zero, or an object as thin as a needle.
        """
        if not (np.isfinite(friction) and friction > 0.0):
            raise ValueError(f"friction is {friction:g}; it must be above zero")
        self._model = model
        self._faces = stable_faces(model)
        self._scale = DIAMETER / model.diameter
        spec = mujoco.MjSpec()
        spec.option.timestep = TIME_STEP
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
        spec.option.impratio = 10.0
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0.0, 0.0, 1.0])
        body = spec.worldbody.add_body(name="object")
        body.add_freejoint()
        self._set_mass(body)
        for row, part in enumerate(parts):
            mesh = spec.add_mesh(name=f"part{row}")
            mesh.uservert = (self._scale * part.vertices).astype(np.float32).ravel()
            mesh.userface = part.triangles.astype(np.int32).ravel()
            # The inertia of a part isn't used, and that of a small volume is refused.
            mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
            body.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=f"part{row}", mass=0.0)
        for geom in spec.geoms:
            geom.solref[:] = SOFTNESS, 1.0
            geom.friction[0] = friction
        self._compiled = spec.compile()
        self._data = mujoco.MjData(self._compiled)

    def _set_mass(self, body: mujoco.MjsBody) -> None:
        properties, scale = mass_properties(self._model, DENSITY), self._scale
        inertia = properties.inertia_object * scale**5
        least, _, greatest = np.linalg.eigvalsh(inertia).tolist()
        if least < THINNEST * greatest:
            raise ValueError(
                f"{self._model.name} is too thin to be dropped in simulation; place it on a face"
                " that it can stand on instead"
            )
        heavier = max(LEAST_INERTIA / least, 1.0)
        inertia *= heavier
        body.explicitinertial = True
        body.mass = heavier * properties.mass * scale**3
        body.ipos = properties.centre_object * scale
        body.fullinertia[:] = *np.diag(inertia), inertia[0, 1], inertia[0, 2], inertia[1, 2]

    def drop(self, rng: np.random.Generator) -> Settled:
        """Drop the object at a random orientation, again and again until it comes to rest.

        Raises:
            ValueError: it never did.
        """
        for _ in range(MOST_DROPS):
            self._lift(Rotation.random(rng=rng))
            if self._comes_to_rest():
                settled = self._settled()
                if settled.tilt <= MOST_TILT:
                    return settled
        raise ValueError(
            f"{self._model.name}: dropped {MOST_DROPS} times it didn't once come to rest on a face"
            " that it can stand on; place it on one instead"
        )

    def _lift(self, rotation: Rotation) -> None:
        """Hold it over the plane, at rest."""
        mujoco.mj_resetData(self._compiled, self._data)
        lowest = self._scale * rotation.apply(self._model.vertices.copy())[:, 2].min()
        self._data.qpos[:3] = 0.0, 0.0, HEIGHT * DIAMETER - lowest
        self._data.qpos[3:] = rotation.as_quat(scalar_first=True)

    def _comes_to_rest(self) -> bool:
        still = 0
        while self._data.time < LONGEST and still < STILL_LOOKS:
            mujoco.mj_step(self._compiled, self._data, LOOK)
            velocity = self._data.qvel
            # The body frame's origin is inside the object's bounding box, or next to it.
            fastest = np.linalg.norm(velocity[:3]) + DIAMETER * np.linalg.norm(velocity[3:])
            still = still + 1 if fastest < STILL else 0
        return still == STILL_LOOKS

    def _settled(self) -> Settled:
        rotation = Rotation.from_quat(self._data.qpos[3:], scalar_first=True)
        shift = self._data.qpos[:3] / self._scale
        normals = rotation.apply(np.array([face.normal for face in self._faces]))
        tilts = np.arctan2(np.linalg.norm(normals[:, :2], axis=1), -normals[:, 2])
        lowest = float(rotation.apply(self._model.vertices.copy())[:, 2].min()) + float(shift[2])
        return Settled(
            T_world_object=RigidTransform.from_components(shift, rotation),
            face=self._faces[int(tilts.argmin())],
            tilt=float(tilts.min()),
            sunk=-lowest,
        )
