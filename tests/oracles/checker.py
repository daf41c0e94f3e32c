"""An independent judge of poses: plain numpy on a model's triangles, none of palpate's kernels.

A pose meets an interpretation if it puts every contact within its bound of the bounded face, edge
or vertex it is said to lie on, and every normal within its bound of that feature's normal cone.
`Oracle` looks for such a pose, by damped least squares from many starts.

What else is known is judged alike: paths by signed distances at many of their places, a support by
the corners' heights over it, standing by what tilts do to the centroid, approaches by normals.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import RigidTransform, Rotation

from palpate.recognizer import Contacts, FreeSpace, Polyhedron, SupportPlane
from palpate.recognizer.models.features import Features

Floats = NDArray[np.float64]


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


def angle_between(a: Floats, b: Floats) -> Floats:
    """Angles between unit vectors (..., 3), radians; accurate near 0 and pi too."""
    return 2.0 * np.arctan2(np.linalg.norm(a - b, axis=-1), np.linalg.norm(a + b, axis=-1))


def cone_angles(directions: Floats, cone: Floats) -> Floats:
    """Angles (...) of unit vectors (..., 3) from the convex cone of unit normals (k, 3), radians.

    In whatever order those come: the nearest direction is one of them, between two, or it is the
    vector itself, between three.
    """
    angles = np.stack([angle_between(directions, normal) for normal in cone]).min(axis=0)
    for pair in combinations(cone, 2):
        shares = directions @ np.linalg.pinv(np.array(pair))
        foot = shares @ np.array(pair)
        away = np.linalg.norm(directions - foot, axis=-1)
        angle = np.arctan2(away, np.linalg.norm(foot, axis=-1))
        angles = np.where((shares >= 0.0).all(axis=-1), np.minimum(angles, angle), angles)
    for three in combinations(cone, 3):
        if np.linalg.cond(np.array(three)) < 1e12:
            inside = (directions @ np.linalg.inv(np.array(three)) >= 0.0).all(axis=-1)
            angles = np.where(inside, 0.0, angles)
    return angles


def triangle_distances(points: Floats, triangles: Floats) -> Floats:
    """Distances of points (..., 3) from solid triangles (..., 3, 3), broadcast."""
    points = points[..., None, :]
    ends = np.roll(triangles, -1, axis=-2)
    edges = ends - triangles
    towards = points - triangles
    lengths = (edges**2).sum(-1)
    shares = (towards * edges).sum(-1) / np.where(lengths > 0.0, lengths, 1.0)
    gaps = towards - np.clip(shares, 0.0, 1.0)[..., None] * edges
    to_edges = np.sqrt((gaps**2).sum(-1)).min(-1)
    normals = np.cross(edges[..., 0, :], edges[..., 1, :])
    doubled = np.linalg.norm(normals, axis=-1)
    normals = normals / np.where(doubled > 0.0, doubled, 1.0)[..., None]
    inwards = np.cross(normals[..., None, :], edges)
    above = ((inwards * towards).sum(-1) >= 0.0).all(-1) & (doubled > 0.0)
    heights = np.abs((towards[..., 0, :] * normals).sum(-1))
    return np.where(above, heights, to_edges)


def signed_distances(model: Polyhedron, points: Floats) -> Floats:
    """Distances (n,) of points (n, 3) from a solid's surface, object frame; negative inside.

    Seen from inside, the triangles fill all directions: their solid angles add up to 4 pi.
    """
    triangles = model.vertices[model.triangles]
    distances = np.empty(len(points))
    for first in range(0, len(points), 512):
        part = slice(first, first + 512)
        a, b, c = np.moveaxis(triangles - points[part, None, None], 2, 0)
        la, lb, lc = (np.linalg.norm(x, axis=-1) for x in (a, b, c))
        across = (a * np.cross(b, c)).sum(-1)
        beside = la * lb * lc + (a * b).sum(-1) * lc + (a * c).sum(-1) * lb + (b * c).sum(-1) * la
        filled = 2.0 * np.arctan2(across, beside).sum(axis=1)
        gaps = triangle_distances(points[part, None], triangles).min(axis=1)
        distances[part] = np.where(filled > 2.0 * np.pi, -gaps, gaps)
    return distances


def path_distances(
    model: Polyhedron, T_world_object: RigidTransform, free_space: FreeSpace, places: int = 65
) -> Floats:
    """(m,) the least signed distance from an object among evenly spaced places of each path."""
    R, t = T_world_object.rotation.as_matrix(), T_world_object.translation
    one, other = (free_space.starts - t) @ R, (free_space.ends - t) @ R
    # Only where the object can be reached at all; the ends of that part are places too.
    along = other - one
    lengths = np.maximum(np.linalg.norm(along, axis=1), 1e-300)
    middle = 0.5 * (model.vertices.min(axis=0) + model.vertices.max(axis=0))
    about = ((middle - one) * along).sum(axis=1) / lengths**2
    half = (model.diameter + free_space.radius) / lengths
    low, high = np.clip(about - half, 0.0, 1.0), np.clip(about + half, 0.0, 1.0)
    shares = low + np.linspace(0.0, 1.0, places)[:, None] * (high - low)
    everywhere = one + shares[..., None] * along
    return signed_distances(model, everywhere.reshape(-1, 3)).reshape(places, -1).min(axis=0)


def standing_corners(model: Polyhedron, tilt: float = 1e-4) -> list[NDArray[np.intp]]:
    """The vertices of each face of the convex hull that a solid can stand on.

    All planes through three vertices that have all others on one side are faces. The solid can
    stand on one if every small tilt raises its centroid, to rounding.
    """
    points = model.vertices - model.centroid
    slack = 1e-6 * model.diameter
    found: dict[frozenset[int], NDArray[np.intp]] = {}
    triples = np.array(list(combinations(range(len(points)), 3)))
    for part in np.array_split(triples, -(-len(triples) // 20_000)):
        normals = np.cross(
            points[part[:, 1]] - points[part[:, 0]], points[part[:, 2]] - points[part[:, 0]]
        )
        lengths = np.linalg.norm(normals, axis=1)
        thick = lengths > 1e-4 * model.diameter**2
        normals = normals[thick] / lengths[thick, None]
        heights = normals @ points.T
        heights -= (normals * points[part[thick, 0]]).sum(axis=1)[:, None]
        for sign in (1.0, -1.0):
            for row in np.flatnonzero((sign * heights < slack).all(axis=1)):
                members = np.flatnonzero(np.abs(heights[row]) < slack)
                if frozenset(members.tolist()) in found:
                    continue
                # Which way is down, a little off the face's normal: all around it.
                helper = np.eye(3)[np.abs(normals[row]).argmin()]
                one = np.cross(normals[row], helper)
                one /= np.linalg.norm(one)
                other = np.cross(normals[row], one)
                around = np.linspace(0.0, 2.0 * np.pi, 720, endpoint=False)[:, None]
                lean = np.cos(around) * one + np.sin(around) * other
                down = sign * normals[row] + tilt * lean
                down /= np.linalg.norm(down, axis=1, keepdims=True)
                above = (points @ (sign * normals[row])).max()
                # To second order in the tilt, standing over an edge loses half its square.
                if ((points @ down.T).max(axis=0) > above * (1.0 - tilt**2)).all():
                    found[frozenset(members.tolist())] = members
    return list(found.values())


def broken(
    model: Polyhedron,
    T_world_object: RigidTransform,
    contacts: Contacts,
    faces: NDArray[np.integer],
    *,
    free_space: FreeSpace | None = None,
    support: SupportPlane | None = None,
    standing: list[NDArray[np.intp]] | None = None,
    features: Features | None = None,
) -> list[str]:
    """What an interpretation at a pose breaks of everything that is known; empty if nothing."""
    found: list[str] = []
    known = check(model, T_world_object, contacts, faces, features=features)
    found += [f"contact {row}" for row in np.flatnonzero(~known.within)]
    tiny = 1e-7 * model.diameter
    if free_space is not None and len(free_space):
        lacks = free_space.radius - free_space.error
        lacks = lacks - path_distances(model, T_world_object, free_space)
        found += [f"path {row} by {lacks[row]:.3g}" for row in np.flatnonzero(lacks > tiny)]
    if support is not None:
        up = np.array(support.normal) / np.linalg.norm(support.normal)
        heights = T_world_object.apply(model.vertices) @ up - support.height
        if heights.min() < -support.error - tiny:
            found.append(f"support by {-support.error - heights.min():.3g}")
        if support.resting:
            standing = standing_corners(model) if standing is None else standing
            offs = [np.abs(heights[members]).max() for members in standing]
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
