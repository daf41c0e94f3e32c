"""Contacts: what the probe felt, and how far each reading can be off."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

UNIT_NORMAL_TOLERANCE = 1e-3
"""How far from 1 the length of a given normal may be; text files round to four digits or so."""


@dataclass(frozen=True, init=False, eq=False)
class Contacts:
    """Points felt on the surface of one object, with outward normals and hard bounds on both.

    A bound is a promise: the true point of contact lies within ``position_error`` of the reading
    and the true outward normal within ``normal_error`` of it (memo, Section 1.1). Everything that
    palpate rules out rests on these promises.
    """

    positions: NDArray[np.float64]
    """(n, 3) points in the world frame, metres."""
    normals: NDArray[np.float64]
    """(n, 3) unit outward normals in the world frame."""
    position_error: NDArray[np.float64]
    """(n,) radius of the ball around each position, metres."""
    normal_error: NDArray[np.float64]
    """(n,) half-angle of the cone around each normal, radians, at most pi (normal unknown)."""

    def __init__(
        self,
        positions: ArrayLike,
        normals: ArrayLike,
        *,
        position_error: ArrayLike,
        normal_error: ArrayLike,
    ) -> None:
        """Check and hold contacts; every array is copied and made read-only.

        Args:
            positions: (n, 3) points in the world frame, metres.
            normals: (n, 3) outward unit normals in the world frame.
            position_error: bound on each position, metres; one number or (n,).
            normal_error: bound on each normal, radians; one number or (n,).

        Raises:
            ValueError: a shape that does not fit, a value that is not finite, a normal that is
                not of unit length, a bound that is not positive, a normal bound above pi.
        """
        points = _rows_of_three("positions", positions)
        directions = _rows_of_three("normals", normals)
        if len(points) != len(directions):
            raise ValueError(
                f"{len(points)} positions but {len(directions)} normals: give one normal a position"
            )
        lengths = np.linalg.norm(directions, axis=1)
        off = np.flatnonzero(np.abs(lengths - 1.0) > UNIT_NORMAL_TOLERANCE)
        if off.size:
            row = int(off[0])
            raise ValueError(
                f"normals: row {row} has length {lengths[row]:.6g}; normals must be unit vectors"
            )
        directions = directions / lengths[:, None] if len(lengths) else directions
        values = {
            "positions": points,
            "normals": directions,
            "position_error": _bounds("position_error", position_error, len(points), np.inf),
            "normal_error": _bounds("normal_error", normal_error, len(points), np.pi),
        }
        for name, value in values.items():
            value.setflags(write=False)
            object.__setattr__(self, name, value)

    def __len__(self) -> int:
        return len(self.positions)

    def __getitem__(self, rows: ArrayLike | slice) -> Contacts:
        """The contacts of the given rows (a slice, indices or a mask), in that order."""
        # An empty list is no list of numbers yet, and numpy would make it one of floats.
        index = (
            rows if isinstance(rows, slice) else np.asarray(rows, None if np.size(rows) else int)
        )
        return Contacts(
            self.positions[index],
            self.normals[index],
            position_error=self.position_error[index],
            normal_error=self.normal_error[index],
        )

    @classmethod
    def none(cls) -> Contacts:
        """No contacts at all."""
        nothing = np.zeros((0, 3))
        return cls(nothing, nothing, position_error=np.zeros(0), normal_error=np.zeros(0))

    @classmethod
    def join(cls, parts: Sequence[Contacts]) -> Contacts:
        """All contacts of ``parts``, in order."""
        parts = [cls.none(), *parts]
        return cls(
            np.concatenate([part.positions for part in parts]),
            np.concatenate([part.normals for part in parts]),
            position_error=np.concatenate([part.position_error for part in parts]),
            normal_error=np.concatenate([part.normal_error for part in parts]),
        )


def _rows_of_three(name: str, values: ArrayLike) -> NDArray[np.float64]:
    rows = np.array(values, dtype=np.float64, order="C")
    if rows.ndim != 2 or rows.shape[1] != 3:
        raise ValueError(f"{name} must have shape (n, 3), not {rows.shape}")
    bad = np.flatnonzero(~np.isfinite(rows).all(axis=1))
    if bad.size:
        raise ValueError(f"{name}: row {bad[0]} is {rows[bad[0]].tolist()}; it must be finite")
    return rows


def _bounds(name: str, values: ArrayLike, count: int, largest: float) -> NDArray[np.float64]:
    bounds = np.array(values, dtype=np.float64)
    if bounds.ndim == 0:
        bounds = np.full(count, bounds) if count else np.zeros(0)
        _check_bounds(name, np.array(values, dtype=np.float64)[None], largest)
    if bounds.shape != (count,):
        raise ValueError(f"{name} must be one number or have shape ({count},), not {bounds.shape}")
    _check_bounds(name, bounds, largest)
    return np.ascontiguousarray(bounds)


def _check_bounds(name: str, bounds: NDArray[np.float64], largest: float) -> None:
    bad = np.flatnonzero(~(np.isfinite(bounds) & (bounds > 0.0) & (bounds <= largest)))
    if bad.size:
        limit = " and at most pi" if np.isfinite(largest) else ""
        raise ValueError(
            f"{name}: row {bad[0]} is {bounds[bad[0]]:g}; a bound must be above zero{limit}"
        )
