"""Libraries of models read from a folder."""

from __future__ import annotations

import os
from pathlib import Path

from .polyhedron import Polyhedron

MESH_ENDINGS = (".obj", ".off", ".ply", ".stl")
"""File name endings that count as meshes."""


def load_folder(folder: str | os.PathLike[str], *, scale: float = 1.0) -> tuple[Polyhedron, ...]:
    """Read every mesh of a folder, in alphabetical order, each named after its file.

    Args:
        folder: a folder with closed meshes.
        scale: metres in their unit of length.

    Raises:
        ValueError: no such folder, no mesh in it, two meshes of one name, or a mesh that is no
            closed polyhedron.
    """
    files = mesh_files(folder)
    names = [file.stem for file in files]
    for file in files:
        if names.count(file.stem) > 1:
            raise ValueError(f"{file}: another mesh in its folder is called {file.stem!r} too")
    return tuple(Polyhedron.from_mesh(file, scale=scale) for file in files)


def mesh_files(folder: str | os.PathLike[str]) -> list[Path]:
    """The mesh files of a folder, in alphabetical order.

    Raises:
        ValueError: no such folder, or no mesh in it.
    """
    path = Path(folder)
    if not path.is_dir():
        if path.is_file():
            raise ValueError(f"{path} is a file; give the folder that it is in: {path.parent}")
        raise ValueError(f"{path}: no such folder")
    files = sorted(file for file in path.iterdir() if file.suffix.lower() in MESH_ENDINGS)
    if not files:
        raise ValueError(
            f"{path}: no mesh in this folder; expected files {', '.join(MESH_ENDINGS)}"
        )
    return files
