"""Slow and plain twins of the recogniser's kernels, and the samplers that tests share.

Nothing here calls the code it checks: distances come with a proof of their own, masks from the
memo's formulas spelled out in numpy, trees from enumeration or from Python's own integers, rays
from one line of linear algebra a triangle.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import trimesh
from numpy.typing import ArrayLike, NDArray
from oracles.geometry import angle_between
from scipy.spatial.transform import RigidTransform, Rotation

from palpate.assets import STAND_IN_NAMES, mesh_path
from palpate.envs.sensors.noise import uniform_in_ball, uniform_in_cone
from palpate.recognizer import Contacts, PairTables, Polyhedron

Floats = NDArray[np.float64]
Margins = Callable[[Any, Contacts, int, int, tuple[str, ...]], Floats]

# --- Solids ---------------------------------------------------------------------------------


def blocks(cells: ArrayLike, x: ArrayLike, y: ArrayLike, z: ArrayLike) -> trimesh.Trimesh:
    """The union of the filled cells of a grid with the given lines, two triangles a square."""
    lines = [np.asarray(axis, float) for axis in (x, y, z)]
    filled = np.pad(np.asarray(cells, bool), 1)
    corners, quads = [], []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        for cell in np.argwhere(filled):
            for side in (0, 1):
                neighbour = cell.copy()
                neighbour[axis] += 2 * side - 1
                if filled[tuple(neighbour)]:
                    continue
                ring = (
                    [(0, 0), (1, 0), (1, 1), (0, 1)] if side else [(0, 0), (0, 1), (1, 1), (1, 0)]
                )
                quads.append(range(len(corners), len(corners) + 4))
                for du, dv in ring:
                    at = cell - 1
                    at[axis] += side
                    at[u] += du
                    at[v] += dv
                    corners.append([lines[k][at[k]] for k in range(3)])
    triangles = [(q[a], q[b], q[c]) for q in quads for a, b, c in ((0, 1, 2), (0, 2, 3))]
    mesh = trimesh.Trimesh(np.array(corners), triangles, process=False)
    mesh.merge_vertices()
    return mesh


def box(*sides: float) -> trimesh.Trimesh:
    return blocks([[[1]]], *([0.0, side] for side in sides))


def l_block() -> trimesh.Trimesh:
    """Eight faces, two of them concave, and no symmetry but the identity."""
    return blocks([[[1], [1]], [[1], [0]]], [0, 1, 2.5], [0, 0.7, 3], [0, 1.3])


def holed_block() -> trimesh.Trimesh:
    """A block with a square hole through it: two faces with holes, ten faces in all."""
    cells = np.ones((3, 3, 1))
    cells[1, 1] = 0
    return blocks(cells, [0, 1, 2.2, 4], [0, 1.5, 2, 3], [0, 1])


def pocketed_block() -> trimesh.Trimesh:
    """A block with a pocket that doesn't go through: a face with a hole, eleven faces."""
    cells = np.ones((3, 3, 2))
    cells[1, 1, 1] = 0
    return blocks(cells, [0, 1, 2.2, 4], [0, 1.5, 2, 3], [0, 1, 1.6])


def bridge() -> trimesh.Trimesh:
    """A slab on two feet: the feet's soles are coplanar and apart."""
    return blocks([[[1, 1]], [[0, 1]], [[1, 1]]], [0, 1, 2, 3.5], [0, 1], [0, 1, 2])


def hull_of(points: ArrayLike) -> trimesh.Trimesh:
    return trimesh.convex.convex_hull(np.asarray(points, float))


def tetrahedron(edge: float = 1.0) -> trimesh.Trimesh:
    corners = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) * edge / np.sqrt(8.0)
    return hull_of(corners)


def prism(sides: int, height: float) -> trimesh.Trimesh:
    """A regular prism about z with unit circumradius."""
    around = 2.0 * np.pi * np.arange(sides) / sides
    ring = np.column_stack([np.cos(around), np.sin(around), np.zeros(sides)])
    return hull_of(np.concatenate([ring, ring + [0, 0, height]]))


def random_hull(corners: int, seed: int) -> trimesh.Trimesh:
    """A convex polyhedron whose faces are all triangles."""
    points = np.random.default_rng(seed).normal(size=(corners, 3))
    return hull_of(points / np.linalg.norm(points, axis=1, keepdims=True) * [1.0, 0.6, 0.3])


