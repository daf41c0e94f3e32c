"""What an object collides with: convex parts, checked against its mesh.

A simulator collides with the convex hull of a mesh. So an object is made of convex parts: those it
was built from if it is a stand-in, itself if it is convex, else an exact decomposition.
"""

from __future__ import annotations

import hashlib
import inspect
import io
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from ...assets import STAND_IN_NAMES, ConvexPart, load_parts
from ...recognizer import Polyhedron
from ...recognizer.tables.file_cache import cache_folder, keep, read_kept
from ...recognizer.tables.table_cache import named_arrays
from . import convex_cells, convex_cuts, convex_joins, hull, parts_check, winding
from .hull import Hull
from .mass import volume
from .parts_check import LEVELS, stray

MOST_STRAY = LEVELS[-1]
"""How far parts may stray from the mesh, as a share of its diameter."""
BUILDERS = (convex_cells, convex_cuts, convex_joins, hull, parts_check, winding)
"""The modules that parts are made and checked by. Their text is part of a file's name."""


@dataclass(frozen=True, eq=False)
class CollisionParts:
    """Convex parts whose union is an object."""

    parts: tuple[ConvexPart, ...]
    """Object frame, metres."""
    stray: float
    """A bound on how far their union strays from the mesh, metres; see `parts_check.stray`."""


def collision_parts(model: Polyhedron, *, folder: Path | None = None) -> CollisionParts:
    """The convex parts of an object, checked against its mesh.

    They are worked out once and kept; safe with other processes at work on the same folder.

    Args:
        model: the object.
        folder: where parts are kept; by default in the user's cache folder.

    Raises:
        ValueError: the parts stray from the mesh by more than `MOST_STRAY`, or there would be too
            many; the message says what to do.
    """
    folder = cache_folder("parts") if folder is None else folder
    path = None if folder is None else folder / f"{parts_key(model)}.parts"
    body = None if path is None else read_kept(path)
    if body is None:
        body = _pack(worked_out_parts(model))
        if path is not None:
            keep(path, body, "collision parts")
    return _unpack(body)


def worked_out_parts(model: Polyhedron) -> CollisionParts:
    """The same as `collision_parts`, worked out anew.

    Raises:
        ValueError: as `collision_parts` does.
    """
    if model.name in STAND_IN_NAMES:
        parts = load_parts(model.name)
        distance = stray(model, parts)
        if distance is not None:
            return CollisionParts(parts, distance)
        # A mesh of the user's own that happens to have a stand-in's name.
    hulls = _convex_whole(model) or convex_cuts.convex_cuts(model)
    parts = tuple(part.part for part in hulls)
    distance = stray(model, parts)
    if distance is None or not _adds_up(model, hulls, distance):
        raise ValueError(
            f"{model.name}: its convex parts stray from the mesh by more than"
            f" {MOST_STRAY * model.diameter:.2g} m, {MOST_STRAY:g} of its diameter, so touches"
            " can't be simulated faithfully; mend a mesh that crosses itself, and write coordinates"
            " in full (an STL file rounds them; OBJ need not)"
        )
    return CollisionParts(parts, distance)


def _convex_whole(model: Polyhedron) -> list[Hull]:
    """The object itself, if it is convex; else nothing."""
    slack = convex_cuts.plane_slack(model)
    if (model.vertices @ model.normals.T - model.offsets).max() > slack:
        return []
    whole = Hull.around(model.vertices, slack)
    return [] if whole is None else [whole]


def _adds_up(model: Polyhedron, hulls: list[Hull], distance: float) -> bool:
    """Whether parts with no volume in common have the object's: then there is no void in it.

    Surfaces that stray by a distance bound no more between them than their area times it.
    """
    area = float(model.areas.sum()) + sum(hull.area for hull in hulls)
    return abs(sum(hull.volume for hull in hulls) - volume(model)) <= 2.0 * distance * area


def parts_key(model: Polyhedron) -> str:
    """A hash, in hexadecimal, of everything that an object's parts depend on."""
    digest = hashlib.blake2b(_builders(), digest_size=20)
    digest.update((model.name if model.name in STAND_IN_NAMES else "").encode())
    for name, array in named_arrays(model):
        # Types and shapes too, so that no two lists of arrays have the same bytes.
        digest.update(f"{name} {array.dtype.str} {array.shape};".encode())
        digest.update(np.ascontiguousarray(array).data)
    return digest.hexdigest()


@cache
def _builders() -> bytes:
    return "".join(inspect.getsource(module) for module in BUILDERS).encode()


def _pack(found: CollisionParts) -> bytes:
    file = io.BytesIO()
    np.savez(
        file,
        stray=np.array(found.stray),
        sizes=np.array([(len(part.vertices), len(part.triangles)) for part in found.parts]),
        vertices=np.concatenate([part.vertices for part in found.parts]),
        triangles=np.concatenate([part.triangles for part in found.parts]),
    )
    return file.getvalue()


def _unpack(body: bytes | memoryview) -> CollisionParts:
    with np.load(io.BytesIO(body), allow_pickle=False) as arrays:
        ends = np.cumsum(arrays["sizes"], axis=0)[:-1]
        corners = np.split(arrays["vertices"], ends[:, 0])
        triangles = np.split(arrays["triangles"], ends[:, 1])
        parts = tuple(ConvexPart(*pair) for pair in zip(corners, triangles, strict=True))
        return CollisionParts(parts, float(arrays["stray"]))
