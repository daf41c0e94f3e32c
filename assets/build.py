"""Build the library's OBJ files from the parts in ``stand_ins`` (needs manifold3d).

    python -m palpate.assets.build [--check] [FOLDER]

The files ship with the package; this is how they were made and how to check that they still
follow from the code.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from manifold3d import Error, Manifold, Mesh64, OpType

from . import mesh_path, parts_path
from .obj_file import TriangleMesh, format_obj
from .retriangulate import retriangulate
from .solids import Points
from .stand_ins import STAND_INS, StandIn, parts_m


def part_meshes(stand_in: StandIn) -> list[TriangleMesh]:
    """The convex parts as triangle meshes ``part0``, ``part1``, ..., metres, object frame."""
    return [_as_mesh(f"part{i}", _hull(points)) for i, points in enumerate(parts_m(stand_in))]


def union_mesh(stand_in: StandIn) -> TriangleMesh:
    """The union of the convex parts as one closed mesh, metres, object frame."""
    hulls = [_hull(points) for points in parts_m(stand_in)]
    union = Manifold.batch_boolean(hulls, OpType.Add)
    return _as_mesh(stand_in.name, union)


def rebuild(folder: Path) -> list[Path]:
    """Write ``NAME.obj`` and ``NAME.parts.obj`` of every stand-in into an existing folder.

    Each file is written under a temporary name and then renamed. Returns the paths written.
    """
    written = []
    for stand_in in STAND_INS:
        heading = f"palpate stand-in: {stand_in.name}, metres"
        union = format_obj([union_mesh(stand_in)], heading)
        parts = format_obj(part_meshes(stand_in), f"{heading}, convex parts")
        for text, name in (
            (union, mesh_path(stand_in.name).name),
            (parts, parts_path(stand_in.name).name),
        ):
            written.append(_write(folder / name, text))
    return written


def _hull(points: Points) -> Manifold:
    return Manifold.hull_points(np.ascontiguousarray(points))


def _as_mesh(name: str, solid: Manifold) -> TriangleMesh:
    if solid.status() != Error.NoError or solid.is_empty():
        raise ValueError(f"{name}: the solid is not a manifold ({solid.status()})")
    mesh: Mesh64 = solid.to_mesh64()
    vertices = np.asarray(mesh.vert_properties, dtype=np.float64)[:, :3]
    triangles = np.asarray(mesh.tri_verts).astype(np.int64)
    return retriangulate(TriangleMesh(name, vertices, triangles))


def _write(path: Path, text: str) -> Path:
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    temporary.write_bytes(text.encode("ascii"))
    temporary.replace(path)
    return path


def _stale() -> list[str]:
    """Names of the shipped files that differ from what the code gives."""
    shipped = mesh_path(STAND_INS[0].name).parent
    with tempfile.TemporaryDirectory() as folder:
        fresh = rebuild(Path(folder))
        return [
            path.name
            for path in fresh
            if not (shipped / path.name).exists()
            or path.read_bytes() != (shipped / path.name).read_bytes()
        ]


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line: write the files, or with ``--check`` compare them. Returns the exit status."""
    parser = argparse.ArgumentParser(prog="python -m palpate.assets.build")
    parser.add_argument("--check", action="store_true", help="compare with the shipped files")
    parser.add_argument("folder", nargs="?", type=Path, help="where to write (default: shipped)")
    options = parser.parse_args(arguments)
    if options.check:
        stale = _stale()
        if stale:
            print(f"differ from the shipped files: {', '.join(stale)}", file=sys.stderr)
        return 1 if stale else 0
    folder = options.folder or mesh_path(STAND_INS[0].name).parent
    if not folder.is_dir():
        parser.error(f"{folder} is not a folder")
    for path in rebuild(folder):
        print(path)
    return 0


if __name__ == "__main__":
    sys.exit(main())
