"""Rows of a benchmark on disk: a file each as they come, gathered in one as they get many.

At whatever moment the process is killed, a row is there as a whole or not at all. A row that is
there is never written again; while rows are gathered one may be in two files for a moment, alike in
both.
"""

from __future__ import annotations

import types
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any, Union, get_args, get_origin, get_type_hints

from ..whole_file import write_whole
from .row import EpisodeRow

MOST_PARTS = 256
"""Rows in files of their own at which they are gathered."""


class RowStore:
    """The rows in a folder."""

    def __init__(self, folder: Path) -> None:
        """Take a folder; it is made where it isn't there.

        Raises:
            ValueError: pyarrow is missing.
        """
        _pyarrow()
        self.table_path = folder / "episodes.parquet"
        self._parts = folder / "parts"
        self._count = len(self._part_paths())

    def add(self, row: EpisodeRow) -> None:
        """Keep a row: once this returns, it is there for good."""
        self._parts.mkdir(parents=True, exist_ok=True)
        _write([row], self._parts / f"{row.number:08d}.parquet")
        self._count += 1
        if self._count >= MOST_PARTS:
            self.gather()

    def rows(self) -> list[EpisodeRow]:
        """All rows, in the benchmark's order; another process may be adding to them.

        Raises:
            ValueError: a file that isn't a table of episodes.
        """
        while True:
            try:
                return self._all_rows()
            except FileNotFoundError:  # gathered by the writer meanwhile
                continue

    def _all_rows(self) -> list[EpisodeRow]:
        parts = self._part_paths()  # before the table: what leaves them is in the table by then
        table = [self.table_path] if self.table_path.exists() else []
        found: dict[int, EpisodeRow] = {}
        for path in table + parts:
            for row in _read(path):
                found.setdefault(row.number, row)
        return [found[number] for number in sorted(found)]

    def gather(self) -> None:
        """Bring all rows into one file, in order."""
        parts = self._part_paths()
        if parts:
            _write(self.rows(), self.table_path)
        for path in parts:
            path.unlink()
        if self._parts.is_dir() and not any(self._parts.iterdir()):
            self._parts.rmdir()
        self._count = 0

    def clear_leftovers(self) -> None:
        """Remove what a killed process left half written."""
        for path in (self.table_path.parent, self._parts):
            for half in path.glob(".*.half"):
                half.unlink()

    def _part_paths(self) -> list[Path]:
        return sorted(self._parts.glob("*.parquet"))


@contextmanager
def only_writer(folder: Path) -> Iterator[None]:
    """Hold a folder for this process alone; a process that dies lets go of it.

    Raises:
        ValueError: another process holds it.
    """
    import fcntl

    folder.mkdir(parents=True, exist_ok=True)
    with (folder / ".lock").open("w") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as held:
            raise ValueError(f"{folder}: another benchmark is writing here") from held
        yield


def _write(rows: Iterable[EpisodeRow], path: Path) -> None:
    pyarrow, parquet = _pyarrow()
    table = pyarrow.Table.from_pylist([asdict(row) for row in rows], schema=_schema())
    sink = pyarrow.BufferOutputStream()
    parquet.write_table(table, sink, compression="zstd")
    write_whole(path, sink.getvalue().to_pybytes())


def _read(path: Path) -> list[EpisodeRow]:
    pyarrow, parquet = _pyarrow()
    listed: list[dict[str, Any]]
    try:
        listed = parquet.read_table(path, schema=_schema()).to_pylist()
    except (pyarrow.ArrowInvalid, KeyError) as wrong:
        raise ValueError(f"{path}: not a whole table of episodes ({wrong})") from wrong
    return [EpisodeRow(**{name: _as_field(value) for name, value in one.items()}) for one in listed]


def _as_field(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value


def _schema() -> Any:
    """The columns of a row, by the types of its fields."""
    pyarrow, _ = _pyarrow()
    plain = {
        int: pyarrow.int64(),
        float: pyarrow.float64(),
        str: pyarrow.string(),
        bool: pyarrow.bool_(),
    }
    hints = get_type_hints(EpisodeRow)
    columns = []
    for field in fields(EpisodeRow):
        hint, nullable = hints[field.name], False
        if get_origin(hint) in (types.UnionType, Union):
            hint, nullable = get_args(hint)[0], True
        many = get_origin(hint) is tuple
        kind = pyarrow.list_(plain[get_args(hint)[0]]) if many else plain[hint]
        columns.append(pyarrow.field(field.name, kind, nullable=nullable))
    return pyarrow.schema(columns)


def _pyarrow() -> tuple[Any, Any]:
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError as missing:
        raise ValueError(
            "a benchmark's rows need pyarrow, which isn't installed:"
            " pip install 'palpate[benchmark]'"
        ) from missing
    return pyarrow, pyarrow.parquet
