"""Free space: where the probe went without meeting the object."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, init=False, eq=False)
class FreeSpace:
    """Straight paths swept by a probe, each a line or, for a ball tip, a capsule.

    A bound is a promise: no point of a path is nearer to the object than ``radius`` less ``error``;
    where that is below zero, none is deeper inside than so much (Gaston and Lozano-Perez 1984 call
    the use of it the path constraint). The way to a contact is such a path, as is a probe that met
    nothing.
    """

    starts: Floats
    """(m, 3) where each path began, world frame, metres; of a ball its centre."""
    ends: Floats
    """(m, 3) where it ended."""
    radius: Floats
    """(m,) of what was moved along it, metres; 0 for a point."""
    error: Floats
    """(m,) how far off the true path may be, metres."""

    def __init__(
        self,
        starts: ArrayLike,
        ends: ArrayLike,
        *,
        radius: ArrayLike = 0.0,
        error: ArrayLike,
    ) -> None:
        """Check and hold paths; every array is copied and made read-only.

        Args:
            starts: (m, 3) metres, world frame.
            ends: (m, 3) likewise.
            radius: metres, zero or more; one number or (m,).
            error: metres, above zero; one number or (m,).

        Raises:
            ValueError: a shape that does not fit, a value that is not finite, a radius below zero,
                an error that is not above zero.
        """
        values = {"starts": _points("starts", starts), "ends": _points("ends", ends)}
        count = len(values["starts"])
        if len(values["ends"]) != count:
            raise ValueError(f"{count} starts but {len(values['ends'])} ends: give one end a start")
        for name, given in (("radius", radius), ("error", error)):
            numbers = np.array(given, dtype=np.float64)
            if numbers.ndim == 0:
                numbers = np.full(count, numbers)
            if numbers.shape != (count,):
                raise ValueError(
                    f"{name} must be one number or have shape ({count},), not {numbers.shape}"
                )
            bad = ~np.isfinite(numbers) | (numbers < 0.0 if name == "radius" else numbers <= 0.0)
            if bad.any():
                row = int(np.flatnonzero(bad)[0])
                least = "zero or more" if name == "radius" else "above zero"
                raise ValueError(f"{name}: row {row} is {numbers[row]:g}; it must be {least}")
            values[name] = numbers
        self.__dict__.update(FreeSpace.trusted(**values).__dict__)

    @classmethod
    def trusted(cls, starts: Floats, ends: Floats, *, radius: Floats, error: Floats) -> FreeSpace:
        """Paths of arrays that are known to be good: not checked, taken over, made read-only.

        The checks take longer than a touch. All arrays are C-contiguous, of the shapes, types and
        values that a `FreeSpace` has.
        """
        paths = object.__new__(cls)
        values = paths.__dict__
        values["starts"], values["ends"] = starts, ends
        values["radius"], values["error"] = radius, error
        for value in values.values():
            value.setflags(write=False)
        return paths

    def __len__(self) -> int:
        return len(self.starts)

    @property
    def clearance(self) -> Floats:
        """(m,) the least signed distance of each path from the object, metres."""
        return self.radius - self.error

    @classmethod
    @cache
    def none(cls) -> FreeSpace:
        """No paths at all."""
        return cls(np.zeros((0, 3)), np.zeros((0, 3)), error=np.zeros(0))

    @classmethod
    def join(cls, parts: Sequence[FreeSpace]) -> FreeSpace:
        """All paths of ``parts``, in order."""
        parts = [cls.none(), *parts]
        return cls(
            np.concatenate([part.starts for part in parts]),
            np.concatenate([part.ends for part in parts]),
            radius=np.concatenate([part.radius for part in parts]),
            error=np.concatenate([part.error for part in parts]),
        )


def _points(name: str, values: ArrayLike) -> Floats:
    points = np.array(values, dtype=np.float64, order="C")
    if points.ndim != 2 or points.shape[1] != 3:
        raise ValueError(f"{name} must have shape (m, 3), not {points.shape}")
    bad = np.flatnonzero(~np.isfinite(points).all(axis=1))
    if bad.size:
        raise ValueError(f"{name}: row {bad[0]} is {points[bad[0]].tolist()}; it must be finite")
    return points
