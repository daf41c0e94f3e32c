"""Libraries of random solids, to see how the recogniser scales.

`python -m palpate.scripts.lab.random_library FOLDER COUNT --seed SEED` writes one as STL files.

Four families: hulls of few random points, boxes with corners and edges cut off, prisms and frusta,
and blocks of grid cells (L, U, stairs), which aren't convex. Every fifth solid is a near twin of an
earlier one: the same shape, some percent longer in one direction and a little sheared.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
import trimesh
import typer
from numpy.typing import NDArray
from scipy.spatial import QhullError
from scipy.spatial.distance import pdist

from ...recognizer import Polyhedron
from .random_solids import FAMILIES, bumpy_hull, studded_block

FEWEST_FACES, MOST_FACES = 6, 40
SMALLEST, LARGEST = 0.05, 0.25
"""Diameters, metres: what a hand holds."""
SHORTEST_EDGE = 0.004
"""A share of the diameter. A solid with a shorter edge is drawn again: no touch resolves it."""
TWIN_EVERY = 5
TWIN_CHANGE = (0.01, 0.05)
"""By how much, from and to, a twin is longer in one direction."""
MOST_DRAWS = 1000

Floats = NDArray[np.float64]


def random_library(count: int, rng: np.random.Generator) -> tuple[Polyhedron, ...]:
    """Random solids of 6 to 40 faces, near twins among them.

    Args:
        count: how many; a shorter library is the beginning of a longer one.
        rng: source of randomness.

    Returns:
        Models called ``solid-0000`` and so on, metres; coordinates are single precision, so that
        STL files hold the very same solids.
    """
    return tuple(draw_solids(count, rng))


def draw_solids(count: int, rng: np.random.Generator) -> Iterator[Polyhedron]:
    """The solids of `random_library`, one by one."""
    models: list[Polyhedron] = []
    for index, own in enumerate(rng.spawn(count)):
        originals = models if index % TWIN_EVERY == TWIN_EVERY - 1 else []
        models.append(_draw(f"solid-{index:04}", originals, own))
        yield models[-1]


def large_solids(rng: np.random.Generator) -> tuple[Polyhedron, Polyhedron]:
    """A convex and a non-convex model of about 500 faces, neither with any symmetry."""
    made = {"bumpy-hull": bumpy_hull(rng), "studded-block": studded_block(rng)}
    hull, block = (
        _model(name, _single_precision(vertices), triangles)
        for name, (vertices, triangles) in made.items()
    )
    return hull, block


def _draw(name: str, originals: Sequence[Polyhedron], rng: np.random.Generator) -> Polyhedron:
    """Draw until a solid is closed, of a fit number of faces, and without tiny edges."""
    for _ in range(MOST_DRAWS):
        try:
            if originals:
                original = originals[int(rng.integers(len(originals)))]
                vertices, triangles = near_twin(original, rng), original.triangles
            else:
                vertices, triangles = FAMILIES[rng.integers(len(FAMILIES))](rng)
                vertices = _sized(vertices, rng)
            model = _model(name, vertices, triangles)
        except (ValueError, QhullError):
            continue
        sides = np.linalg.norm(model.edges[:, 0] - model.edges[:, 1], axis=1)
        if (
            FEWEST_FACES <= model.face_count <= MOST_FACES
            and sides.min() > SHORTEST_EDGE * model.diameter
        ):
            return model
    raise RuntimeError(f"none of {MOST_DRAWS} draws gave a solid")


def near_twin(original: Polyhedron, rng: np.random.Generator) -> Floats:
    """(v, 3) the vertices of a solid, stretched in a random direction and sheared across it.

    An affine map keeps planes plane, so the faces stay what they are.
    """
    along, across = np.linalg.qr(rng.normal(size=(3, 2)))[0].T
    stretch, shear = rng.uniform(*TWIN_CHANGE, 2) * rng.choice([-1.0, 1.0], 2)
    change = np.eye(3) + np.outer(along, stretch * along + shear * across)
    return _single_precision(original.vertices @ change.T)


def _sized(vertices: Floats, rng: np.random.Generator) -> Floats:
    wanted = rng.uniform(SMALLEST, LARGEST)
    return _single_precision((vertices - vertices.mean(axis=0)) * wanted / pdist(vertices).max())


def _single_precision(vertices: Floats) -> Floats:
    return vertices.astype(np.float32).astype(np.float64)


def _model(name: str, vertices: Floats, triangles: NDArray[np.int64]) -> Polyhedron:
    mesh = trimesh.Trimesh(vertices, triangles, process=False)
    return Polyhedron.from_mesh(mesh, name=name)


def write_library(models: Sequence[Polyhedron], folder: Path) -> None:
    """Write each model as a binary STL file named after it.

    Raises:
        ValueError: there is something in the folder already.
    """
    folder.mkdir(parents=True, exist_ok=True)
    if any(folder.iterdir()):
        raise ValueError(f"{folder}: not empty; a library wants a folder of its own")
    for model in models:
        mesh = trimesh.Trimesh(model.vertices, model.triangles, process=False)
        mesh.export(folder / f"{model.name}.stl")


def main(
    folder: Annotated[Path, typer.Argument(help="A new or empty folder.")],
    count: Annotated[int, typer.Argument(min=1, help="How many solids.")],
    seed: Annotated[int, typer.Option(min=0, help="Seed; the same seed, the same solids.")] = 0,
) -> None:
    """Write a library of random solids of 6 to 40 faces as STL files."""
    try:
        write_library(random_library(count, np.random.default_rng(seed)), folder)
    except ValueError as mistake:
        raise typer.BadParameter(str(mistake)) from mistake


if __name__ == "__main__":
    typer.run(main)
