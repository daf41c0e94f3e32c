"""Slow and plain twins of what palpate does in the plane, and the samplers that its tests share.

Nothing here calls the code it checks: witnesses are judged in numpy, masks come from the
constraints spelled out, trees from enumeration, verdicts from grids of poses and from scipy's
linear programs and minimiser.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from oracles.geometry import segment_distances
from scipy.optimize import linprog, minimize

from palpate.assets.planar import PLANAR_NAMES, planar_corners
from palpate.recognizer import Contacts
from palpate.recognizer.models.polygon import Polygon
from palpate.recognizer.poses.entry import OutlineEntry
from palpate.recognizer.tables.planar_ranges import PlanarTables

INCH = 0.0254

Floats = NDArray[np.float64]

# --- Outlines -------------------------------------------------------------------------------

L_SHAPE = [[0, 0], [3, 0], [3, 1], [1.2, 1], [1.2, 2.5], [0, 2.5]]
COMB = [[0, 0], [5, 0], [5, 2], [4, 2], [4, 1], [3, 1], [3, 2], [2, 2], [2, 1], [1, 1], [1, 2]]


def regular(sides: int) -> Floats:
    """A regular polygon of unit circumradius."""
    around = 2.0 * np.pi * np.arange(sides) / sides
    return np.column_stack([np.cos(around), np.sin(around)])


OUTLINES: dict[str, ArrayLike] = {
    "triangle": [[0, 0], [2, 0], [0.3, 1.1]],
    "square": [[0, 0], [1, 0], [1, 1], [0, 1]],
    "l-shape": L_SHAPE,
    "comb": [*COMB, [0, 2]],
    "hexagon": regular(6),
    "70-gon": regular(70),
}
SMALL = ("triangle", "square", "l-shape")
SHAPES = (*PLANAR_NAMES, "square", "l-shape", "hexagon", "comb")
"""What is tried on outlines of all kinds: the stand-ins, symmetric ones and concave ones."""


@cache
def outline(name: str) -> Polygon:
    """A stand-in or one of `OUTLINES`."""
    corners = planar_corners(name) if name in PLANAR_NAMES else OUTLINES[name]
    return Polygon.from_corners(corners, name=name)


@cache
def entry(name: str) -> OutlineEntry:
    return OutlineEntry.of(outline(name))


# --- Samplers -------------------------------------------------------------------------------


def rotation(angle: float) -> Floats:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s], [s, c]])


def turned(vectors: Floats, angles: ArrayLike) -> Floats:
    """Each of (n, 2) vectors turned by its own angle."""
    c, s = np.cos(angles), np.sin(angles)
    return np.column_stack(
        [c * vectors[:, 0] - s * vectors[:, 1], s * vectors[:, 0] + c * vectors[:, 1]]
    )


@dataclass(frozen=True, eq=False)
class Felt:
    """Contacts, and the pose and the edges they really belong to."""

    contacts: Contacts
    edges: NDArray[np.int32]
    angle: float
    shift: Floats


def feel(
    model: Polygon,
    count: int,
    rng: np.random.Generator,
    *,
    position_error: ArrayLike,
    normal_error: ArrayLike,
    at_bounds: bool = False,
    missing: float = 0.0,
    awkward: bool = False,
) -> Felt:
    """Touch an outline at a random pose, with noise inside its bounds or on the very bounds.

    Uniform by length; ``awkward`` mixes in corners, and the same point or edge again. ``missing``
    is the share of normals that are unknown.
    """
    delta = np.broadcast_to(np.asarray(position_error, float), count)
    alpha = np.broadcast_to(np.asarray(normal_error, float), count)
    edges = rng.choice(model.face_count, count, p=model.lengths / model.perimeter)
    shares = rng.random(count)
    if awkward:
        kind = rng.integers(5, size=count)
        shares[kind == 1] = rng.integers(2, size=(kind == 1).sum())
        for row in range(1, count):
            if kind[row] in (2, 3):
                edges[row] = edges[row - 1]
            if kind[row] == 3:
                shares[row] = shares[row - 1]
    ends = model.segments[edges]
    points = ends[:, 0] + shares[:, None] * (ends[:, 1] - ends[:, 0])
    angle, shift = rng.uniform(-np.pi, np.pi), rng.uniform(-2, 2, 2) * model.diameter
    far = np.ones(count) if at_bounds else np.sqrt(rng.random(count))
    around = rng.uniform(0, 2 * np.pi, count)
    noise = (delta * far)[:, None] * np.column_stack([np.cos(around), np.sin(around)])
    lean = alpha * (rng.choice([-1.0, 1.0], count) if at_bounds else rng.uniform(-1, 1, count))
    normals = turned(model.normals[edges] @ rotation(angle).T, lean)
    normals[rng.random(count) < missing] = np.nan
    contacts = Contacts(
        points @ rotation(angle).T + shift + noise,
        normals,
        position_error=delta,
        normal_error=alpha,
    )
    return Felt(contacts, edges.astype(np.int32), angle, shift)


def felt_outline(
    name: str, count: int, seed: int, *, dist: float = 0.01, normal: float = 0.3, **sampler: Any
) -> Felt:
    """Contacts with a shape at a random pose; the bound on position as a share of its size."""
    model, rng = outline(name), np.random.default_rng(seed)
    delta = dist * model.diameter
    return feel(model, count, rng, position_error=delta, normal_error=normal, **sampler)


def unrelated_in_plane(name: str, count: int, seed: int) -> Contacts:
    """Contacts with nothing in particular, some of them degenerate, some without normals."""
    rng, size = np.random.default_rng(seed), outline(name).diameter
    positions = rng.uniform(-0.5, 0.5, (count, 2)) * size
    normals = turned(np.tile([1.0, 0.0], (count, 1)), rng.uniform(-np.pi, np.pi, count))
    for row in range(1, count):
        kind = rng.integers(6)
        if kind == 0:
            positions[row] = positions[row - 1]
        elif kind == 1:  # straight along a normal
            positions[row] = positions[row - 1] + 0.3 * size * normals[row - 1]
        elif kind == 2:
            normals[row] = rng.choice([-1.0, 1.0]) * normals[row - 1]
    normals[rng.random(count) < 0.2] = np.nan
    return Contacts(
        positions,
        normals,
        position_error=size * 10.0 ** rng.uniform(-5, -0.5, count),
        normal_error=rng.choice([1e-3, 0.1, 0.4, 2.0, np.pi], count),
    )


def moved(contacts: Contacts, angle: float, shift: ArrayLike) -> Contacts:
    """The same contacts after a rigid motion of the world."""
    normals = contacts.normals @ rotation(angle).T
    normals[contacts.normal_error >= np.pi] = np.nan
    return Contacts(
        contacts.positions @ rotation(angle).T + np.asarray(shift, float),
        normals,
        position_error=contacts.position_error,
        normal_error=contacts.normal_error,
    )


# --- Poses ----------------------------------------------------------------------------------


def wrapped(angle: ArrayLike) -> Floats:
    """The same angles in [-pi, pi)."""
    return np.mod(np.asarray(angle) + np.pi, 2.0 * np.pi) - np.pi


def excesses(
    model: Polygon, contacts: Contacts, edges: NDArray[np.integer], angle: float, shift: Floats
) -> Floats:
    """(2n,) by how much each reading exceeds its bound at a pose, as a share of the bound."""
    points = (contacts.positions - shift) @ rotation(angle)
    distances = segment_distances(points, model.segments[edges])
    known = contacts.normal_error < np.pi
    normals = contacts.normals[known] @ rotation(angle)
    true = model.normals[edges[known]]
    sines = true[:, 0] * normals[:, 1] - true[:, 1] * normals[:, 0]
    off = np.abs(np.arctan2(sines, (true * normals).sum(axis=1)))
    return np.concatenate(
        [distances / contacts.position_error - 1.0, off / contacts.normal_error[known] - 1.0]
    )


def meets(model, contacts, edges, angle, shift, tolerance: float = 1e-8) -> bool:
    """Whether a pose puts every reading within its bound, but for a share of it."""
    return bool((excesses(model, contacts, edges, angle, shift) <= tolerance).all())


def within_arcs(angle: float, arcs: Floats, tolerance: float = 1e-9) -> bool:
    """Whether an angle is in one of (k, 2) arcs, whole turns aside."""
    middles, halves = arcs.mean(axis=1), np.diff(arcs, axis=1)[:, 0] / 2
    return bool((np.abs(wrapped(angle - middles)) <= halves + tolerance).any())


# --- The tree -------------------------------------------------------------------------------


def pair_margins(
    tables: PlanarTables, contacts: Contacts, i: int, j: int, constraints: tuple[str, ...]
) -> Floats:
    """(e, e) by how much each pair of edges fits two contacts (negative: it doesn't)."""
    p, n = contacts.positions, contacts.normals
    directions = np.arctan2(n[:, 1], n[:, 0])
    delta = contacts.position_error[i] + contacts.position_error[j]
    alpha_i, alpha_j = contacts.normal_error[i], contacts.normal_error[j]
    d = p[j] - p[i]
    length = float(np.linalg.norm(d))
    margins = [np.full_like(tables.angle, np.inf)]
    if "distance" in constraints:
        margins += [length + delta - tables.distance_min, tables.distance_max - length + delta]
    if "angle" in constraints:
        off = np.abs(wrapped(tables.angle - (directions[j] - directions[i])))
        margins += [alpha_i + alpha_j + 1e-9 - off]
    for k, along, alpha, turn in ((i, d, alpha_i, False), (j, -d, alpha_j, True)):
        omega = float(wrapped(np.arctan2(along[1], along[0]) - directions[k]))
        if "component" in constraints:
            # Every component that the cone allows, by brute force.
            lean = np.clip(np.abs(omega) + np.linspace(-alpha, alpha, 20_001), 0.0, np.pi)
            least, most = length * np.cos(lean).min() - delta, length * np.cos(lean).max() + delta
            low, high = tables.component_min, tables.component_max
            low, high = (low.T, high.T) if turn else (low, high)
            margins += [most - low, high - least]
        if "tilt" in constraints:
            swing = float(np.arcsin(delta / length)) if length > delta else np.pi
            low, high = tables.tilt_min, tables.tilt_max
            low, high = (low.T, high.T) if turn else (low, high)
            off = np.abs(wrapped(omega - (low + high) / 2))
            margins += [(high - low) / 2 + alpha + swing - off]
    return np.min(margins, axis=0)


# --- Verdicts -------------------------------------------------------------------------------


def excess_grid(
    model: Polygon, contacts: Contacts, edges: NDArray[np.integer], turns: int = 240
) -> tuple[float, float, list[Floats]]:
    """The least excess (metres; radians times the diameter) over all poses, from a grid of them.

    Poses run over all angles and over every place at which contact 0 is near its edge.

    Returns:
        A bracket of the least excess, and poses (angle, shift) to start a descent from.
    """
    size, delta = model.diameter, contacts.position_error
    angles = 2.0 * np.pi * np.arange(turns) / turns
    a, b = model.segments[edges[0]]
    along = (b - a) / np.linalg.norm(b - a)
    across = np.array([-along[1], along[0]])
    u = np.linspace(-delta[0], np.linalg.norm(b - a) + delta[0], 40)
    v = np.linspace(-delta[0], delta[0], 5)
    spots = a + u[:, None, None] * along + v[None, :, None] * across
    spots = spots.reshape(-1, 2)
    directions = np.arctan2(contacts.normals[:, 1], contacts.normals[:, 0])
    normals = np.arctan2(*model.normals[edges].T[::-1])
    known = contacts.normal_error < np.pi
    lean = np.abs(wrapped(directions[known] - normals[known] - angles[:, None]))
    turning = (lean - contacts.normal_error[known]).max(axis=1, initial=-np.inf) * size
    arms = contacts.positions - contacts.positions[0]
    c, s = np.cos(angles), np.sin(angles)
    inwards = np.stack([np.stack([c, s], 1), np.stack([-s, c], 1)], 1)
    placed = np.einsum("tab,nb->tna", inwards, arms)
    points = spots[None, :, None] + placed[:, None]
    worst = (segment_distances(points, model.segments[edges]) - delta).max(axis=2)
    worst = np.maximum(worst, turning[:, None])
    # From a grid point to any pose in its cell: half a step of either kind.
    step = np.hypot(u[1] - u[0], v[1] - v[0]) / 2
    reach = max(np.linalg.norm(arms, axis=1).max(), size) * np.pi / turns
    starts = []
    for index in np.argsort(worst.min(axis=1))[:2]:
        spot = spots[worst[index].argmin()]
        shift = contacts.positions[0] - rotation(float(angles[index])) @ spot
        starts.append(np.array([angles[index], *shift]))
    return float(worst.min()) - step - reach, float(worst.min()), starts


def descend(model: Polygon, contacts: Contacts, edges: NDArray[np.integer], start: Floats) -> float:
    """The least of the largest excess that scipy's minimiser finds, as a share of the bounds."""
    size = model.diameter

    def readings(pose: Floats) -> Floats:
        return excesses(model, contacts, edges, pose[0], pose[1:3] * size)

    first = np.array([start[0], *(start[1:] / size)])
    found = minimize(
        lambda pose: pose[3],
        np.append(first, readings(first).max()),
        jac=lambda pose: np.array([0.0, 0.0, 0.0, 1.0]),
        constraints={"type": "ineq", "fun": lambda pose: pose[3] - readings(pose)},
        method="SLSQP",
        options={"maxiter": 60, "ftol": 1e-10},
    )
    return float(readings(found.x).max())


def place_bracket(
    model: Polygon, contacts: Contacts, edges: NDArray[np.integer], angle: float, sides: int = 256
) -> tuple[float, float]:
    """A bracket of the least excess (metres) over all shifts at one angle, by linear programs.

    The distance from an edge is at least the height above it in any direction; the program takes
    a fan of directions, and its solution is an upper bound.
    """
    around = 2.0 * np.pi * np.arange(sides) / sides
    d = np.column_stack([np.cos(around), np.sin(around)])
    arms = (contacts.positions - contacts.positions[0]) @ rotation(angle)
    rows, limits = [], []
    for arm, delta, ends in zip(arms, contacts.position_error, model.segments[edges], strict=True):
        rows.append(np.column_stack([d, -np.ones(sides)]))
        limits.append((d @ ends.T).max(axis=1) + delta - d @ arm)
    found = linprog(
        [0.0, 0.0, 1.0],
        A_ub=np.concatenate(rows),
        b_ub=np.concatenate(limits),
        bounds=[(None, None)] * 3,
    )
    assert found.success
    y = found.x[:2]
    upper = (segment_distances(y + arms, model.segments[edges]) - contacts.position_error).max()
    return float(found.fun), float(upper)
