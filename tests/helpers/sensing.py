"""What a sensor would report: contacts on a grid of rays, with noise inside its bounds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from oracles import solids as oracles
from oracles.solids import random_pose
from scipy.spatial.transform import RigidTransform, Rotation

from palpate.envs.sensors.noise import uniform_in_ball, uniform_in_cone
from palpate.recognizer import Contacts, Polyhedron
from palpate.recognizer.models.features import Features
from palpate.recognizer.models.rays import cast_rays

INCH = 0.0254

Floats = NDArray[np.float64]

CUBE = Polyhedron.from_mesh(oracles.box(0.04, 0.04, 0.04), name="cube")
L_BLOCK = Polyhedron.from_mesh(
    oracles.blocks([[[1], [1]], [[1], [0]]], [0, 0.02, 0.06], [0, 0.02, 0.05], [0, 0.03]),
    name="L-block",
)
HOLED = Polyhedron.from_mesh(
    oracles.blocks(
        [[[1], [1], [1]], [[1], [0], [1]], [[1], [1], [1]]],
        [0, 0.02, 0.06, 0.08],
        [0, 0.015, 0.045, 0.06],
        [0, 0.025],
    ),
    name="holed",
)
SMALL = {model.name: model for model in (CUBE, L_BLOCK, HOLED)}
"""Solids of a few faces: all of them alike, two of them concave, two of them with a hole."""
INSIDE = 1.0 - 1e-9
"""As far out as a bound goes, to rounding."""


def solid(name: str) -> Polyhedron:
    """One of `SMALL`, a stand-in, or one of the oracles' solids."""
    return SMALL[name] if name in SMALL else oracles.model(name)


@dataclass(frozen=True, eq=False)
class Touches:
    """Where an object was truly touched, and where it truly is."""

    T_world_object: RigidTransform
    points: Floats
    """(n, 3) world frame, metres."""
    normals: Floats
    """(n, 3) outward, world frame."""
    faces: NDArray[np.int32]
    """(n,) the true interpretation."""

    def __len__(self) -> int:
        return len(self.points)

    def __getitem__(self, rows: NDArray[np.integer]) -> Touches:
        return Touches(self.T_world_object, self.points[rows], self.normals[rows], self.faces[rows])


def sense_grid(
    model: Polyhedron, rng: np.random.Generator, fewest: int = 12, most: int = 20
) -> Touches:
    """Touch an object at a random pose on regular grids along the three axes (memo, Section 4.3).

    Pose and spacing are drawn anew until ``fewest`` to ``most`` rays meet the object.
    """
    while True:
        pose = random_pose(rng)
        corners = pose.apply(model.vertices)
        low, high = corners.min(axis=0), corners.max(axis=0)
        spacing = rng.uniform(0.15, 0.6) * model.diameter
        origins, directions = [], []
        for along in range(3):
            first, second = (axis for axis in range(3) if axis != along)
            u, v = np.meshgrid(
                np.arange(low[first] + spacing * rng.random(), high[first], spacing),
                np.arange(low[second] + spacing * rng.random(), high[second], spacing),
            )
            starts = np.empty((u.size, 3))
            starts[:, first], starts[:, second] = u.ravel(), v.ravel()
            starts[:, along] = high[along] + 0.01
            origins.append(starts)
            directions.append(np.tile(-np.eye(3)[along], (u.size, 1)))
        hits = cast_rays(model, pose, np.concatenate(origins), np.concatenate(directions))
        if fewest <= hits.hit.sum() <= most:
            return Touches(
                pose,
                hits.points_world[hits.hit],
                hits.normals_world[hits.hit],
                hits.faces[hits.hit].astype(np.int32),
            )


def touch_faces(
    model: Polyhedron,
    rng: np.random.Generator,
    faces: list[int],
    T_world_object: RigidTransform | None = None,
) -> Touches:
    """Touch the given faces, each at a point uniform over its area, at a random pose or a given."""
    pose = random_pose(rng) if T_world_object is None else T_world_object
    points = np.empty((len(faces), 3))
    for row, face in enumerate(faces):
        points[row] = _point_on(model, face, rng)
    return Touches(
        pose,
        pose.apply(points),
        pose.rotation.apply(model.normals[faces]),
        np.array(faces, np.int32),
    )


