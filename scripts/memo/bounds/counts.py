"""How many interpretations distances leave at each level of the tree, counted (memo, Section 6)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from ....assets import STAND_IN_NAMES
from ....assets.planar import PLANAR_NAMES
from ....envs.library import load_library
from ....envs.planar.library import load_outlines
from ....envs.probe_env import INCH
from ....envs.sensors.grid import sense_grid
from ....recognizer import Contacts, PairTables, Polygon, Polyhedron
from ....recognizer.tables.planar_ranges import PlanarTables
from ....recognizer.tree.tree import prune
from ..noise import noise_of
from ..plan import Trials
from . import formulas as bounds

Floats = NDArray[np.float64]
Fits = NDArray[np.bool_]

LEVELS = 4
"""Contacts of a trial; an object of 64 faces has 17 million interpretations of four."""
MOST_FACES = 100
"""The trees of objects of more are counted to level 3 alone: the work grows with n^4."""
DIAMETER = 4.0
"""Of the solids and outlines made here, inches: the housing's."""
NOISE = noise_of(10, 0.01)

SOLIDS = ("cube", "icosahedron", "sphere")
OUTLINES = ("12-gon", "50-gon")
SHAPES = (*SOLIDS, *STAND_IN_NAMES, *OUTLINES, *PLANAR_NAMES)
"""Solids of equal faces, or nearly so: the largest triangle of the sphere's 320 is by a quarter
larger than the smallest; stand-ins; outlines of equal edges; planar stand-ins."""

COUNTERS = ("chain of middles", "chain of ranges", "all distances", "all constraints")
"""Faces within the sensitivity of the contact before, by the distance of their middles: what the
proof counts. Faces whose distance range holds that to the contact before. The same for all contacts
before: the tree, pruned by distance alone. The tree as it is, angles and components too."""


@dataclass(frozen=True, eq=False)
class Shape:
    """An object and what the propositions want to know of it."""

    model: Polyhedron | Polygon
    tables: PairTables | PlanarTables
    between: Floats
    """(f, f) distances of the middles of its faces or edges, metres."""
    sensitivity: float
    """See `bounds.distance_sensitivity`, metres; errors of both contacts are in it."""

    @property
    def equal(self) -> bool:
        """Whether its faces or edges are alike, as the corollaries want."""
        return self.model.name in (*SOLIDS, *OUTLINES)

    @property
    def described(self) -> str:
        """How many faces or edges there are, and whether they are alike."""
        what = "edges" if isinstance(self.model, Polygon) else "faces"
        return f"{self.model.face_count} {'equal ' if self.equal else ''}{what}"

    def formulas(self) -> dict[str, Floats]:
        """(LEVELS,) what each formula has for each level.

        "as printed" and "mended" are the corollary of Proposition 3 for solids; for outlines that
        of Proposition 2, where there is nothing to mend.
        """
        n, d, levels = self.model.face_count, self.model.diameter, range(1, LEVELS + 1)
        first = [bounds.expected_nodes(k, n, self.sensitivity, d) for k in levels]
        found = {"n^k": [float(n) ** k for k in levels], "Proposition 1": first}
        if isinstance(self.model, Polygon):
            p = self.model.perimeter
            found["corollary"] = [bounds.expected_nodes_of_outline(k, n, p, d) for k in levels]
        else:
            size = n, float(self.model.areas.sum()), d
            found["corollary"] = [
                bounds.expected_nodes_of_equal_faces_as_printed(k, *size) for k in levels
            ]
            found["mended"] = [bounds.expected_nodes_of_equal_faces(k, *size) for k in levels]
        return {name: np.array(values) for name, values in found.items()}


@dataclass(frozen=True, eq=False)
class Counts:
    """What was counted in some trials."""

    nodes: Floats
    """(t, 4, LEVELS) interpretations of the first contacts, for each of `COUNTERS`; NaN where they
    were not counted."""
    lost: int
    """Trials in which some counter dropped the right interpretation."""


def count_nodes(piece: Trials[str]) -> Counts:
    """Touch an object, contacts in random order, and count what fits."""
    shape = make_shape(piece.row)
    nodes, lost = np.empty((piece.count, len(COUNTERS), LEVELS)), 0
    for row, number in enumerate(piece.numbers):
        rng = np.random.default_rng([piece.seed, SHAPES.index(piece.row), number])
        contacts, faces = _touch(shape.model, rng)
        nodes[row], kept = _count(shape, contacts, faces)
        lost += not kept
    return Counts(nodes, lost)


@cache
def make_shape(name: str) -> Shape:
    """An object of `SHAPES`."""
    model = _model(name)
    if isinstance(model, Polygon):
        tables, middles = PlanarTables.of(model), model.segments.mean(axis=1)
    else:
        tables, middles = PairTables.of(model), bounds.face_middles(model)
    between = np.linalg.norm(middles[:, None] - middles, axis=2)
    error = NOISE.position_error
    sensitivity = bounds.distance_sensitivity(tables, middles, position_error=error)
    return Shape(model, tables, between, sensitivity)


