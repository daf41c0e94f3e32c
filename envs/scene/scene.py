"""The MuJoCo scene: a support plane and one object held across it (memo, Section 4.4).

The object is held at any orientation with the plane ``z = 0`` cutting through it; what lies below
the plane can't be touched. Rays meet the true mesh, concave as it may be. MuJoCo collides a mesh as
its convex hull, so balls and fingers meet the convex parts that the object is the union of; these
are compiled in when first asked for.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import RigidTransform

from ...assets import ConvexPart
from ...recognizer import Polyhedron
from ...recognizer.models.rays import cast_rays
from ..collision.collision import CollisionParts, collision_parts
from .feature_kind import FeatureKinds
from .finger import Finger, FingerDesign, add_finger
from .free_object import FreeBody, FreeObject, set_free
from .mesh_rounding import mesh_leaning, narrowest_face, part_leaning, reach

Floats = NDArray[np.float64]

OBJECT, PLANE, NOTHING = 1, 2, 3
"""What a ray met."""

LARGEST_DIAMETER = 10.0
SMALLEST_DIAMETER = 1e-3
"""Diameters (metres) at which MuJoCo's single-precision meshes are still exact enough."""

MESH_ROUNDING = 4e-7
"""Share of the object's diameter that MuJoCo's single-precision meshes may be off by. Coordinates
from the centroid are below the diameter, so each is off by 6e-8 of it at most; MuJoCo moves and
turns the mesh and rounds it once more: root three times twice that is 2.1e-7."""
NORMAL_ROUNDING = 1e-5
"""The same for normals, radians. Triangles so narrow that they lean by more are not relied on."""

RAYS_MEET = np.array([1, 0, 0, 0, 0, 0], np.uint8)
"""Which of MuJoCo's groups rays see: the true mesh and the plane; not the parts, not the finger."""
PARTS_GROUP, POINT_GROUP = 3, 5
PARKED = 5.0
"""How high over the plane a finger waits, in diameters of the object."""
POINT = 1e-9
"""Radius of what distances are measured from, metres; MuJoCo has no points."""


@dataclass(frozen=True, eq=False)
class RayReadings:
    """What rays met in the scene, without noise."""

    outcomes: NDArray[np.int8]
    """(r,) OBJECT, PLANE or NOTHING."""
    ends_world: Floats
    """(r, 3) where each ray ended, metres."""
    normals_world: Floats
    """(r, 3) outward unit normals there; zero for NOTHING."""


def check_size(model: Polyhedron) -> None:
    """Refuse an object that can't be simulated.

    Raises:
        ValueError: it is too large or too small to be simulated faithfully.
    """
    if not SMALLEST_DIAMETER <= model.diameter <= LARGEST_DIAMETER:
        raise ValueError(
            f"{model.name}: its diameter is {model.diameter:g} m; the simulation takes objects"
            f" from {SMALLEST_DIAMETER:g} to {LARGEST_DIAMETER:g} m. Are the units metres?"
        )