SOLIDS = {
    "cube": lambda: box(1, 1, 1),
    "tetrahedron": tetrahedron,
    "l-block": l_block,
    "holed": holed_block,
    "pocketed": pocketed_block,
    "bridge": bridge,
    "hull-20": lambda: random_hull(12, 1),
    "hull-90": lambda: random_hull(47, 2),
}


@cache
def model(name: str) -> Polyhedron:
    """A stand-in or one of `SOLIDS`."""
    source = mesh_path(name) if name in STAND_IN_NAMES else SOLIDS[name]()
    return Polyhedron.from_mesh(source, name=name)


@cache
def tables(name: str) -> PairTables:
    return PairTables.of(model(name))


def mesh_of(model: Polyhedron, scale: float = 1.0) -> trimesh.Trimesh:
    """A model's surface, in other units perhaps."""
    return trimesh.Trimesh(scale * model.vertices, model.triangles, process=False)


def scaled(name: str, diameter: float) -> Polyhedron:
    """A stand-in or one of `SOLIDS`, made as large as is asked for."""
    mesh = mesh_of(model(name), diameter / model(name).diameter)
    return Polyhedron.from_mesh(mesh, name=f"scaled {name}")


# --- Samplers -------------------------------------------------------------------------------


def points_on(
    model: Polyhedron, triangles: NDArray[np.integer], rng: np.random.Generator
) -> Floats:
    """(n, 3) a point on each of the given triangles, uniform."""
    weights = rng.dirichlet(np.ones(3), np.size(triangles))
    return np.einsum("nk,nkd->nd", weights, model.vertices[model.triangles[triangles]])


def random_pose(rng: np.random.Generator, extent: float = 0.5) -> RigidTransform:
    """Any rotation, and a shift of up to an extent along each axis, metres."""
    return RigidTransform.from_components(rng.uniform(-extent, extent, 3), Rotation.random(rng=rng))


def surface_points(
    model: Polyhedron, count: int, rng: np.random.Generator, *, awkward: bool = False
) -> tuple[Floats, NDArray[np.int64]]:
    """Points on a model's surface and the faces they are on, object frame.

    Uniform by area; ``awkward`` mixes in points of edges and corners, neighbours on one face and
    the same point twice.
    """
    corners = model.vertices[model.triangles]
    crosses = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.linalg.norm(crosses, axis=1)
    chosen = rng.choice(len(areas), count, p=areas / areas.sum())
    points, faces = points_on(model, chosen, rng), model.triangle_faces[chosen]
    if awkward:
        for row in range(count):
            kind = rng.integers(6)
            before = int(rng.integers(row)) if row else 0
            if kind in (1, 2):
                weights = rng.dirichlet(np.ones(3))
                weights[rng.permutation(3)[:kind]] = 0.0
                points[row] = weights @ corners[chosen[row]] / weights.sum()
            elif kind == 3 and row:
                same = np.flatnonzero(model.triangle_faces == faces[before])
                points[row] = points_on(model, rng.choice(same, 1), rng)[0]
                faces[row] = faces[before]
            elif kind == 4 and row:
                points[row], faces[row] = points[before], faces[before]
    return points, faces


def noisy_contacts(
    points: Floats,
    normals: Floats,
    rng: np.random.Generator,
    *,
    position_error: ArrayLike,
    normal_error: ArrayLike,
    at_bounds: bool = False,
) -> Contacts:
    """Contacts whose truth lies inside their bounds, or on the very bounds."""
    count = len(points)
    delta = np.broadcast_to(np.asarray(position_error, float), count)
    alpha = np.broadcast_to(np.asarray(normal_error, float), count)
    shifts = uniform_in_ball(rng, count, 1.0)
    leaning = np.array(
        [uniform_in_cone(rng, normals[[k]], float(alpha[k]))[0] for k in range(count)]
    ).reshape(-1, 3)
    if at_bounds:
        # Neighbours pulled together or apart as far as they go, normals along with them.
        along = points - points[rng.permutation(count)] + 1e-9 * rng.normal(size=(count, 3))
        straight = rng.random((count, 1)) < 0.5
        shifts = np.where(straight, along * rng.choice([-1, 1], (count, 1)), shifts)
        shifts /= np.linalg.norm(shifts, axis=1, keepdims=True)
        towards = np.where(straight, shifts, rng.normal(size=(count, 3)))
        axes = np.cross(normals, towards)
        axes[np.linalg.norm(axes, axis=1) < 1e-6] = 0.0
        lengths = np.linalg.norm(axes, axis=1, keepdims=True)
        axes = np.divide(axes, lengths, out=axes, where=lengths > 0.0)
        leaning = Rotation.from_rotvec(axes * alpha[:, None]).apply(normals)
    return Contacts(
        points + delta[:, None] * shifts, leaning, position_error=delta, normal_error=alpha
    )


