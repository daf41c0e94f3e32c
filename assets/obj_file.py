"""Wavefront OBJ, the little of it that the library needs: named triangle meshes as text."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

# Coordinates are kept to a picometre: far below any tolerance, and far above the last bits of
# sin and cos, in which platforms differ.
DECIMALS = 12


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """A named triangle mesh.

    Attributes:
        name: what follows ``o`` in the file.
        vertices: ``(n, 3)`` metres.
        triangles: ``(m, 3)`` indices into ``vertices``, counter-clockwise seen from outside.
    """

    name: str
    vertices: NDArray[np.float64]
    triangles: NDArray[np.int64]


def canonical(mesh: TriangleMesh) -> TriangleMesh:
    """The same mesh rounded, with vertices sorted by coordinates and triangles by indices.

    The order that a mesh library happens to give its output in is thereby forgotten.
    """
    # Rounded first: vertices that differ in the last bits must not change places.
    vertices = np.round(mesh.vertices, DECIMALS)
    order = np.lexsort(vertices.T[::-1])
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    triangles = rank[mesh.triangles]
    # Rotating a triangle to start at its least index keeps its winding.
    shift = triangles.argmin(axis=1)[:, None]
    triangles = np.take_along_axis(triangles, (shift + np.arange(3)) % 3, axis=1)
    triangles = triangles[np.lexsort(triangles.T[::-1])]
    return TriangleMesh(mesh.name, vertices[order], triangles.astype(np.int64))


def format_obj(meshes: list[TriangleMesh], heading: str) -> str:
    """OBJ text of one object per mesh, under a one-line comment. Coordinates to a picometre."""
    lines = [f"# {heading}"]
    offset = 1
    for mesh in meshes:
        lines.append(f"o {mesh.name}")
        lines += ["v " + " ".join(map(_coordinate, vertex)) for vertex in mesh.vertices]
        lines += [f"f {a} {b} {c}" for a, b, c in mesh.triangles + offset]
        offset += len(mesh.vertices)
    return "\n".join(lines) + "\n"


def read_obj(path: Path) -> tuple[TriangleMesh, ...]:
    """Read the objects of an OBJ file as written by :func:`format_obj`.

    Raises:
        ValueError: a line that is not a comment, ``o``, ``v`` or ``f`` line of such a file.
    """
    found: list[tuple[str, list[list[float]], list[list[int]]]] = []
    for number, line in enumerate(path.read_text(encoding="ascii").splitlines(), start=1):
        keyword, *fields = line.split() or ["#"]
        if keyword == "o" and len(fields) == 1:
            found.append((fields[0], [], []))
        elif keyword == "v" and len(fields) == 3 and found:
            found[-1][1].append([float(field) for field in fields])
        elif keyword == "f" and len(fields) == 3 and found:
            found[-1][2].append([int(field) for field in fields])
        elif not keyword.startswith("#"):
            raise ValueError(f"{path}, line {number}: expected 'o NAME', 'v X Y Z' or 'f A B C'")
    meshes, offset = [], 1
    for name, vertices, triangles in found:
        meshes.append(TriangleMesh(name, np.array(vertices), np.array(triangles) - offset))
        offset += len(vertices)
    return tuple(meshes)


def _coordinate(value: float) -> str:
    text = f"{value:.{DECIMALS}f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text
