"""Solids to be cut into convex parts, and what a union of parts holds, point by point."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import trimesh
from manifold3d import Manifold
from oracles import solids as oracles
from oracles.geometry import windings
from scipy.spatial.transform import Rotation

from palpate.assets import ConvexPart
from palpate.envs.collision.collision import CollisionParts
from palpate.recognizer import Polyhedron


def user_mesh(name: str) -> Polyhedron:
    """A stand-in as a mesh that nothing is known of."""
    return replace(oracles.model(name), name=f"my {name}")


def some_convex_solid(rng: np.random.Generator) -> Manifold:
    """A box, a prism or a random hull, mostly turned and off centre."""
    kind = rng.integers(3)
    if kind == 0:
        points = np.stack(np.meshgrid([-1, 1], [-1, 1], [-1, 1]), axis=-1).reshape(-1, 3)
        points = points * rng.uniform(0.15, 0.6, 3)
    elif kind == 1:
        points = oracles.prism(int(rng.integers(3, 8)), 1.0).vertices * rng.uniform(0.2, 0.6, 3)
    else:
        points = oracles.random_hull(int(rng.integers(5, 10)), int(rng.integers(1000))).vertices
    if rng.random() < 0.6:
        points = Rotation.random(rng=rng).apply(points)
    if rng.random() < 0.8:
        points = points + rng.uniform(-0.4, 0.4, 3)
    return Manifold.hull_points(np.ascontiguousarray(points, np.float64))


@cache
def random_csg(seed: int) -> Polyhedron:
    """Convex solids added and taken away, a few centimetres large: notches, holes and all."""
    rng = np.random.default_rng(seed)
    solid = some_convex_solid(rng)
    for _ in range(int(rng.integers(1, 6))):
        other = some_convex_solid(rng)
        solid = solid + other if rng.random() < 0.5 else solid - other
    mesh = solid.to_mesh64()
    vertices = 0.05 * np.asarray(mesh.vert_properties)[:, :3]
    faces = np.asarray(mesh.tri_verts).astype(np.int64)
    return Polyhedron.from_mesh(trimesh.Trimesh(vertices, faces, process=False), name=f"csg-{seed}")


CSG_SEEDS = tuple(range(100, 109))


def convex_solids() -> dict[str, Polyhedron]:
    """Johnson solids, Archimedean ones and the like."""
    square = np.array([[1, 1, 0], [1, -1, 0], [-1, 1, 0], [-1, -1, 0]], float)
    permuted = np.array([np.roll([0, a, b], k) for k in range(3) for a in (-1, 1) for b in (-1, 1)])
    truncated = [
        np.array(order) * signs
        for order in ((0, 1, 2), (0, 2, 1), (1, 0, 2), (1, 2, 0), (2, 0, 1), (2, 1, 0))
        for signs in np.stack(np.meshgrid([-1, 1], [-1, 1], [-1, 1]), axis=-1).reshape(-1, 3)
    ]
    points = {
        "square pyramid": [*square, [0, 0, 2**0.5]],
        "elongated pyramid": [*square, *(square + [0, 0, 2]), [0, 0, 2 + 2**0.5]],
        "gyrobifastigium": [*square, *[[x, 0, 3**0.5] for x in (-1, 1)]]
        + [[0, y, -(3**0.5)] for y in (-1, 1)],
        "cuboctahedron": permuted,
        "truncated octahedron": truncated,
        "needle": oracles.prism(5, 40.0).vertices,
        "plate": oracles.prism(7, 0.01).vertices,
    }
    return {
        name: Polyhedron.from_mesh(oracles.hull_of(0.02 * np.asarray(corners)), name=name)
        for name, corners in points.items()
    }


def in_parts(parts: tuple[ConvexPart, ...], points: np.ndarray) -> np.ndarray:
    return np.any([in_part(part, points) for part in parts], axis=0)


def in_part(part: ConvexPart, points: np.ndarray) -> np.ndarray:
    """Below every triangle that has a direction to speak of."""
    a, b, c = part.vertices[part.triangles].transpose(1, 0, 2)
    normals = np.cross(b - a, c - a)
    sizes = np.linalg.norm(normals, axis=1)
    broad = sizes > 1e-9 * np.ptp(part.vertices, axis=0).max() ** 2
    normals = normals[broad] / sizes[broad, None]
    return ((points[:, None] - a[broad]) * normals).sum(axis=-1).max(axis=1) <= 0.0


def trial_points(model: Polyhedron, rng: np.random.Generator, count: int = 250) -> np.ndarray:
    """Points all over the box around a solid, and others a hair above and below its surface."""
    low, high = model.vertices.min(axis=0), model.vertices.max(axis=0)
    rows = rng.integers(len(model.triangles), size=count)
    on_surface = oracles.points_on(model, rows, rng)
    hair = 1e-4 * model.diameter * model.normals[model.triangle_faces[rows]]
    anywhere = rng.uniform(low - 0.05 * (high - low), high + 0.05 * (high - low), (count, 3))
    return np.concatenate([anywhere, on_surface + hair, on_surface - hair])


def part_volumes(parts: tuple[ConvexPart, ...]) -> float:
    return sum(
        float(trimesh.Trimesh(part.vertices, part.triangles, process=False).volume)
        for part in parts
    )


def assert_union_is_the_solid(model: Polyhedron, found: CollisionParts) -> None:
    points = trial_points(model, np.random.default_rng(0))
    inside = windings(model.vertices[model.triangles], points)
    assert np.abs(inside - np.round(inside)).max() < 1e-6
    assert inside.max() > 0.5 > inside.min()
    assert np.array_equal(in_parts(found.parts, points), inside > 0.5)


def remade(model: Polyhedron, vertices: np.ndarray) -> Polyhedron:
    mesh = trimesh.Trimesh(vertices, model.triangles, process=False)
    return Polyhedron.from_mesh(mesh, name=model.name)


def together(one: trimesh.Trimesh, other: trimesh.Trimesh) -> Polyhedron:
    """Two surfaces as one mesh."""
    vertices = np.concatenate([one.vertices, other.vertices])
    faces = np.concatenate([one.faces, other.faces + len(one.vertices)])
    return Polyhedron.from_mesh(trimesh.Trimesh(vertices, faces, process=False), name="two")


ROTATION = Rotation.from_rotvec([0.3, 0.7, 0.2])


def hollow_block() -> Polyhedron:
    """A block with a void inside that doesn't show."""
    cells = np.ones((3, 3, 3))
    cells[1, 1, 1] = 0
    lines = [0.0, 0.01, 0.03, 0.04]
    return Polyhedron.from_mesh(oracles.blocks(cells, lines, lines, lines), name="hollow")


def resized(part: ConvexPart, share: float) -> ConvexPart:
    middle = part.vertices.mean(axis=0)
    return ConvexPart(middle + (1.0 + share) * (part.vertices - middle), part.triangles)