def _model(name: str) -> Polyhedron | Polygon:
    if name in STAND_IN_NAMES:
        return load_library([name])[0]
    if name in PLANAR_NAMES:
        return load_outlines([name])[0]
    if name in OUTLINES:
        around = 2.0 * np.pi * np.arange(int(name.split("-")[0])) / int(name.split("-")[0])
        # Both numbers of edges are even, so the diameter is that of the circle.
        corners = DIAMETER * INCH / 2.0 * np.column_stack([np.cos(around), np.sin(around)])
        return Polygon.from_corners(corners, name=name)
    from trimesh import creation

    size = DIAMETER * INCH
    if name == "cube":
        return Polyhedron.from_mesh(creation.box([size / np.sqrt(3.0)] * 3), name=name)
    unit = creation.icosahedron() if name == "icosahedron" else creation.icosphere(2)
    scale = size / Polyhedron.from_mesh(unit, name=name).diameter
    return Polyhedron.from_mesh(unit, name=name, scale=scale)


def _touch(
    model: Polyhedron | Polygon, rng: np.random.Generator
) -> tuple[Contacts, NDArray[np.int32]]:
    """`LEVELS` contacts in random order, and the faces under them."""
    if isinstance(model, Polygon):
        return _touch_outline(model, rng)
    truth = sense_grid(model, rng)
    chosen = rng.permutation(len(truth))[:LEVELS]
    return truth.noisy(NOISE, rng)[chosen], truth.faces[chosen]


def _touch_outline(model: Polygon, rng: np.random.Generator) -> tuple[Contacts, NDArray[np.int32]]:
    """Contacts anywhere on an outline, uniform along it."""
    edges = rng.choice(model.face_count, LEVELS, p=model.lengths / model.perimeter)
    ends = model.segments[edges]
    points = ends[:, 0] + rng.random((LEVELS, 1)) * (ends[:, 1] - ends[:, 0])
    around = rng.uniform(0.0, 2.0 * np.pi, LEVELS)
    off = NOISE.position_error * np.sqrt(rng.random(LEVELS))
    points += off[:, None] * np.column_stack([np.cos(around), np.sin(around)])
    leans = rng.uniform(-NOISE.normal_error, NOISE.normal_error, LEVELS)
    x, y = model.normals[edges].T
    cosine, sine = np.cos(leans), np.sin(leans)
    normals = np.column_stack([cosine * x - sine * y, sine * x + cosine * y])
    contacts = Contacts(
        points, normals, position_error=NOISE.position_error, normal_error=NOISE.normal_error
    )
    return contacts, edges.astype(np.int32)


def _count(shape: Shape, contacts: Contacts, faces: NDArray[np.int32]) -> tuple[Floats, bool]:
    """(4, LEVELS) interpretations by each of `COUNTERS`, and whether the right one was kept."""
    pairs = list(combinations(range(LEVELS), 2))
    points = contacts.positions
    lengths = {(i, j): float(np.linalg.norm(points[i] - points[j])) for i, j in pairs}
    by_range = {pair: _in_range(shape, length) for pair, length in lengths.items()}
    by_middles = {
        (i, i + 1): np.abs(shape.between - lengths[i, i + 1]) <= shape.sensitivity
        for i in range(LEVELS - 1)
    }
    kept = all(fits[faces[i], faces[j]] for (i, j), fits in (by_range | by_middles).items())
    counts = np.empty((len(COUNTERS), LEVELS))
    counts[0], counts[1] = count_chains(by_middles), count_chains(by_range)
    counts[2:] = np.nan
    for level in range(1, LEVELS + (shape.model.face_count <= MOST_FACES)):
        counts[2, level - 1] = count_tuples(by_range, level)
        left = prune(shape.tables, contacts[np.arange(level)], sort=False).faces
        counts[3, level - 1] = len(left)
        kept = kept and bool((left == faces[:level]).all(axis=1).any())
    return counts, kept


def _in_range(shape: Shape, length: float) -> Fits:
    """(f, f) pairs of faces with points as far apart as two contacts may truly be."""
    # Each end is off by its bound at most.
    error = 2.0 * NOISE.position_error
    tables = shape.tables
    return (tables.distance_min <= length + error) & (tables.distance_max >= length - error)


def count_chains(fits: dict[tuple[int, int], Fits]) -> Floats:
    """(LEVELS,) interpretations whose every face goes with the one before it.

    Args:
        fits: (f, f) faces of contact i and of contact i + 1 that go together, for each i.
    """
    chains = np.ones(len(fits[0, 1]))
    counts = [chains.sum()]
    for i in range(LEVELS - 1):
        chains = chains @ fits[i, i + 1]
        counts.append(chains.sum())
    return np.array(counts)


def count_tuples(fits: dict[tuple[int, int], Fits], level: int) -> float:
    """Interpretations of the first contacts whose every two faces go together.

    Args:
        fits: (f, f) faces of contact i and of contact j > i that go together.
        level: contacts, 1 to 4.
    """
    exact = {pair: one.astype(np.float64) for pair, one in fits.items()}
    if level == 1:
        return float(len(exact[0, 1]))
    if level == 2:
        return float(exact[0, 1].sum())
    if level == 3:
        return float(((exact[0, 1] @ exact[1, 2]) * exact[0, 2]).sum())
    total = 0.0
    for face in range(len(exact[0, 1])):
        b, c, d = (np.flatnonzero(fits[0, j][face]) for j in (1, 2, 3))
        through = exact[1, 2][np.ix_(b, c)] @ exact[2, 3][np.ix_(c, d)]
        total += float((through * exact[1, 3][np.ix_(b, d)]).sum())
    return total
