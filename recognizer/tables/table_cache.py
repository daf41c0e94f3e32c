"""Range tables kept on disk, so that a library is prepared once and not once a process.

A file is named by a hash of all that its tables depend on, so a changed model or a changed way of
building tables never meets an old file. It holds a header and the raw arrays, under a checksum:
whatever isn't whole, be it cut off, damaged or of another kind, is built anew.
"""

from __future__ import annotations

import hashlib
import inspect
import json
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from functools import cache
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..models import features as features_module
from ..models.features import Features
from ..models.polyhedron import Polyhedron
from . import range_kernels, ranges
from .file_cache import cache_folder, keep, read_kept
from .ranges import PairTables

MAGIC = b"palpate tables 2\n"
"""What a file starts with; the number is that of the layout in `_pack`."""
BUILDERS = (features_module, range_kernels, ranges)
"""The modules that tables are built by. Their text is part of a file's name."""
ALIGNMENT = 16
"""Arrays start at multiples of this many bytes, as Python lays out what it reads."""
LENGTH_BYTES = 8

Array = NDArray[Any]


def cached_tables(
    model: Polyhedron, folder: Path | None = None, *, features: Features | None = None
) -> PairTables:
    """The range tables of a model: read if they have been built before, built and kept if not.

    Safe with other processes at work on the same folder. A folder that can't be written is said
    once, as a warning; the tables are then built each time.

    Args:
        model: the object; its name doesn't matter.
        folder: where the files are; by default the user's cache folder.
        features: what the tables are over, as `PairTables.of` takes them; by default the faces.

    Returns:
        Tables whose arrays are read-only, and no part of the model.
    """
    folder = default_folder() if folder is None else folder
    path = None if folder is None else folder / f"{table_key(model, features)}.tables"
    tables = None if path is None else _read(path)
    if tables is not None:
        return tables
    body = _pack(PairTables.of(model, features))
    if path is not None:
        keep(path, body, "range tables")
    return _unpack(body)


def default_folder() -> Path | None:
    """The folder for tables in the platform's cache; None if the user has no such place."""
    return cache_folder("tables")


def table_key(model: Polyhedron, features: Features | None = None) -> str:
    """A hash, in hexadecimal, of everything that a model's tables depend on."""
    digest = hashlib.blake2b(_builders(), digest_size=20)
    given = [] if features is None else named_arrays(features, "features.")
    for name, array in (*named_arrays(model), *given):
        # Types and shapes too, so that no two lists of arrays have the same bytes.
        digest.update(f"{name} {array.dtype.str} {array.shape};".encode())
        digest.update(np.ascontiguousarray(array).data)
    return digest.hexdigest()


@cache
def _builders() -> bytes:
    names = ",".join(field.name for field in fields(PairTables))
    sources = "".join(inspect.getsource(module) for module in BUILDERS)
    return MAGIC + names.encode() + sources.encode()


def named_arrays(value: Any, prefix: str = "") -> Iterator[tuple[str, Array]]:
    """All arrays of a dataclass and of the dataclasses in it, each under its dotted name."""
    for field in fields(value):
        part, name = getattr(value, field.name), prefix + field.name
        if is_dataclass(part):
            yield from named_arrays(part, f"{name}.")
        elif isinstance(part, np.ndarray):
            yield name, part


def _pack(tables: PairTables) -> bytes:
    """Magic, length of the header, header and arrays."""
    layout, blocks, end = [], [], 0
    for field in (field for field in fields(tables) if field.init):
        array = np.ascontiguousarray(getattr(tables, field.name))
        blocks.append(b"\0" * (-end % ALIGNMENT) + array.tobytes())
        layout.append([field.name, array.dtype.str, array.shape, end + -end % ALIGNMENT])
        end += len(blocks[-1])
    header = json.dumps(layout).encode()
    # A file has a checksum before it, which is as long as the arrays' alignment.
    header += b" " * (-(len(MAGIC) + LENGTH_BYTES + len(header)) % ALIGNMENT)
    return b"".join([MAGIC, len(header).to_bytes(LENGTH_BYTES, "little"), header, *blocks])


def _read(path: Path) -> PairTables | None:
    """The tables in a file; None if there is none, or it isn't whole."""
    body = read_kept(path)
    return None if body is None or body[: len(MAGIC)] != MAGIC else _unpack(body)


def _unpack(body: bytes | memoryview) -> PairTables:
    """The tables in what `_pack` made."""
    length_at, header_at = len(MAGIC), len(MAGIC) + LENGTH_BYTES
    arrays_at = header_at + int.from_bytes(body[length_at:header_at], "little")
    layout = json.loads(bytes(body[header_at:arrays_at]))
    # Arrays over bytes, which never change, are read-only.
    arrays: dict[str, Array] = {
        name: np.frombuffer(body, dtype, prod(shape), arrays_at + at).reshape(shape)
        for name, dtype, shape, at in layout
    }
    return PairTables(**arrays)
