"""True touches for the soundness campaign, and what a sensor within its bounds reports of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import RigidTransform, Rotation

from ....envs.probe_env import INCH
from ....envs.sensors.noise import uniform_in_ball, uniform_in_cone
from ....recognizer import Polygon, Polyhedron
from ....recognizer.models.features import Features

Floats = NDArray[np.float64]

NOISE_ROWS = ((15, 0.01), (12, 0.01), (12, 0.05), (10, 0.01), (10, 0.05), (8, 0.05), (8, 0.10))
"""Bounds on normals, as what pi is divided by, and on positions, inches."""
INSIDE = 1.0 - 1e-9
"""Share of a bound at which noise on the very bound is put: rounding may not carry it over."""


@dataclass(frozen=True, eq=False)
class Touched:
    """Where an object was truly touched, and where it truly is."""

    T_world_object: RigidTransform
    """Of an outline with a rotation about z, and z = 0."""
    points: Floats
    """(n, 3) or (n, 2) world frame, metres."""
    normals: Floats
    """(n, 3) or (n, 2) outward, world frame, unit."""
    features: NDArray[np.int32]
    """(n,) the true interpretation."""


def random_unit(rng: np.random.Generator, dimension: int = 3) -> Floats:
    """A direction, uniform."""
    direction = rng.normal(size=dimension)
    return direction / np.linalg.norm(direction)


def random_pose(rng: np.random.Generator) -> RigidTransform:
    """Any rotation, within a metre."""
    return RigidTransform.from_components(rng.uniform(-0.5, 0.5, 3), Rotation.random(rng=rng))


def touch_faces(
    model: Polyhedron, pose: RigidTransform, count: int, rng: np.random.Generator
) -> Touched:
    """Touch a solid anywhere on its faces: by area or, half of the time, each face alike."""
    shares = model.areas if rng.random() < 0.5 else np.ones(model.face_count)
    faces = rng.choice(model.face_count, count, p=shares / shares.sum())
    points = np.array([_on_face(model, int(face), rng) for face in faces])
    return _placed(pose, points, model.normals[faces], faces)


def touch_features(
    model: Polyhedron,
    features: Features,
    pose: RigidTransform,
    count: int,
    sharp: int,
    rng: np.random.Generator,
) -> Touched:
    """Touch faces and, in ``sharp`` of all contacts, convex edges or vertices.

    The normal there is any of the feature's cone, an end of it every so often.
    """
    chosen = rng.choice(model.face_count, count, p=model.areas / model.areas.sum())
    for row in rng.permutation(count)[:sharp]:
        ends = (model.face_count, model.face_count + features.edge_count, len(features))
        kind = int(rng.integers(2))
        chosen[row] = rng.integers(ends[kind], ends[kind + 1])
    points, normals = np.empty((count, 3)), np.empty((count, 3))
    for row, feature in enumerate(map(int, chosen)):
        if feature < model.face_count:
            points[row], normals[row] = _on_face(model, feature, rng), model.normals[feature]
            continue
        points[row] = _within(hull_of(features, feature), rng)
        normals[row] = _within(cone_of(features, feature), rng)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return _placed(pose, points, normals, chosen)


def touch_outline(
    model: Polygon, pose: RigidTransform, count: int, rng: np.random.Generator
) -> Touched:
    """Touch an outline anywhere on its edges, by length."""
    edges = rng.choice(model.face_count, count, p=model.lengths / model.perimeter)
    ends = model.segments[edges]
    points = ends[:, 0] + rng.random((count, 1)) * (ends[:, 1] - ends[:, 0])
    R = pose.rotation.as_matrix()[:2, :2]
    return Touched(
        pose,
        points @ R.T + pose.translation[:2],
        model.normals[edges] @ R.T,
        edges.astype(np.int32),
    )


def hull_of(features: Features, feature: int) -> Floats:
    """(k, 3) the corners of a feature's hull, object frame; two of an edge, one of a vertex."""
    return features.corners[features.start[feature] : features.start[feature + 1]]


def cone_of(features: Features, feature: int) -> Floats:
    """(k, 3) unit normals whose convex cone holds every outward normal of a feature."""
    return features.cone_normals[features.cone_start[feature] : features.cone_start[feature + 1]]


def shifted(rng: np.random.Generator, points: Floats, bounds: Floats, at_bounds: bool) -> Floats:
    """Points (n, d) moved within bounds (n,), uniform, or on the very bounds."""
    if points.shape[1] == 2:
        directions = rng.normal(size=points.shape)
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        moves = directions * np.sqrt(rng.random((len(points), 1)))
    else:
        moves = uniform_in_ball(rng, len(points), 1.0)
    if at_bounds:
        moves /= np.linalg.norm(moves, axis=1, keepdims=True)
    return points + INSIDE * bounds[:, None] * moves


def leaned(rng: np.random.Generator, normals: Floats, bounds: Floats, at_bounds: bool) -> Floats:
    """Unit vectors (n, d) turned by no more than bounds (n,), uniform, or by the very bounds."""
    if normals.shape[1] == 2:
        ends = rng.choice([-1.0, 1.0], len(normals))
        angles = INSIDE * bounds * (ends if at_bounds else rng.uniform(-1.0, 1.0, len(normals)))
        cosines, sines = np.cos(angles)[:, None], np.sin(angles)[:, None]
        return cosines * normals + sines * np.column_stack([-normals[:, 1], normals[:, 0]])
    found = np.empty_like(normals)
    for row, bound in enumerate(bounds):
        found[row] = uniform_in_cone(rng, normals[[row]], INSIDE * float(bound))[0]
    if at_bounds:
        tangents = found - (found * normals).sum(axis=1, keepdims=True) * normals
        tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
        edge = INSIDE * bounds[:, None]
        found = np.cos(edge) * normals + np.sin(edge) * tangents
    return found


def draw_bounds(rng: np.random.Generator, count: int, mixed: bool) -> tuple[Floats, Floats]:
    """Bounds (n,) on positions, metres, and on normals, radians: one row, or one a contact."""
    rows = rng.integers(len(NOISE_ROWS), size=count if mixed else 1)
    values = np.array(NOISE_ROWS)[np.broadcast_to(rows, count)]
    return values[:, 1] * INCH, np.pi / values[:, 0]


def _placed(
    pose: RigidTransform, points: Floats, normals: Floats, features: NDArray[np.integer]
) -> Touched:
    return Touched(
        pose, pose.apply(points), pose.rotation.apply(normals), features.astype(np.int32)
    )


def _on_face(model: Polyhedron, face: int, rng: np.random.Generator) -> Floats:
    triangles = model.vertices[model.triangles[model.triangle_faces == face]]
    sides = triangles[:, 1:] - triangles[:, :1]
    areas = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    return rng.dirichlet(np.ones(3)) @ triangles[rng.choice(len(triangles), p=areas / areas.sum())]


def _within(corners: Floats, rng: np.random.Generator) -> Floats:
    if rng.random() < 0.2:
        return corners[rng.integers(len(corners))]
    return rng.dirichlet(np.ones(len(corners))) @ corners
