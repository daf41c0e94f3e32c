"""An independent judge of poses: plain numpy on a model's triangles, none of palpate's kernels.

A pose meets an interpretation if it puts every contact within its bound of the bounded face, edge
or vertex it is said to lie on, and every normal within its bound of that feature's normal cone.
`Oracle` looks for such a pose, by damped least squares from many starts.

What else is known is judged alike: paths by signed distances along them, a support by the corners'
heights over it, standing by the faces of the hull below the centroid, approaches by normals.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from oracles.geometry import (
    COPLANAR,
    cone_angles,
    footings,
    nearest_on_paths,
    triangle_distances,
)
from scipy.spatial.transform import RigidTransform, Rotation

from palpate.recognizer import Contacts, FreeSpace, Polyhedron, SupportPlane
from palpate.recognizer.models.features import Features

Floats = NDArray[np.float64]

GRAIN = 0.1
"""Share of a path's error to which its way past an object is looked at."""


@dataclass(frozen=True, eq=False)
class Check:
    """How well a pose meets an interpretation, contact by contact."""

    distances: Floats
    """(n,) distance of each contact from its bounded face, edge or vertex, metres; 0 for none."""
    angles: Floats
    """(n,) angle between each measured normal and its feature's cone, radians; 0 for none."""
    within: NDArray[np.bool_]
    """(n,) whether both are within their bounds."""

    @property
    def passed(self) -> bool:
        return bool(self.within.all())


def check(
    model: Polyhedron,
    T_world_object: RigidTransform,
    contacts: Contacts,
    faces: NDArray[np.integer],
    tolerance: float = 1e-6,
    features: Features | None = None,
) -> Check:
    """Compare contacts with their features at a pose; ``tolerance`` is a share of each bound.

    Without ``features`` an interpretation is of faces alone; -1 stands for none.
    """
    R, t = T_world_object.rotation.as_matrix(), T_world_object.translation
    points = (contacts.positions - t) @ R
    normals = contacts.normals @ R
    distances, angles = np.zeros(len(points)), np.zeros(len(points))
    for row, feature in enumerate(map(int, faces)):
        if feature >= 0:
            corners = corners_of(model, feature, features)
            distances[row] = triangle_distances(points[[row]], corners).min()
            angles[row] = cone_angles(normals[row], cone_of(model, feature, features))
    within = (distances <= contacts.position_error * (1.0 + tolerance)) & (
        angles <= contacts.normal_error * (1.0 + tolerance)
    )
    return Check(distances, angles, within)


def corners_of(model: Polyhedron, feature: int, features: Features | None = None) -> Floats:
    """(t, 3, 3) corners of the triangles of a face; an edge or a vertex is a flat triangle."""
    if feature < model.face_count:
        return model.vertices[model.triangles[model.triangle_faces == feature]]
    assert features is not None
    corners = features.corners[features.start[feature] : features.start[feature + 1]]
    return corners[[0, -1, -1]][None]


def cone_of(model: Polyhedron, feature: int, features: Features | None = None) -> Floats:
    """(k, 3) unit normals whose convex cone holds every outward normal of a feature."""
    if feature < model.face_count:
        return model.normals[[feature]]
    assert features is not None
    return features.cone_normals[features.cone_start[feature] : features.cone_start[feature + 1]]


def broken(
    model: Polyhedron,
    T_world_object: RigidTransform,
    contacts: Contacts,
    faces: NDArray[np.integer],
    *,
    free_space: FreeSpace | None = None,
    support: SupportPlane | None = None,
    features: Features | None = None,
) -> list[str]:
    """What an interpretation at a pose breaks of everything that is known; empty if nothing."""
    found: list[str] = []
    known = check(model, T_world_object, contacts, faces, features=features)
    found += [f"contact {row}" for row in np.flatnonzero(~known.within)]
    tiny = 1e-7 * model.diameter
    if free_space is not None and len(free_space):
        back = T_world_object.inv()
        nearest = nearest_on_paths(
            model,
            back.apply(free_space.starts.copy()),
            back.apply(free_space.ends.copy()),
            free_space.clearance,
            GRAIN * free_space.error,
        )
        lacks = free_space.clearance - nearest
        found += [f"path {row} by {lacks[row]:.3g}" for row in np.flatnonzero(lacks > tiny)]
    if support is not None:
        up = np.array(support.normal) / np.linalg.norm(support.normal)
        heights = T_world_object.apply(model.vertices) @ up - support.height
        if heights.min() < -support.error - tiny:
            found.append(f"support by {-support.error - heights.min():.3g}")
        if support.resting:
            # Product and judge need not agree to rounding on what a solid may just stand on.
            stable = footings(model, 2.0 * COPLANAR * model.diameter)
            offs = [
                np.abs(T_world_object.apply(face.corners) @ up - support.height).max()
                for face in stable
            ]
            if min(offs) > support.error + tiny:
                found.append(f"standing by {min(offs) - support.error:.3g}")
    R = T_world_object.rotation.as_matrix()
    for row, feature in enumerate(map(int, faces)):
        approach = contacts.approaches[row] @ R
        if feature >= 0 and approach.any():
            # Some normal of the cone is to face where the probe came from, to its error.
            cone = cone_of(model, feature, features)
            if cone_angles(-approach, cone) > np.pi / 2.0 + 0.01 + 1e-7:
                found.append(f"approach {row}")
    return found


