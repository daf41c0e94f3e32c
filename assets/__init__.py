"""The object library: stand-ins for the test objects of Grimson and Lozano-Perez.

W. E. L. Grimson and T. Lozano-Perez, "Model-Based Recognition and Localization from Sparse Range
or Tactile Data", AI Memo 738, MIT, 1983, section 4.2 and Figure 7. The memo's own geometry is
lost; SOURCES.md says what is known of each object and what was chosen here.

Lengths are metres. An object's frame has its origin at the centre of its bounding box.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

__all__ = ["STAND_IN_NAMES", "ConvexPart", "load_parts", "mesh_path", "parts_path"]

STAND_IN_NAMES: tuple[str, ...] = (
    "housing",
    "housing-34",
    "stapler",
    "simple-hand",
    "complex-hand",
)
"""Names of the objects, in the library's order."""


@dataclass(frozen=True, eq=False)
class ConvexPart:
    """One convex part of an object.

    Attributes:
        vertices: ``(n, 3)`` float64, metres, object frame.
        triangles: ``(m, 3)`` int64 indices, counter-clockwise seen from outside.
    """

    vertices: NDArray[np.float64]
    triangles: NDArray[np.int64]


def mesh_path(name: str) -> Path:
    """Path of an object's closed mesh (OBJ, metres).

    Raises:
        ValueError: unknown name; the message lists the valid ones.
    """
    return _object_file(name, ".obj")


def parts_path(name: str) -> Path:
    """Path of the object's convex parts (OBJ, metres, one OBJ object a part).

    Raises:
        ValueError: unknown name; the message lists the valid ones.
    """
    return _object_file(name, ".parts.obj")


def load_parts(name: str) -> tuple[ConvexPart, ...]:
    """The convex parts whose union is the object: its exact collision geometry.

    Raises:
        ValueError: unknown name; the message lists the valid ones.
    """
    from .obj_file import read_obj  # here, so that listing names does not import numpy

    meshes = read_obj(parts_path(name))
    return tuple(ConvexPart(mesh.vertices, mesh.triangles) for mesh in meshes)


def _object_file(name: str, ending: str) -> Path:
    if name not in STAND_IN_NAMES:
        valid = ", ".join(STAND_IN_NAMES)
        raise ValueError(f"no object is called {name!r}; the library has {valid}")
    return Path(str(resources.files("palpate.assets") / "objects" / f"{name}{ending}"))
