"""Plain geometry of solids, for oracles and for the lab's judges: numpy, no kernel of palpate.

Everything here is written a second time on purpose, slowly and simply, so that an error in the
recogniser's own geometry can't hide itself.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

Floats = NDArray[np.float64]

COPLANAR = 1e-6
"""Share of the diameter within which corners are on one plane, and a centre above an edge."""
CHUNK = 100_000
"""Pairs of a point and a triangle that are looked at at once, so that they fit a cache."""


class Solid(Protocol):
    """What is asked of a model of palpate's, whatever name it was imported by."""

    @property
    def vertices(self) -> Floats:
        """(v, 3) metres."""
        ...

    @property
    def triangles(self) -> NDArray[np.integer]:
        """(t, 3) rows of `vertices`, counter-clockwise from outside."""
        ...


def angle_between(a: Floats, b: Floats) -> Floats:
    """Angles between vectors (..., d) of any length, radians; accurate near 0 and pi too."""
    one, other = (v * np.linalg.norm(w, axis=-1, keepdims=True) for v, w in ((a, b), (b, a)))
    apart, together = np.linalg.norm(one - other, axis=-1), np.linalg.norm(one + other, axis=-1)
    return 2.0 * np.arctan2(apart, together)


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


def segment_distances(points: Floats, segments: Floats) -> Floats:
    """Distances of points (..., d) from segments (..., 2, d), broadcast."""
    start, along = segments[..., 0, :], segments[..., 1, :] - segments[..., 0, :]
    squares = (along**2).sum(-1)
    shares = ((points - start) * along).sum(-1) / np.where(squares > 0.0, squares, 1.0)
    gaps = points - start - np.clip(shares, 0.0, 1.0)[..., None] * along
    return np.linalg.norm(gaps, axis=-1)


def triangle_distances(points: Floats, triangles: Floats) -> Floats:
    """Distances of points (..., 3) from solid triangles (..., 3, 3), flat ones too, broadcast."""
    points = points[..., None, :]
    edges = np.roll(triangles, -1, axis=-2) - triangles
    towards = points - triangles
    lengths = (edges**2).sum(-1)
    shares = (towards * edges).sum(-1) / np.where(lengths > 0.0, lengths, 1.0)
    gaps = towards - np.clip(shares, 0.0, 1.0)[..., None] * edges
    to_edges = np.sqrt((gaps**2).sum(-1).min(-1))
    normals = np.cross(edges[..., 0, :], edges[..., 1, :])
    doubled = np.linalg.norm(normals, axis=-1)
    normals = normals / np.where(doubled > 0.0, doubled, 1.0)[..., None]
    inwards = np.cross(normals[..., None, :], edges)
    above = ((inwards * towards).sum(-1) >= 0.0).all(-1) & (doubled > 0.0)
    heights = np.abs((towards[..., 0, :] * normals).sum(-1))
    return np.where(above, heights, to_edges)


def windings(triangles: Floats, points: Floats) -> Floats:
    """(p,) how often a closed surface (t, 3, 3) is wound about points (p, 3): 1 inside, 0 outside.

    The solid angle of it that each sees, over 4 pi (Van Oosterom and Strackee 1983).
    """
    a, b, c = np.moveaxis(triangles - points[:, None, None], 2, 0)
    la, lb, lc = (np.linalg.norm(side, axis=-1) for side in (a, b, c))
    volumes = (a * np.cross(b, c)).sum(-1)
    beside = la * lb * lc + (a * b).sum(-1) * lc + (b * c).sum(-1) * la + (c * a).sum(-1) * lb
    return np.arctan2(volumes, beside).sum(axis=1) / (2.0 * np.pi)


def signed_distances(model: Solid, points: Floats) -> Floats:
    """(p,) distances of points (p, 3) from a solid's surface, object frame, negative inside it."""
    triangles = model.vertices[model.triangles]
    found = np.empty(len(points))
    step = max(1, CHUNK // len(triangles))
    for first in range(0, len(points), step):
        some = points[first : first + step]
        distances = triangle_distances(some[:, None], triangles).min(axis=1)
        inside = windings(triangles, some) > 0.5
        found[first : first + step] = np.where(inside, -distances, distances)
    return found


def nearest_on_paths(
    model: Solid, starts: Floats, ends: Floats, clearances: Floats, grains: Floats
) -> Floats:
    """(m,) the least signed distance from a solid that is found along straight paths.

    Paths (m, 3), object frame, are walked in steps that a signed distance allows, which changes no
    faster than the path is long: between two places looked at a path is no nearer than its
    clearance less its grain. Paths end early where they are too near.
    """
    spans = np.linalg.norm(ends - starts, axis=1)
    along = (ends - starts) / np.where(spans > 0.0, spans, 1.0)[:, None]
    at, least = np.zeros(len(starts)), np.full(len(starts), np.inf)
    walking = np.arange(len(starts))
    while len(walking):
        places = starts[walking] + at[walking, None] * along[walking]
        distances = signed_distances(model, places)
        least[walking] = np.minimum(least[walking], distances)
        room = distances - clearances[walking]
        going = (room > -grains[walking]) & (at[walking] < spans[walking])
        steps = np.maximum(room, grains[walking])
        at[walking] = np.minimum(at[walking] + steps, spans[walking])
        walking = walking[going]
    return least


def centre_of_volume(triangles: Floats) -> Floats:
    """(3,) the centre of what a closed surface (t, 3, 3) holds: of the cones over its triangles."""
    apex = triangles.mean(axis=(0, 1))
    arms = triangles - apex
    volumes = np.linalg.det(arms)
    return apex + 0.75 * (volumes @ arms.mean(axis=1)) / volumes.sum()


@dataclass(frozen=True, eq=False)
class Footing:
    """A face of a solid's convex hull that it can stand on."""

    normal: Floats
    """(3,) outward, object frame."""
    corners: Floats
    """(k, 3) object frame, metres."""


def footings(model: Solid, slack: float = 0.0) -> list[Footing]:
    """The faces of a solid's convex hull that have its centre of volume above them.

    Args:
        model: the solid.
        slack: by how much the centre may be beside a face, metres.
    """
    corners, centre = model.vertices, centre_of_volume(model.vertices[model.triangles])
    coplanar = COPLANAR * np.linalg.norm(corners[:, None] - corners, axis=2).max()
    found: list[Footing] = []
    for normal in ConvexHull(corners).equations[:, :3]:
        if any(normal @ known.normal > 1.0 - 1e-9 for known in found):
            continue
        along = corners @ normal
        on_it = corners[along > along.max() - coplanar]
        u = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
        u /= np.linalg.norm(u)
        flat = np.stack([u, np.cross(normal, u)])
        hull = ConvexHull(on_it @ flat.T)
        if (hull.equations @ np.append(flat @ centre, 1.0) <= slack).all():
            found.append(Footing(normal, on_it[hull.vertices]))
    return found