class Oracle:
    """Looks for a pose that meets an interpretation's bounds, from many starts at once."""

    def __init__(
        self,
        model: Polyhedron,
        contacts: Contacts,
        faces: NDArray[np.integer],
        features: Features | None = None,
    ) -> None:
        corners = [corners_of(model, int(face), features) for face in faces]
        most = max(map(len, corners))
        # A feature of fewer triangles repeats its first one.
        self.triangles = np.array(
            [c[np.arange(most) * (np.arange(most) < len(c))] for c in corners]
        )
        self.cones = [cone_of(model, int(face), features) for face in faces]
        self.contacts = contacts
        self.size = model.diameter

    def finds_a_pose(self, rng: np.random.Generator, count: int = 24, steps: int = 40) -> bool:
        """Levenberg and Marquardt on what is left to go to a hair inside the bounds."""
        turns, shifts = self._starts(rng, count)
        damping = np.full(count, 1e-3)
        values = self._violations(turns, shifts)
        for _ in range(steps):
            slopes = self._slopes(turns, shifts)
            gradients = np.einsum("kva,kv->ka", slopes, values)
            systems = np.einsum("kva,kvb->kab", slopes, slopes)
            systems += damping[:, None, None] * np.eye(6)
            steps_taken = -np.linalg.solve(systems, gradients[..., None])[..., 0]
            new_turns, new_shifts = self._moved(turns, shifts, steps_taken)
            new_values = self._violations(new_turns, new_shifts)
            if (new_values < 1e-4).all(axis=1).any():
                return True
            better = (new_values**2).sum(axis=1) < (values**2).sum(axis=1)
            turns[better], shifts[better] = new_turns[better], new_shifts[better]
            values[better] = new_values[better]
            damping *= np.where(better, 0.2, 8.0)
            damping = np.clip(damping, 1e-9, 1e9)
        return False

    def _violations(self, turns: Floats, shifts: Floats) -> Floats:
        """(k, 2n) by how much readings exceed their bounds less a hair, in bounds, or 0."""
        points = (self.contacts.positions - shifts[:, None]) @ turns
        normals = self.contacts.normals @ turns
        distances = triangle_distances(points[:, :, None], self.triangles).min(-1)
        angles = [cone_angles(normals[:, row], cone) for row, cone in enumerate(self.cones)]
        shares = np.hstack(
            [
                distances / self.contacts.position_error,
                np.column_stack(angles) / self.contacts.normal_error,
            ]
        )
        return np.maximum(shares - 1.0 + 1e-4, 0.0)

    def _slopes(self, turns: Floats, shifts: Floats) -> Floats:
        count, nudge = len(turns), 1e-7
        steps = np.repeat(np.concatenate([np.eye(6), -np.eye(6)]), count, axis=0) * nudge
        moved = self._moved(np.tile(turns, (12, 1, 1)), np.tile(shifts, (12, 1)), steps)
        values = self._violations(*moved).reshape(2, 6, count, -1)
        return ((values[0] - values[1]) / (2.0 * nudge)).transpose(1, 2, 0)

    def _moved(self, turns: Floats, shifts: Floats, steps: Floats) -> tuple[Floats, Floats]:
        # About the contacts' mean, which a turn then leaves where it is.
        middle = self.contacts.positions.mean(axis=0)
        extra = Rotation.from_rotvec(steps[:, :3]).as_matrix()
        arms = np.einsum("kij,kj->ki", extra, shifts - middle)
        return extra @ turns, middle + arms + self.size * steps[:, 3:]

    def _starts(self, rng: np.random.Generator, count: int) -> tuple[Floats, Floats]:
        """Poses near the rotation that the normals ask for, and anywhere."""
        measured = self.contacts.normals + 1e-9 * rng.normal(size=self.contacts.normals.shape)
        u, _, vt = np.linalg.svd(measured.T @ np.array([cone.mean(axis=0) for cone in self.cones]))
        best = Rotation.from_matrix(u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt)
        near = rng.normal(size=(count, 3)) * self.contacts.normal_error.max()
        turns = (best * Rotation.from_rotvec(near)).as_matrix()
        turns[::3] = Rotation.random(len(turns[::3]), rng=rng).as_matrix()
        gaps = self.contacts.positions - self.triangles.mean(axis=(1, 2)) @ turns.transpose(0, 2, 1)
        return turns, gaps.mean(axis=1)
