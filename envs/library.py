"""Which objects an environment draws from: the stand-ins, or a folder of the user's meshes."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from ..assets import STAND_IN_NAMES, mesh_path
from ..recognizer import Polyhedron, load_folder

LibrarySource = Sequence[str] | Sequence[Polyhedron] | str | os.PathLike[str] | None
"""Names of stand-ins, ready models, the folder of the user's meshes, or None for all stand-ins."""


def load_library(source: LibrarySource = None) -> tuple[Polyhedron, ...]:
    """Load the models that a source names.

    Args:
        source: see `LibrarySource`.

    Raises:
        ValueError: an unknown name, an empty library, or a folder that can't be read as one.
    """
    if source is None:
        source = STAND_IN_NAMES
    if isinstance(source, str | os.PathLike):
        return load_folder(Path(source))
    if not source:
        raise ValueError("the library is empty; name at least one object")
    return tuple(
        item if isinstance(item, Polyhedron) else Polyhedron.from_mesh(mesh_path(item), name=item)
        for item in source
    )


def checked_name(name: str | None, library: Sequence[Polyhedron]) -> str | None:
    """The same name.

    Raises:
        ValueError: no model of the library has it.
    """
    known = [model.name for model in library]
    if name is not None and name not in known:
        raise ValueError(f"no object is called {name!r}; the library has: {', '.join(known)}")
    return name