class ProbeScene:
    """One object and the support plane, in MuJoCo."""

    def __init__(
        self,
        model: Polyhedron,
        collision: CollisionParts | None = None,
        free: FreeObject | None = None,
    ) -> None:
        """Compile the scene of an object.

        Args:
            model: the object.
            collision: its convex parts; by default `collision_parts` finds them when they are
                needed.
            free: how it moves when it is pushed; None holds it where it is placed.

        Raises:
            ValueError: the object is too large or too small to be simulated faithfully, or is to
                move and its convex parts are not known.
        """
        check_size(model)
        self.model = model
        self.position_rounding = MESH_ROUNDING * model.diameter
        """How far off single precision puts the object's surface, metres."""
        self.T_world_object = RigidTransform.identity()
        self._collision, self._free = collision, free
        self._compile(self.collision.parts if free else (), None)

    def __getstate__(self) -> dict[str, Any]:
        # SciPy normalises a pickled pose anew, which changes its last bits.
        return {**self.__dict__, "T_world_object": self.T_world_object.as_matrix()}

    def __setstate__(self, state: dict[str, Any]) -> None:
        pose = RigidTransform(state["T_world_object"], normalize=False)
        self.__dict__.update(state, T_world_object=pose)

    @cached_property
    def collision(self) -> CollisionParts:
        """The convex parts that balls and fingers meet.

        Raises:
            ValueError: the object has no exact ones.
        """
        return self._collision or collision_parts(self.model)

    @cached_property
    def kinds(self) -> FeatureKinds:
        """Tells what of the object a contact lies on; for scoring alone."""
        off = self.position_rounding + self.collision.stray
        return FeatureKinds(self.model, 2.0 * off + 1e-7)

    @property
    def finger(self) -> FingerDesign | None:
        """The finger in the scene, if any."""
        return self._finger

    def solidify(self) -> None:
        """Have collision geometry in the scene; compiles it anew where there is none yet."""
        if not self.part_geoms:
            self._compile(self.collision.parts, None)

    def mount(self, finger: FingerDesign) -> None:
        """Have a finger in the scene, and something to collide with; compiles anew for another."""
        if self._finger != finger:
            self._compile(self.collision.parts, finger)

    def place(self, T_world_object: RigidTransform) -> None:
        """Hold the object at a pose, model to world; a free one comes to rest from there."""
        self._put(T_world_object)
        self.settle()

    @property
    def free(self) -> bool:
        """Whether the object moves when it is pushed."""
        return self._free is not None

    def stands(self, error: float) -> bool:
        """Whether a free object stands on the plane, to within ``error`` metres."""
        return self._free_body is not None and self._free_body.stands(error)

    def settle(self) -> bool:
        """Let a free object come to rest; False if it had to be stopped."""
        if self._free_body is None:
            return True
        rests = self._free_body.come_to_rest()
        self.follow()
        return rests

    def follow(self) -> None:
        """Have the pose be the one that the simulation's last contacts were made at."""
        if self._free_body is not None:
            self.T_world_object = self._free_body.pose()

    def _put(self, T_world_object: RigidTransform) -> None:
        self.T_world_object = T_world_object
        if self._free_body is None:
            # The mesh is given from its centroid: far from the origin, single precision is coarse.
            turn = T_world_object.rotation.as_quat(scalar_first=True)
            self.mj_model.body_pos[self._body] = T_world_object.apply(self.model.centroid)
            self.mj_model.body_quat[self._body] = turn
        else:
            # Nothing of what the object and the finger did before may stay.
            mujoco.mj_resetData(self.mj_model, self.mj_data)
            self._park()
            self._free_body.put(T_world_object)
        mujoco.mj_forward(self.mj_model, self.mj_data)

    def _park(self) -> None:
        """Have the finger, if any, out of the way."""
        if self._finger is not None:
            above = np.array([0.0, 0.0, PARKED * self.model.diameter])
            Finger(self.mj_model, self.mj_data).put(above, np.zeros(3))

    def cast(self, starts_world: Floats, directions_world: Floats) -> RayReadings:
        """Trace rays until they meet the object or the plane.

        Args:
            starts_world: (r, 3) metres.
            directions_world: (r, 3) unit vectors.
        """
        model, data, geom, seen = self.mj_model, self.mj_data, self._met, self._seen
        count = len(starts_world)
        depths, normals = np.empty((count, 1)), np.empty((count, 3))
        outcomes = np.empty(count, np.int8)
        for ray in range(count):
            start, direction, normal = starts_world[ray], directions_world[ray], normals[ray]
            depth = mujoco.mj_ray(model, data, start, direction, seen, True, -1, geom, normal)
            outcome = self._outcomes[geom.item()]
            if outcome == NOTHING:
                depth = normal[:] = 0.0
            depths[ray, 0], outcomes[ray] = depth, outcome
        ends = depths * directions_world
        ends += starts_world
        if self._bent and (outcomes == OBJECT).any():
            self._unbend(starts_world, directions_world, outcomes, normals)
        return RayReadings(outcomes, ends, normals)

    def _unbend(
        self, starts: Floats, directions: Floats, outcomes: NDArray[np.int8], normals: Floats
    ) -> None:
        """Put the model's own normals where a narrow triangle may have been met."""
        hits = cast_rays(self.model, self.T_world_object, starts, directions)
        known = (outcomes == OBJECT) & hits.hit
        normals[known] = hits.normals_world[known]

    def _compile(self, parts: Sequence[ConvexPart], finger: FingerDesign | None) -> None:
        spec = mujoco.MjSpec()
        body = spec.worldbody.add_body(name="object")
        if self._free is None:
            # It never moves; of the smallest and thinnest, MuJoCo finds no inertia of its own.
            body.explicitinertial, body.mass, body.inertia = True, 1.0, np.ones(3)
        centroid = self.model.centroid
        vertices = self.model.vertices - centroid
        _add_mesh(spec, body, "object", vertices, self.model.triangles, collides=False)
        spec.worldbody.add_geom(
            name="plane", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0.0, 0.0, 1.0]
        )
        for index, part in enumerate(parts):
            name, corners = f"part {index}", part.vertices - centroid
            _add_mesh(spec, body, name, corners, part.triangles, collides=True)
        if parts:
            # Distances are measured from here; what is in the way doesn't feel it.
            spec.worldbody.add_geom(
                name="point", size=[POINT, 0, 0], contype=0, conaffinity=0, group=POINT_GROUP
            )
        if self._free is not None:
            set_free(spec, body, self.model, self._free)
        if finger is not None:
            add_finger(spec, finger)
        self.mj_model = spec.compile()
        self.mj_data = mujoco.MjData(self.mj_model)
        self._finger = finger
        self._note(parts)
        self._park()
        self._put(self.T_world_object)

    def _note(self, parts: Sequence[ConvexPart]) -> None:
        """Take down where things are in the compiled model, and how far off it is."""
        mj_model = self.mj_model
        self._free_body = FreeBody(mj_model, self.mj_data, self.model) if self._free else None
        self._body = mj_model.body("object").id
        self._met = np.empty(1, np.int32)
        self._outcomes = {-1: NOTHING, mj_model.geom("object").id: OBJECT}
        self._outcomes[mj_model.geom("plane").id] = PLANE
        self._seen = RAYS_MEET if parts else None  # without parts there is nothing else to see
        self._bent = mesh_leaning(mj_model, self.model) > NORMAL_ROUNDING
        self.point_geom = mj_model.geom("point").id if parts else -1
        self.part_geoms = [mj_model.geom(f"part {index}").id for index in range(len(parts))]
        self.part_reaches = np.array([reach(mj_model, geom) for geom in self.part_geoms])
        pairs = zip(self.part_geoms, parts, strict=True)
        self.part_leaning = max((part_leaning(mj_model, *pair) for pair in pairs), default=0.0)
        if parts:
            # Where two planes stray no farther than so much from each other over a face, they lean
            # by no more than twice that over its width.
            self.part_leaning += 2.0 * self.collision.stray / narrowest_face(self.model)


def _add_mesh(
    spec: mujoco.MjSpec,
    body: Any,
    name: str,
    vertices: Floats,
    triangles: NDArray[np.int64],
    *,
    collides: bool,
) -> None:
    """Add a mesh to a body: as its convex hull to collide with, or as it is for rays alone."""
    mesh = spec.add_mesh(name=name)
    mesh.uservert = vertices.astype(np.float32).ravel()
    mesh.userface = triangles.astype(np.int32).ravel()
    body.add_geom(
        name=name,
        type=mujoco.mjtGeom.mjGEOM_MESH,
        meshname=name,
        contype=int(collides),
        conaffinity=int(collides),
        group=PARTS_GROUP if collides else 0,
    )
