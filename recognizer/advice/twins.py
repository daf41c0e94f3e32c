"""Parts of a library that are hard to tell apart, and where they differ."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import RigidTransform, Rotation

from ..contacts.contacts import Contacts
from ..models.polyhedron import Polyhedron
from ..models.symmetry import LENGTH_TOLERANCE, leaning_frame
from ..recognize import Recognizer

Floats = NDArray[np.float64]

DRAWS = 20
"""Sets of touches that are drawn of each part."""
TOUCHES = 8
"""In each; with fewer, much fits that a few more rule out."""
POINTS = 400
"""Of a part's surface at which it is held against another."""


@dataclass(frozen=True, eq=False)
class Twins:
    """A part, and another that it may be taken for."""

    part: str
    other: str
    share: float
    """Of the draws of touches of the part, how many fit the other too."""
    apart: float
    """How far the part's surface is from the other's, laid over it as well as any draw did, at the
    farthest place, metres."""
    place: Floats
    """(3,) that place, in the part's own frame, metres."""
    normal: Floats
    """(3,) the part's outward normal there: touch against it."""


def near_twins(
    recognizer: Recognizer,
    rng: np.random.Generator,
    *,
    position_error: float,
    normal_error: float,
    draws: int = DRAWS,
    touches: int = TOUCHES,
) -> Iterator[list[Twins]]:
    """For each part of a library in turn, the others that random touches of it fit.

    Args:
        recognizer: with the library.
        rng: source of the touches.
        position_error: bound on positions, metres.
        normal_error: bound on normals, radians.
        draws: sets of touches of each part.
        touches: in each set.

    Yields:
        A list a part, in the library's order, the likeliest twin first.
    """
    by_name = {model.name: model for model in recognizer.models}
    for part in recognizer.models:
        poses: dict[str, list[RigidTransform]] = {}
        for _ in range(draws):
            points, faces = sample_surface(part, touches, rng)
            contacts = Contacts(
                points,
                part.normals[faces],
                position_error=position_error,
                normal_error=normal_error,
            )
            best: dict[str, RigidTransform] = {}
            for hypothesis in recognizer.recognize(contacts).hypotheses:
                best.setdefault(hypothesis.object_name, hypothesis.pose)
            for name, pose in best.items():
                if name != part.name:
                    poses.setdefault(name, []).append(pose)
        surface = sample_surface(part, POINTS, rng)
        found = [
            _held_against(part, surface, by_name[name], laid, len(laid) / draws)
            for name, laid in poses.items()
        ]
        yield sorted(found, key=lambda twins: -twins.share)


def same_parts(models: Sequence[Polyhedron]) -> list[tuple[str, str]]:
    """Pairs of models that are one part, anyhow turned and shifted: two files of it.

    A mirror image is another part.
    """
    return [
        (one.name, other.name)
        for one, other in combinations(models, 2)
        if one.face_count == other.face_count and _can_be_laid_over(one, other)
    ]


def _can_be_laid_over(one: Polyhedron, other: Polyhedron) -> bool:
    slack = LENGTH_TOLERANCE * one.diameter
    if abs(one.diameter - other.diameter) > slack:
        return False
    first, second = (np.sort(model.areas) for model in (one, other))
    if np.abs(first - second).max() > slack * one.diameter:
        return False
    points, _ = sample_surface(one, POINTS // 4, np.random.default_rng(0))
    return any(
        surface_distances(other, pose.apply(points)).max() < slack
        for pose in _layings(one, other, slack)
    )


def _layings(one: Polyhedron, other: Polyhedron, slack: float) -> Iterator[RigidTransform]:
    """Poses of a part that put two of its faces on two of the other's that look like them."""
    first = int(one.areas.argmax())
    leaning = np.linalg.norm(np.cross(one.normals[first], one.normals), axis=1)
    second = int(leaning.argmax())
    cosines = other.normals @ other.normals.T
    alike = np.abs(other.areas - one.areas[[[first], [second]]]) < slack * one.diameter
    pairs = alike[0][:, None] & alike[1]
    pairs &= np.abs(cosines - one.normals[first] @ one.normals[second]) < 1e-3
    frame = leaning_frame(one.normals[first], one.normals[second])
    for image, beside in np.argwhere(pairs):
        turn = leaning_frame(other.normals[image], other.normals[beside]) @ frame.T
        shift = other.centroid - turn @ one.centroid
        yield RigidTransform.from_components(shift, Rotation.from_matrix(turn))


def _held_against(
    part: Polyhedron,
    surface: tuple[Floats, NDArray[np.int64]],
    other: Polyhedron,
    poses: list[RigidTransform],
    share: float,
) -> Twins:
    """Where two parts differ most, as they lie over each other at the best of some poses."""
    points, faces = surface
    gaps = [surface_distances(other, pose.inv().apply(points)) for pose in poses]
    best = min(gaps, key=lambda gap: float(gap.max()))
    row = int(best.argmax())
    return Twins(
        part.name, other.name, share, float(best[row]), points[row], part.normals[faces[row]]
    )


def sample_surface(
    model: Polyhedron, count: int, rng: np.random.Generator
) -> tuple[Floats, NDArray[np.int64]]:
    """Points uniform on a model's surface, (n, 3) in its frame, metres, and their (n,) faces."""
    corners = model.vertices[model.triangles]
    areas = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    chosen = rng.choice(len(areas), count, p=areas / areas.sum())
    first, second = rng.random((2, count, 1))
    folded = first + second > 1.0
    first, second = np.where(folded, 1.0 - first, first), np.where(folded, 1.0 - second, second)
    a, b, c = corners[chosen].transpose(1, 0, 2)
    return a + first * (b - a) + second * (c - a), model.triangle_faces[chosen]


def surface_distances(model: Polyhedron, points_object: Floats) -> Floats:
    """(n,) how far points are from a model's surface, metres."""
    from trimesh.triangles import closest_point

    corners = model.vertices[model.triangles]
    nearest = np.full(len(points_object), np.inf)
    for triangle in corners:
        places = closest_point(np.tile(triangle, (len(points_object), 1, 1)), points_object)
        nearest = np.minimum(nearest, np.linalg.norm(places - points_object, axis=1))
    return nearest
