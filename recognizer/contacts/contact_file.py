"""Contacts from a CSV file, as a touch probe's controller or a spreadsheet writes it."""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .contacts import ANYTHING, APPROACH_ERROR, EDGE, FACE, UNIT_NORMAL_TOLERANCE, VERTEX, Contacts
from .free_space import FreeSpace

Floats = NDArray[np.float64]

POSITION, NORMAL, START, END = (
    ("x", "y", "z"),
    ("nx", "ny", "nz"),
    ("sx", "sy", "sz"),
    ("ex", "ey", "ez"),
)
BOUNDS = ("position_error", "normal_error")
KINDS = {"": ANYTHING, "face": FACE, "edge": EDGE, "vertex": VERTEX}
COLUMNS = (*POSITION, *NORMAL, *BOUNDS, *START, *END, "kind")


@dataclass(frozen=True, eq=False)
class FeltFile:
    """What a file of touches says."""

    contacts: Contacts
    """Where the probe touched, metres."""
    free_space: FreeSpace
    """The ways to there, and those that met nothing."""
    rows: tuple[int, ...]
    """The line of the file that each contact stands on."""
    misses: int
    """How many ways met nothing."""


def read_contacts(
    path: str | os.PathLike[str],
    *,
    position_error: float | None = None,
    normal_error: float | None = None,
    scale: float = 1.0,
) -> FeltFile:
    """Read touches from a CSV file with a header.

    Columns, in any order: ``x,y,z`` where the probe touched; where known ``nx,ny,nz``, the outward
    normal there; ``position_error`` and ``normal_error`` (radians), bounds that stand before those
    given here; ``sx,sy,sz``, where the probe started from, so that the way to the contact was free;
    ``ex,ey,ez``, on a row without a contact, where it ended without touching anything; ``kind``:
    face, edge or vertex. Commas, semicolons (then with decimal commas, too), tabs and blanks part
    them.

    Of a ball tip the start may be its centre's and the contact the point on the surface: the line
    between is inside what the ball swept.

    Args:
        path: the file.
        position_error: bound on positions, metres, for rows that don't say.
        normal_error: bound on normals, radians, likewise.
        scale: metres in the file's unit of length.

    Raises:
        ValueError: the file can't be read as this; the message names file and row.
    """
    table = _table(Path(path))
    reader = _RowReader(Path(path), position_error, normal_error, scale)
    touched, misses = [], []
    for line, row in table:
        (touched if reader.is_contact(line, row) else misses).append((line, row))
    if not touched and not misses:
        raise ValueError(f"{path}: no rows under the header")
    contacts = _contacts(reader, touched)
    paths = [reader.path(line, row) for line, row in (*touched, *misses)]
    known = [one for one in paths if one is not None]
    free = FreeSpace.none()
    if known:
        starts, ends, errors = (np.array(column) for column in zip(*known, strict=True))
        free = FreeSpace(starts, ends, error=errors)
    return FeltFile(contacts, free, tuple(line for line, _ in touched), len(misses))


def _contacts(reader: _RowReader, touched: Sequence[tuple[int, dict[str, str]]]) -> Contacts:
    if not touched:
        return Contacts.none()
    positions = np.array([reader.vector(line, row, POSITION) for line, row in touched])
    normals = np.array([reader.normal(line, row) for line, row in touched])
    known = np.asarray(np.isfinite(normals).all(axis=1), bool)
    position_bounds = [reader.position_bound(line, row) for line, row in touched]
    normal_bounds = [
        reader.normal_bound(line, row) if there else np.pi
        for (line, row), there in zip(touched, known.tolist(), strict=True)
    ]
    return Contacts(
        positions * reader.scale,
        normals if known.any() else None,
        position_error=position_bounds,
        normal_error=normal_bounds if known.any() else None,
        approaches=[reader.approach(line, row) for line, row in touched],
        kinds=[reader.kind(line, row) for line, row in touched],
    )