def random_contacts(
    model: Polyhedron,
    T_world_object: RigidTransform,
    count: int,
    rng: np.random.Generator,
    *,
    position_error: ArrayLike,
    normal_error: ArrayLike,
    awkward: bool = False,
    at_bounds: bool = False,
) -> tuple[Contacts, NDArray[np.int64]]:
    """Contacts with a model at a pose, and the faces that they are truly on."""
    points, faces = surface_points(model, count, rng, awkward=awkward)
    contacts = noisy_contacts(
        T_world_object.apply(points),
        T_world_object.rotation.apply(model.normals[faces]),
        rng,
        position_error=position_error,
        normal_error=normal_error,
        at_bounds=at_bounds,
    )
    return contacts, faces


# --- Ranges ---------------------------------------------------------------------------------


def convex_distance(p: Floats, q: Floats) -> tuple[float, float]:
    """The distance of two convex hulls as a bracket: one attained, one that nothing undercuts.

    The point nearest to the origin of the hull of all differences lies between at most three of
    them (four only if the origin is inside): all pairs and triples are tried. The plane through it
    across its direction, if nothing lies nearer than that, is the proof.
    """
    d = (p[:, None] - q[None]).reshape(-1, 3)
    a, b = d[np.array(list(itertools.combinations(range(len(d)), 2))).T]
    along = b - a
    squares = np.maximum((along**2).sum(axis=1), 1e-300)
    share = np.clip(-(a * along).sum(axis=1) / squares, 0.0, 1.0)
    a, b, c = d[np.array(list(itertools.combinations(range(len(d)), 3))).T]
    u, v = b - a, c - a
    normal = np.cross(u, v)
    area = (normal**2).sum(axis=1)
    within = area > 1e-20 * (u**2).sum(axis=1) * (v**2).sum(axis=1)
    a, u, v, normal, area = a[within], u[within], v[within], normal[within], area[within]
    foot = normal * ((a * normal).sum(axis=1) / area)[:, None]
    s = (np.cross(foot - a, v) * normal).sum(axis=1) / area
    t = (np.cross(u, foot - a) * normal).sum(axis=1) / area
    inside = (s >= 0.0) & (t >= 0.0) & (s + t <= 1.0)
    first = d[np.array(list(itertools.combinations(range(len(d)), 2)))[:, 0]]
    candidates = np.concatenate([first + share[:, None] * along, foot[inside]])
    nearest = candidates[(candidates**2).sum(axis=1).argmin()]
    attained = float(np.linalg.norm(nearest))
    if attained < 1e-12 * np.abs(d).max():
        return attained, 0.0
    return attained, float((d @ nearest).min()) / attained


def triangles_of(model: Polyhedron, face: int) -> Floats:
    return model.vertices[model.triangles[model.triangle_faces == face]]


def face_distance(model: Polyhedron, a: int, b: int) -> tuple[float, float]:
    """A bracket of the least distance of two faces, all triangles against all."""
    pairs = itertools.product(triangles_of(model, a), triangles_of(model, b))
    brackets = np.array([convex_distance(s, t) for s, t in pairs])
    return float(brackets[:, 0].min()), float(brackets[:, 1].min())


# --- The tree -------------------------------------------------------------------------------


