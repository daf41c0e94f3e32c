"""An object that was probed, and all that is known of it: contacts, free space, a support."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from helpers.sensing import INSIDE, SMALL, leaning, shifts_within, solid
from numpy.typing import NDArray
from oracles import solids as oracles
from oracles.checker import cone_of
from oracles.geometry import cone_angles, footings, signed_distances, triangle_distances
from oracles.solids import random_pose
from scipy.spatial.transform import RigidTransform, Rotation

from palpate.recognizer import Contacts, FreeSpace, Polyhedron, Recognizer, SupportPlane
from palpate.recognizer.contacts.support import stable_faces

Floats = NDArray[np.float64]
APPROACH_ERROR = 0.01


@dataclass(frozen=True, eq=False)
class Scene:
    """An object, where it truly is, and what is known of it, all within bounds."""

    recognizer: Recognizer
    pose: RigidTransform
    contacts: Contacts
    faces: NDArray[np.int32]
    """The true interpretation."""
    free_space: FreeSpace
    support: SupportPlane | None

    @property
    def model(self) -> Polyhedron:
        return self.recognizer.models[0]


@cache
def recognizer_of(name: str, edges: bool = False) -> Recognizer:
    return Recognizer([solid(name)], features="all" if edges else "faces")


def sweep(model: Polyhedron, start: Floats, along: Floats, radius: float, length: float):
    """How far a ball goes before it touches, and whether it does; None if it grazes.

    No step is longer than the room that is left, so every place of the way has that much.
    """
    gone = np.zeros(len(start))
    room = np.full(len(start), np.inf)
    for _ in range(300):
        moving = (room > 1e-12) & (gone < length)
        if not moving.any():
            break
        places = start[moving] + gone[moving, None] * along[moving]
        room[moving] = signed_distances(model, places) - radius
        gone[moving] += np.maximum(room[moving], 0.0)
    return np.minimum(gone, length), room <= 1e-12, (room <= 1e-12) | (gone >= length)


def touched_feature(
    recognizer: Recognizer, centre: Floats, radius: float
) -> tuple[int, Floats, Floats] | None:
    """The feature that a ball touches, the point of it and its normal there; None if in doubt."""
    model = recognizer.models[0]
    features = recognizer.features(model.name)
    gaps = np.array([triangle_distances(centre[None], oracles.triangles_of(model, f)).min()
                     for f in range(model.face_count)])  # fmt: skip
    heights = model.normals @ centre - model.offsets
    face = int(gaps.argmin())
    if np.count_nonzero(gaps < gaps[face] + 1e-9) == 1 and abs(heights[face] - radius) < 1e-9:
        return face, centre - heights[face] * model.normals[face], model.normals[face]
    if radius == 0.0:
        return None
    # Vertices are behind the edges, and their ends.
    for feature in range(len(features) - 1, model.face_count - 1, -1):
        corners = features.corners[features.start[feature] : features.start[feature + 1]]
        edge = corners[-1] - corners[0]
        share = (centre - corners[0]) @ edge / max(edge @ edge, 1e-300)
        point = corners[0] + np.clip(share, 0.0, 1.0) * edge
        normal = (centre - point) / np.linalg.norm(centre - point)
        reached = abs(np.linalg.norm(centre - point) - radius) < 1e-9
        if reached and cone_angles(normal, cone_of(model, feature, features)) < 1e-6:
            return feature, point, normal
    return None


def settle_down(
    model: Polyhedron, rng: np.random.Generator, resting: bool, error: float, at_bounds: bool
) -> tuple[RigidTransform, SupportPlane]:
    """A pose above a plane, or standing on it, as near to breaking that as the bound allows."""
    up = rng.normal(size=3)
    up /= np.linalg.norm(up)
    share = INSIDE if at_bounds else rng.random()
    pose = random_pose(rng)
    height = 0.0
    if resting:
        faces = footings(model)
        face = faces[rng.integers(len(faces))]
        members, normal = face.corners, face.normal
        flat = np.linalg.svd(members - members.mean(axis=0))[2]
        tilt = np.cos(angle := rng.uniform(0.0, 2.0 * np.pi)) * flat[0] + np.sin(angle) * flat[1]
        extent = np.ptp(members @ tilt)
        turn = np.arcsin(min(0.5, 2.0 * error * share / extent))
        down = np.cos(turn) * normal + np.sin(turn) * tilt
        pose = RigidTransform.from_components(pose.translation, _taking(down, -up, rng))
        heights = pose.apply(members) @ up
        spare = 2.0 * error * INSIDE - np.ptp(heights)
        middle = 0.5 * (heights.min() + heights.max())
        height = middle + rng.uniform(-0.5, 0.5) * max(spare, 0.0)
    else:
        height = float((pose.apply(model.vertices) @ up).min())
        height += error * share if at_bounds else rng.uniform(-3.0, 1.0) * error
    normal = (float(up[0]), float(up[1]), float(up[2]))
    return pose, SupportPlane(height=float(height), error=error, normal=normal, resting=resting)


def _taking(one: Floats, other: Floats, rng: np.random.Generator) -> Rotation:
    """A rotation that takes one direction to another, random about that."""
    first = Rotation.align_vectors(other[None], one[None])[0]
    return Rotation.from_rotvec(rng.uniform(0.0, 2.0 * np.pi) * other) * first


def probe(
    name: str, rng: np.random.Generator, *, edges: bool = False, plane: bool = False,
    resting: bool = False, vague: bool = False, rays: int = 9, most: int = 6,
) -> Scene:  # fmt: skip
    """Probe an object along random rays until it is touched, or missed."""
    recognizer = recognizer_of(name, edges)
    model = recognizer.models[0]
    size = model.diameter
    at_bounds = bool(rng.random() < 1 / 3)
    position_error, path_error = size * 10.0 ** rng.uniform(-2.7, -1.3, 2)
    normal_error = float(rng.choice([1.4, np.pi] if vague else [0.1, 0.25, 0.5]))
    if vague or edges:
        # Contacts that say little leave a great many interpretations soon.
        most = 2 if vague else 4
    if edges:
        normal_error, position_error = 0.1, min(position_error, 0.0025 * size)
    radius = 0.0 if not edges and rng.random() < 0.5 else size * rng.uniform(0.02, 0.2)
    pose, support = random_pose(rng), None
    if plane or resting:
        error = size * rng.uniform(0.002, 0.03)
        if resting:
            # Wider bounds on standing than the narrowest face bears: see below.
            narrowest = min(face.width for face in stable_faces(model))
            error = min(error, 0.24 * narrowest)
        pose, support = settle_down(model, rng, resting, error, at_bounds)
    found: list[tuple[int, Floats, Floats, Floats]] = []
    starts = ends = np.zeros((0, 3))
    sure = np.zeros(0, bool)
    while len(found) < (2 if vague else 3):
        outward = rng.normal(size=(rays, 3))
        outward /= np.linalg.norm(outward, axis=1, keepdims=True)
        starts = model.centroid + 1.5 * size * outward
        low, high = model.vertices.min(axis=0), model.vertices.max(axis=0)
        aims = rng.uniform(low - 0.15 * size, high + 0.15 * size, (rays, 3))
        along = (aims - starts) / np.linalg.norm(aims - starts, axis=1, keepdims=True)
        gone, hits, sure = sweep(model, starts, along, radius, 3.0 * size)
        ends = starts + gone[:, None] * along
        felt = [
            touched_feature(recognizer, ends[k], radius) if hits[k] else None for k in range(rays)
        ]
        found = [(*at, along[k]) for k, at in enumerate(felt) if at is not None][:most]
    starts, ends = starts[sure], ends[sure]
    if len(recognizer_of(name).features(name)) == 6:
        # Around a convex solid a ball may slide along a face without end.
        feature, point, normal, _ = found[0]
        aside = rng.normal(size=3)
        normal = model.normals[feature] if feature < model.face_count else normal
        aside -= (aside @ normal) * normal
        starts = np.vstack([starts, point + radius * normal - size * aside])
        ends = np.vstack([ends, point + radius * normal + size * aside])
    turn = pose.rotation
    count = len(found)
    points = pose.apply(np.array([point for _, point, _, _ in found]))
    normals = turn.apply(np.array([normal for _, _, normal, _ in found]))
    ways = turn.apply(np.array([way for _, _, _, way in found]))
    shifts = shifts_within(rng, len(starts), path_error, at_bounds)
    if at_bounds and rng.random() < 0.5:
        # All of the path deeper: straight through what it touched, as far as may be.
        shifts[:] = path_error * INSIDE * (ends - starts)
        shifts /= np.linalg.norm(ends - starts, axis=1, keepdims=True)
    other = shifts if rng.random() < 0.5 else shifts_within(rng, len(starts), path_error, at_bounds)
    free_space = FreeSpace(
        pose.apply(starts) + shifts, pose.apply(ends) + other, radius=radius, error=path_error
    )
    known = normal_error < np.pi
    contacts = Contacts(
        points + shifts_within(rng, count, position_error, at_bounds),
        leaning(rng, normals, normal_error, at_bounds) if known else None,
        position_error=position_error,
        normal_error=normal_error if known else None,
        approaches=leaning(rng, ways, APPROACH_ERROR, at_bounds)
        if not known or rng.random() < 0.6
        else None,
    )
    faces = np.array([feature for feature, _, _, _ in found], np.int32)
    return Scene(recognizer, pose, contacts, faces, free_space, support)


KINDS = {
    "free": {},
    "plane": {"plane": True},
    "standing": {"resting": True},
    "edges": {"edges": True},
    "vague": {"vague": True},
}
NAMES = (*SMALL, "housing", "simple-hand")