@dataclass(frozen=True)
class _RowReader:
    """Reads values of one file's rows, and names file and row where it can't."""

    source: Path
    position_error: float | None
    normal_error: float | None
    scale: float

    def fail(self, line: int, what: str) -> ValueError:
        return ValueError(f"{self.source}, line {line}: {what}")

    def number(self, line: int, row: dict[str, str], name: str) -> float:
        text = row.get(name, "")
        try:
            value = float(text)
        except ValueError:
            raise self.fail(line, f"{name} is {text!r}, which is no number") from None
        if not np.isfinite(value):
            raise self.fail(line, f"{name} is {text!r}; it must be finite")
        return value

    def has(self, line: int, row: dict[str, str], names: Sequence[str]) -> bool:
        """Whether a row gives a vector, whole."""
        given = [name for name in names if row.get(name, "")]
        if given and len(given) < len(names):
            missing = ", ".join(name for name in names if name not in given)
            raise self.fail(line, f"{', '.join(given)} but no {missing}")
        return bool(given)

    def vector(self, line: int, row: dict[str, str], names: Sequence[str]) -> list[float]:
        return [self.number(line, row, name) for name in names]

    def is_contact(self, line: int, row: dict[str, str]) -> bool:
        """Whether it is a touch; else it has to be a way that met nothing."""
        touched, ended = self.has(line, row, POSITION), self.has(line, row, END)
        if touched and ended:
            raise self.fail(line, "a contact (x,y,z) and an end that met nothing (ex,ey,ez)")
        if not touched and not (ended and self.has(line, row, START)):
            raise self.fail(
                line, "neither a contact (x,y,z) nor a way that met nothing (sx,sy,sz,ex,ey,ez)"
            )
        return touched

    def normal(self, line: int, row: dict[str, str]) -> list[float]:
        if not self.has(line, row, NORMAL):
            return [np.nan] * 3
        normal = self.vector(line, row, NORMAL)
        length = float(np.linalg.norm(normal))
        if abs(length - 1.0) > UNIT_NORMAL_TOLERANCE:
            raise self.fail(line, f"nx,ny,nz has length {length:.4g}; a normal is a unit vector")
        return normal

    def position_bound(self, line: int, row: dict[str, str]) -> float:
        return self._bound(line, row, BOUNDS[0], self.position_error, self.scale)

    def normal_bound(self, line: int, row: dict[str, str]) -> float:
        bound = self._bound(line, row, BOUNDS[1], self.normal_error, 1.0)
        if bound > np.pi:
            raise self.fail(line, f"{BOUNDS[1]} is {bound:g} rad; it can't be above pi")
        return bound

    def _bound(
        self, line: int, row: dict[str, str], name: str, usual: float | None, scale: float
    ) -> float:
        if not row.get(name, ""):
            if usual is None:
                raise self.fail(line, f"no {name}: say how far off the reading may be")
            return usual
        bound = self.number(line, row, name) * scale
        if not bound > 0.0:
            raise self.fail(line, f"{name} is {row[name]}; a bound must be above zero")
        return bound

    def kind(self, line: int, row: dict[str, str]) -> int:
        kind = row.get("kind", "").lower()
        if kind not in KINDS:
            known = ", ".join(name for name in KINDS if name)
            raise self.fail(line, f"kind is {kind!r}; it must be one of {known}, or empty")
        return KINDS[kind]

    def approach(self, line: int, row: dict[str, str]) -> list[float]:
        """The direction in which the probe came; zeros where it isn't known well enough."""
        way = self.path(line, row)
        if way is None:
            return [0.0] * 3
        along = np.subtract(way[1], way[0])
        length = float(np.linalg.norm(along))
        # An end that is off turns the direction by its share of the way.
        known = length > 0.0 and way[2] < APPROACH_ERROR * length
        return (along / length).tolist() if known else [0.0] * 3

    def path(self, line: int, row: dict[str, str]) -> tuple[list[float], list[float], float] | None:
        """Start, end and bound of the way that a row tells of, metres; None if it doesn't."""
        if not self.has(line, row, START):
            return None
        end = POSITION if row.get("x", "") else END
        start_m = [self.scale * value for value in self.vector(line, row, START)]
        end_m = [self.scale * value for value in self.vector(line, row, end)]
        return start_m, end_m, self.position_bound(line, row)


def _table(path: Path) -> list[tuple[int, dict[str, str]]]:
    """The file's rows under its header, each with its line number; blank rows left out."""
    try:
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise ValueError(f"{path}: {error.strerror}") from None
    except UnicodeDecodeError:
        raise ValueError(f"{path}: not a text file in UTF-8") from None
    if not text.strip():
        raise ValueError(f"{path}: the file is empty; its first line must name the columns")
    header = next(line for line in text.splitlines() if line.strip())
    parting = max((";", "\t", ","), key=header.count)
    if parting not in header:
        parting = " "
    lines = csv.reader(io.StringIO(text), delimiter=parting, skipinitialspace=parting == " ")
    names: list[str] = []
    rows = []
    for cells in lines:
        cells = [cell.strip() for cell in cells]
        if not any(cells):
            continue
        if not names:
            names = [cell.lower() for cell in cells]
            _check_header(path, names)
            continue
        if len(cells) > len(names) and any(cells[len(names) :]):
            hint = "; decimal commas need semicolons between columns" if parting == "," else ""
            raise ValueError(
                f"{path}, line {lines.line_num}: {len(cells)} values under {len(names)}"
                f" columns{hint}"
            )
        if parting != ",":
            cells = [cell.replace(",", ".") for cell in cells]
        rows.append((lines.line_num, dict(zip(names, cells, strict=False))))
    return rows


def _check_header(path: Path, names: list[str]) -> None:
    doubled = sorted({name for name in names if name and names.count(name) > 1})
    if doubled:
        raise ValueError(f"{path}: the column {doubled[0]} is there twice")
    if all(_is_number(name) for name in names):
        raise ValueError(f"{path}: the first line must name the columns, as in: x,y,z,nx,ny,nz")
    for group in (POSITION, NORMAL, START, END):
        given = [name for name in group if name in names]
        if given and len(given) < len(group):
            missing = ", ".join(name for name in group if name not in given)
            raise ValueError(f"{path}: there is a column {given[0]} but none for {missing}")
    if not {"x", "ex"} & set(names):
        raise ValueError(f"{path}: no columns x, y, z; there are: {', '.join(names)}")
    unknown = [name for name in names if name and name not in COLUMNS]
    if unknown:
        raise ValueError(
            f"{path}: what is the column {unknown[0]!r}? Known ones are: {', '.join(COLUMNS)}"
        )


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