def pair_margins(
    tables: PairTables, contacts: Contacts, i: int, j: int, constraints: tuple[str, ...]
) -> Floats:
    """(f, f) by how much each pair of faces fits two contacts (negative: it doesn't).

    The memo's constraints of Section 2.1 with each ball of position error in every one, the cone
    of directions clamped to [0, pi], and the direction constraint's ends in order.
    """
    p, n = contacts.positions, contacts.normals
    delta = contacts.position_error[i] + contacts.position_error[j]
    alpha_i, alpha_j = contacts.normal_error[i], contacts.normal_error[j]
    d = p[j] - p[i]
    length = float(np.linalg.norm(d))
    margins = [np.full_like(tables.angle, np.inf)]
    if "distance" in constraints:
        margins += [length + delta - tables.distance_min, tables.distance_max - length + delta]
    if "angle" in constraints:
        gamma = angle_between(n[i], n[j])
        margins += [alpha_i + alpha_j + 1e-9 - np.abs(tables.angle - gamma)]
    omegas = [angle_between(n[i], d), angle_between(n[j], -d)] if length else [np.pi / 2] * 2
    for omega, alpha, turn in ((omegas[0], alpha_i, False), (omegas[1], alpha_j, True)):
        if "component" in constraints:
            steepest = min(np.pi, omega + alpha)
            flattest = max(0.0, omega - alpha)
            least, most = length * np.cos(steepest) - delta, length * np.cos(flattest) + delta
            low, high = tables.component_min, tables.component_max
            low, high = (low.T, high.T) if turn else (low, high)
            margins += [most - low, high - least]
        if "tilt" in constraints:
            swing = float(np.arcsin(delta / length)) if length > delta else np.pi
            low, high = tables.tilt_min, tables.tilt_max
            low, high = (low.T, high.T) if turn else (low, high)
            margins += [omega + alpha + swing - low, high - omega + alpha + swing]
    return np.min(margins, axis=0)


def pair_is_allowed(
    tables: Any,
    contacts: Contacts,
    constraints: tuple[str, ...],
    margins: Margins = pair_margins,
) -> dict[tuple[int, int], NDArray[np.bool_]]:
    """For all i < j, which faces (of i, of j) fit contacts i and j."""
    pairs = itertools.combinations(range(len(contacts)), 2)
    return {(i, j): margins(tables, contacts, i, j, constraints) >= 0.0 for i, j in pairs}


def enumerate_interpretations(
    tables: Any,
    contacts: Contacts,
    constraints: tuple[str, ...],
    margins: Margins = pair_margins,
) -> NDArray[np.int64]:
    """All assignments of faces to contacts, every one tried.

    Args:
        tables: of a solid; of an outline too, whose edges are its faces.
        contacts: what was felt.
        constraints: their names.
        margins: by how much pairs of faces fit; of an outline, that of `oracles.outlines`.
    """
    count = len(contacts)
    grid = np.indices((tables.face_count,) * count).reshape(count, -1).T
    fits = np.ones(len(grid), bool)
    for (i, j), allowed in pair_is_allowed(tables, contacts, constraints, margins).items():
        fits &= allowed[grid[:, i], grid[:, j]]
    return grid[fits]


def search_interpretations(
    tables: PairTables, contacts: Contacts, constraints: tuple[str, ...]
) -> tuple[list[tuple[int, ...]], list[int]]:
    """All interpretations, level by level on Python's integers; and how many at each level."""
    allowed = pair_is_allowed(tables, contacts, constraints)
    rows = {
        pair: [sum(1 << int(b) for b in np.flatnonzero(row)) for row in table]
        for pair, table in allowed.items()
    }
    alive: list[tuple[int, ...]] = [()]
    counts = []
    for j in range(len(contacts)):
        grown = []
        for prefix in alive:
            bits = (1 << tables.face_count) - 1
            for i, face in enumerate(prefix):
                bits &= rows[i, j][face]
            grown += [(*prefix, b) for b in range(tables.face_count) if bits >> b & 1]
        alive = grown
        counts.append(len(alive))
    return alive, counts


def as_set(faces: ArrayLike) -> set[tuple[int, ...]]:
    return {tuple(row) for row in np.asarray(faces).tolist()}


# --- Rays -----------------------------------------------------------------------------------


def first_hit(triangles: Floats, origin: Floats, direction: Floats) -> tuple[float, int]:
    """Depth and index of the first triangle that a ray meets: infinity and -1 for none.

    For each triangle the 3 x 3 system a + u (b - a) + v (c - a) - depth * direction = origin.
    """
    best, hit = np.inf, -1
    for index, (a, b, c) in enumerate(triangles):
        system = np.column_stack([b - a, c - a, -direction])
        if np.linalg.matrix_rank(system) < 3:
            continue
        u, v, depth = np.linalg.solve(system, origin - a)
        if u >= 0 and v >= 0 and u + v <= 1 and 0 <= depth < best:
            best, hit = float(depth), index
    return best, hit