def _point_on(model: Polyhedron, face: int, rng: np.random.Generator) -> Floats:
    triangles = model.vertices[model.triangles[model.triangle_faces == face]]
    sides = triangles[:, 1:] - triangles[:, :1]
    areas = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    return rng.dirichlet(np.ones(3)) @ triangles[rng.choice(len(triangles), p=areas / areas.sum())]


def touch_features(
    model: Polyhedron, features: Features, rng: np.random.Generator, count: int
) -> Touches:
    """Touch faces, edges and vertices, as many of each, anywhere on them, at a random pose.

    The normal on an edge or a vertex is any of its cone, an end of it every so often.
    """
    starts = np.array([0, model.face_count, model.face_count + features.edge_count, len(features)])
    kinds = rng.choice(np.flatnonzero(np.diff(starts)), count)
    chosen = rng.integers(starts[kinds], starts[kinds + 1])
    points, normals = np.empty((count, 3)), np.empty((count, 3))
    for row, feature in enumerate(map(int, chosen)):
        start, first = features.start, features.cone_start
        corners = features.corners[start[feature] : start[feature + 1]]
        points[row] = _within(corners, rng) if kinds[row] else _point_on(model, feature, rng)
        normals[row] = _within(features.cone_normals[first[feature] : first[feature + 1]], rng)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    pose = random_pose(rng)
    return Touches(pose, pose.apply(points), pose.rotation.apply(normals), chosen.astype(np.int32))


def _within(corners: Floats, rng: np.random.Generator) -> Floats:
    if rng.random() < 0.2:
        return corners[rng.integers(len(corners))]
    return rng.dirichlet(np.ones(len(corners))) @ corners


def shifts_within(
    rng: np.random.Generator, count: int, bound: float, at_bounds: bool = False
) -> Floats:
    """(count, 3) shifts, uniform in a ball, or as far out as they may be."""
    shifts = uniform_in_ball(rng, count, bound)
    if at_bounds:
        shifts *= INSIDE * bound / np.linalg.norm(shifts, axis=1, keepdims=True)
    return shifts


def leaning(
    rng: np.random.Generator, directions: Floats, bound: float, at_bounds: bool = False
) -> Floats:
    """Unit vectors (n, 3) turned uniformly in a cone, or as far as they may be."""
    turned = uniform_in_cone(rng, directions, bound)
    if at_bounds:
        aside = turned - (turned * directions).sum(axis=1, keepdims=True) * directions
        aside /= np.linalg.norm(aside, axis=1, keepdims=True)
        turned = np.cos(INSIDE * bound) * directions + np.sin(INSIDE * bound) * aside
    return turned


def feel(
    touches: Touches,
    rng: np.random.Generator,
    position_error: float,
    normal_error: float,
    *,
    at_bounds: bool = False,
    alike: bool = False,
) -> Contacts:
    """Contacts with noise uniform in their bounds or, ``at_bounds``, as far out as they may be.

    With ``alike`` all normals are turned alike: as the object itself might be, for all they say.
    """
    shifts = shifts_within(rng, len(touches), position_error, at_bounds)
    normals = leaning(rng, touches.normals, normal_error, at_bounds)
    if alike:
        axis = rng.normal(size=3)
        turn = INSIDE * normal_error * axis / np.linalg.norm(axis)
        normals = Rotation.from_rotvec(turn).apply(touches.normals)
    return Contacts(
        touches.points + shifts,
        normals,
        position_error=position_error,
        normal_error=normal_error,
    )


def forget_normals(contacts: Contacts, forgotten: NDArray[np.bool_]) -> Contacts:
    """The same contacts, some of their normals unknown."""
    return Contacts(
        contacts.positions,
        np.where(forgotten[:, None], np.nan, contacts.normals),
        position_error=contacts.position_error,
        normal_error=contacts.normal_error,
    )


def exact(touches: Touches, position_error: float = 1e-4, normal_error: float = 0.02) -> Contacts:
    """Contacts exactly where the object was touched, with bounds around them."""
    return Contacts(
        touches.points,
        touches.normals,
        position_error=position_error,
        normal_error=normal_error,
    )


def move(motion: RigidTransform, contacts: Contacts) -> Contacts:
    """The same contacts after a rigid motion of the world."""
    R = motion.rotation.as_matrix()
    return Contacts(
        contacts.positions @ R.T + motion.translation,
        contacts.normals @ R.T,
        position_error=contacts.position_error,
        normal_error=contacts.normal_error,
    )
