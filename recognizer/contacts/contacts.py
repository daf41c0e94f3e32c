"""Contacts: what the probe felt, and how far each reading can be off."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import ArrayLike, NDArray

UNIT_NORMAL_TOLERANCE = 1e-3
"""How far from 1 the length of a given normal may be; text files round to four digits or so."""


class ContactKind(IntEnum):
    """What a contact may be on: nothing is known of it, a face, a convex edge, a convex vertex."""

    ANYTHING = 0
    FACE = 1
    EDGE = 2
    VERTEX = 3


ANYTHING, FACE, EDGE, VERTEX = ContactKind

APPROACH_ERROR = 0.01
"""How far off the direction of an approach may be, radians."""


@dataclass(frozen=True, init=False, eq=False)
class Contacts:
    """Points felt on the surface of one object, with outward normals and hard bounds on both.

    A bound is a promise: the true point of contact lies within ``position_error`` of the reading
    and the true outward normal within ``normal_error`` of it (memo, Section 1.1). Everything that
    palpate rules out rests on these promises. In the plane (three degrees of freedom) points and
    normals have two coordinates.
    """

    positions: NDArray[np.float64]
    """(n, 3) or (n, 2) points in the world frame, metres."""
    normals: NDArray[np.float64]
    """(n, 3) or (n, 2) unit outward normals in the world frame; any where the bound is pi."""
    position_error: NDArray[np.float64]
    """(n,) radius of the ball around each position, metres."""
    normal_error: NDArray[np.float64]
    """(n,) half-angle of the cone around each normal, radians, at most pi (normal unknown)."""
    approaches: NDArray[np.float64]
    """(n, 3) or (n, 2) unit directions in which the probe moved when it touched, world frame,
    within `APPROACH_ERROR`; rows of zeros where that is unknown. The surface faced it."""
    kinds: NDArray[np.int8]
    """(n,) what each is on, a `ContactKind`."""

    def __init__(
        self,
        positions: ArrayLike,
        normals: ArrayLike | None = None,
        *,
        position_error: ArrayLike,
        normal_error: ArrayLike | None = None,
        approaches: ArrayLike | None = None,
        kinds: ArrayLike | None = None,
    ) -> None:
        """Check and hold contacts; every array is copied and made read-only.

        Args:
            positions: (n, 3) points in the world frame, metres; (n, 2) in the plane.
            normals: outward unit normals in the world frame, of the same shape; a row of NaN, or
                none at all, where the normal is unknown.
            position_error: bound on each position, metres; one number or (n,).
            normal_error: bound on each normal, radians; one number or (n,). Needed with normals;
                where a normal is unknown it is pi, whatever is given.
            approaches: unit directions in which the probe moved when it touched; rows of NaN or
                zeros, or none at all, where that is unknown.
            kinds: what was touched, one number or (n,); without it, anything.

        Raises:
            ValueError: a shape that does not fit, a value that is not finite, a normal that is
                not of unit length, a bound that is not positive, a normal bound above pi, normals
                without a bound or a bound without normals, a kind that there isn't.
        """
        points = _rows("positions", positions)
        count, dimension = len(points), int(points.shape[-1])
        cones = _bounds(
            "normal_error", np.pi if normal_error is None else normal_error, count, np.pi
        )
        if normals is None:
            if (cones < np.pi).any():
                raise ValueError("a normal_error below pi, but no normals: give both or neither")
            directions = np.full(points.shape, np.nan)
        else:
            directions = _rows("normals", normals, missing=True)
        if len(directions) != count:
            raise ValueError(
                f"{count} positions but {len(directions)} normals: give one normal a position"
            )
        coordinates = directions.size // max(count, 1)
        if count and coordinates != dimension:
            raise ValueError(f"positions have {dimension} coordinates but normals {coordinates}")
        unknown = np.isnan(directions).all(axis=1)
        if normal_error is None and not unknown.all():
            raise ValueError("normals without normal_error: say how far off they may be, radians")
        directions[unknown] = np.eye(dimension)[0]
        cones[unknown] = np.pi
        lengths = np.linalg.norm(directions, axis=1)
        off = np.flatnonzero(np.abs(lengths - 1.0) > UNIT_NORMAL_TOLERANCE)
        if off.size:
            row = int(off[0])
            raise ValueError(
                f"normals: row {row} has length {lengths[row]:.6g}; normals must be unit vectors"
            )
        self.__dict__.update(
            Contacts.trusted(
                points,
                directions / lengths[:, None],
                position_error=_bounds("position_error", position_error, count, np.inf),
                normal_error=cones,
                approaches=_approaches(approaches, points.shape),
                kinds=_kinds(kinds, count),
            ).__dict__
        )

    @classmethod
    def trusted(
        cls,
        positions: NDArray[np.float64],
        normals: NDArray[np.float64],
        *,
        position_error: NDArray[np.float64],
        normal_error: NDArray[np.float64],
        approaches: NDArray[np.float64],
        kinds: NDArray[np.int8],
    ) -> Contacts:
        """Contacts of arrays that are known to be good: not checked, taken over, made read-only.

        The checks take longer than a touch. All arrays are C-contiguous, of the shapes, types and
        values that a `Contacts` has; the unit vectors are that to rounding.
        """
        contacts = object.__new__(cls)
        values = contacts.__dict__
        values["positions"], values["normals"] = positions, normals
        values["position_error"], values["normal_error"] = position_error, normal_error
        values["approaches"], values["kinds"] = approaches, kinds
        for value in values.values():
            value.setflags(write=False)
        return contacts

    def __len__(self) -> int:
        return len(self.positions)

    @property
    def dimension(self) -> int:
        """3 in space, 2 in the plane."""
        return self.positions.shape[1]

    @property
    def approach_known(self) -> NDArray[np.bool_]:
        """(n,) whether the direction of the approach is known."""
        return (self.approaches != 0.0).sum(axis=1) > 0

    def facing_approach(self) -> Contacts:
        """The same, with what an approach says of a normal where no better is known.

        The surface faces the probe: its normal is within a right angle of where it came from.
        """
        half_space = np.pi / 2.0 + APPROACH_ERROR
        if not self.approaches.any():
            return self
        vague = self.approach_known & (self.normal_error > half_space)
        if not vague.any():
            return self
        return Contacts.trusted(
            self.positions,
            np.where(vague[:, None], -self.approaches, self.normals),
            position_error=self.position_error,
            normal_error=np.where(vague, half_space, self.normal_error),
            approaches=self.approaches,
            kinds=self.kinds,
        )

    def __getitem__(self, rows: ArrayLike | slice) -> Contacts:
        """The contacts of the given rows (a slice, indices or a mask), in that order."""
        # An empty list is no list of numbers yet, and numpy would make it one of floats.
        index = (
            rows if isinstance(rows, slice) else np.asarray(rows, None if np.size(rows) else int)
        )
        return Contacts.trusted(
            np.ascontiguousarray(self.positions[index]),
            np.ascontiguousarray(self.normals[index]),
            position_error=np.ascontiguousarray(self.position_error[index]),
            normal_error=np.ascontiguousarray(self.normal_error[index]),
            approaches=np.ascontiguousarray(self.approaches[index]),
            kinds=np.ascontiguousarray(self.kinds[index]),
        )

    @classmethod
    def none(cls, dimension: int = 3) -> Contacts:
        """No contacts at all."""
        nothing = np.zeros((0, dimension))
        return cls(nothing, nothing, position_error=np.zeros(0), normal_error=np.zeros(0))

    @classmethod
    def join(cls, parts: Sequence[Contacts]) -> Contacts:
        """All contacts of ``parts``, in order.

        Raises:
            ValueError: contacts of the plane among contacts of space.
        """
        dimensions = {part.dimension for part in parts}
        if len(dimensions) > 1:
            raise ValueError("contacts of the plane (n, 2) and of space (n, 3) can't be joined")
        parts = [cls.none(*dimensions), *parts]
        return cls(
            np.concatenate([part.positions for part in parts]),
            np.concatenate([part.normals for part in parts]),
            position_error=np.concatenate([part.position_error for part in parts]),
            normal_error=np.concatenate([part.normal_error for part in parts]),
            approaches=np.concatenate([part.approaches for part in parts]),
            kinds=np.concatenate([part.kinds for part in parts]),
        )


def _rows(name: str, values: ArrayLike, *, missing: bool = False) -> NDArray[np.float64]:
    rows = np.array(values, dtype=np.float64, order="C")
    if rows.ndim != 2 or rows.shape[1] not in (2, 3):
        raise ValueError(f"{name} must have shape (n, 3), or (n, 2) in the plane, not {rows.shape}")
    good = np.isfinite(rows).all(axis=1)
    if missing:
        good |= np.isnan(rows).all(axis=1)
    bad = np.flatnonzero(~good)
    if bad.size:
        raise ValueError(f"{name}: row {bad[0]} is {rows[bad[0]].tolist()}; it must be finite")
    return rows


def _approaches(values: ArrayLike | None, shape: tuple[int, ...]) -> NDArray[np.float64]:
    if values is None:
        return np.zeros(shape)
    directions = _rows("approaches", values, missing=True)
    if directions.shape != shape:
        raise ValueError(
            f"approaches have shape {directions.shape} but positions {shape}: give one a position"
        )
    directions[np.isnan(directions).all(axis=1)] = 0.0
    lengths = np.linalg.norm(directions, axis=1)
    off = np.flatnonzero((lengths > 0.0) & (np.abs(lengths - 1.0) > UNIT_NORMAL_TOLERANCE))
    if off.size:
        row = int(off[0])
        raise ValueError(
            f"approaches: row {row} has length {lengths[row]:.6g}; directions must be unit vectors"
        )
    return directions / np.where(lengths > 0.0, lengths, 1.0)[:, None]


def _kinds(values: ArrayLike | None, count: int) -> NDArray[np.int8]:
    given = np.asarray(ANYTHING if values is None else values)
    if given.ndim == 0:
        given = np.full(count, given)
    if given.shape != (count,):
        raise ValueError(f"kinds must be one number or have shape ({count},), not {given.shape}")
    bad = np.flatnonzero(~np.isin(given, (ANYTHING, FACE, EDGE, VERTEX)))
    if bad.size:
        raise ValueError(
            f"kinds: row {bad[0]} is {given[bad[0]]!r}; it must be {ANYTHING} (anything),"
            f" {FACE} (face), {EDGE} (edge) or {VERTEX} (vertex)"
        )
    return given.astype(np.int8)


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
