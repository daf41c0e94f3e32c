"""The MuJoCo scene: a support plane and one object held across it (memo, Section 4.4).

The object is held at any orientation with the plane ``z = 0`` cutting through it; what lies below
the plane can't be touched.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import RigidTransform

from ..recognizer import Polyhedron

Floats = NDArray[np.float64]

OBJECT, PLANE, NOTHING = 1, 2, 3
"""What a ray met."""

LARGEST_DIAMETER = 10.0
SMALLEST_DIAMETER = 1e-3
"""Diameters (metres) at which MuJoCo's single-precision meshes are still exact enough."""


@dataclass(frozen=True, eq=False)
class RayReadings:
    """What rays met in the scene, without noise."""

    outcomes: NDArray[np.int8]
    """(r,) OBJECT, PLANE or NOTHING."""
    ends_world: Floats
    """(r, 3) where each ray ended, metres."""
    normals_world: Floats
    """(r, 3) outward unit normals there; zero for NOTHING."""


class ProbeScene:
    """One object and the support plane, in MuJoCo."""

    def __init__(self, model: Polyhedron) -> None:
        """Compile the scene of an object.

        Raises:
            ValueError: the object is too large or too small to be simulated faithfully.
        """
        if not SMALLEST_DIAMETER <= model.diameter <= LARGEST_DIAMETER:
            raise ValueError(
                f"{model.name}: its diameter is {model.diameter:g} m; the simulation takes objects"
                f" from {SMALLEST_DIAMETER:g} to {LARGEST_DIAMETER:g} m. Are the units metres?"
            )
        self.model = model
        spec = mujoco.MjSpec()
        mesh = spec.add_mesh(name="object")
        mesh.uservert = model.vertices.astype(np.float32).ravel()
        mesh.userface = model.triangles.astype(np.int32).ravel()
        body = spec.worldbody.add_body(name="object")
        body.add_geom(name="object", type=mujoco.mjtGeom.mjGEOM_MESH, meshname="object")
        spec.worldbody.add_geom(
            name="plane", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0.0, 0.0, 1.0]
        )
        self._model = spec.compile()
        self._data = mujoco.MjData(self._model)
        self._object = self._model.geom("object").id
        self._body = self._model.body("object").id
        self.T_world_object = RigidTransform.identity()

    def place(self, T_world_object: RigidTransform) -> None:
        """Hold the object at a pose, model to world."""
        self.T_world_object = T_world_object
        self._model.body_pos[self._body] = T_world_object.translation
        self._model.body_quat[self._body] = T_world_object.rotation.as_quat(scalar_first=True)
        mujoco.mj_forward(self._model, self._data)

    def cast(self, starts_world: Floats, directions_world: Floats) -> RayReadings:
        """Trace rays until they meet the object or the plane.

        Args:
            starts_world: (r, 3) metres.
            directions_world: (r, 3) unit vectors.
        """
        count = len(starts_world)
        outcomes = np.full(count, NOTHING, np.int8)
        ends = np.array(starts_world)
        normals = np.zeros((count, 3))
        geom = np.empty(1, np.int32)
        normal = np.empty(3)
        for ray in range(count):
            depth = mujoco.mj_ray(
                self._model,
                self._data,
                starts_world[ray],
                directions_world[ray],
                None,
                True,
                -1,
                geom,
                normal,
            )
            if geom[0] >= 0:
                outcomes[ray] = OBJECT if geom[0] == self._object else PLANE
                ends[ray] = starts_world[ray] + depth * directions_world[ray]
                normals[ray] = normal
        return RayReadings(outcomes, ends, normals)
