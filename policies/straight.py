"""Straight touches: from the edge of a region that can be reached, along a line, to its other end.

What a machine with a touch probe or a robot with a finger does at a person's word, one ray a touch.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from ..recognizer import SupportPlane
from ..recognizer.advice.twins import sample_surface
from ..recognizer.predict.prediction import PoseSamples
from ..recognizer.predict.probes import TriadRays

Floats = NDArray[np.float64]

AXES = {
    f"{sign}{axis}": tuple(float(f"{sign}1") if axis == other else 0.0 for other in "xyz")
    for axis in "xyz"
    for sign in "+-"
}
"""The directions that have a name."""
LEVEL = 1e-9
"""Sine of the angle against the plane up to which a direction counts as along it."""
SQUARE = 0.35
"""Cosine between a face's normal and the way back from which a named direction is aimed at it."""


@dataclass(frozen=True, init=False, eq=False)
class Region:
    """A box along the axes that the probe's tip can reach."""

    low: Floats
    """(3,) its lowest corner, world frame, metres."""
    high: Floats
    """(3,) its highest corner."""

    def __init__(self, low: ArrayLike, high: ArrayLike) -> None:
        """Hold a box.

        Raises:
            ValueError: corners that aren't three finite numbers, each of ``low`` below ``high``'s.
        """
        corners = np.array(low, np.float64), np.array(high, np.float64)
        for name, corner in zip(("low", "high"), corners, strict=True):
            if corner.shape != (3,) or not np.isfinite(corner).all():
                raise ValueError(f"region: {name} is {corner.tolist()}; it must be three numbers")
        if not (corners[0] < corners[1]).all():
            raise ValueError(
                f"region: low is {corners[0].tolist()} and high {corners[1].tolist()};"
                " each number of low must be below that of high"
            )
        self.__dict__.update(low=corners[0], high=corners[1])

    @classmethod
    def around(cls, samples: PoseSamples, margin: float) -> Region:
        """The box around objects where samples have them, and a margin in metres."""
        low, high = np.full(3, np.inf), np.full(3, -np.inf)
        turns = Rotation.from_quat(samples.rotations)
        for row, number in enumerate(samples.objects):
            corners = (
                turns[row].apply(samples.models[number].vertices.copy()) + samples.positions[row]
            )
            room = margin + 3.0 * samples.position_spread[row]
            low = np.minimum(low, corners.min(axis=0) - room)
            high = np.maximum(high, corners.max(axis=0) + room)
        return cls(low, high)

    @property
    def middle(self) -> Floats:
        """(3,) its middle."""
        return 0.5 * (self.low + self.high)

    @property
    def diagonal(self) -> float:
        """From corner to corner, metres."""
        return float(np.linalg.norm(self.high - self.low))


@dataclass(frozen=True, eq=False)
class Touches:
    """Straight touches: where each starts, its direction and how far it can go."""

    starts: Floats
    """(a, 3) world frame, metres, on the region's edge."""
    directions: Floats
    """(a, 3) of motion, unit."""
    lengths: Floats
    """(a,) to the region's other edge or to the plane, metres."""

    def __len__(self) -> int:
        return len(self.starts)

    def __getitem__(self, rows: NDArray[np.int64] | NDArray[np.bool_]) -> Touches:
        return Touches(self.starts[rows], self.directions[rows], self.lengths[rows])

    @classmethod
    def join(cls, parts: Sequence[Touches]) -> Touches:
        """All touches of ``parts``, in order."""
        return cls(
            np.concatenate([part.starts for part in parts]),
            np.concatenate([part.directions for part in parts]),
            np.concatenate([part.lengths for part in parts]),
        )

    @property
    def rays(self) -> TriadRays:
        """As the predictor takes them, one ray a probe."""
        return TriadRays(self.starts[:, None], self.directions[:, None])


@dataclass(frozen=True, eq=False)
class Reach:
    """Which straight touches can be made."""

    region: Region
    directions: Floats | None
    """(d, 3) the only unit directions of motion, or None for any that doesn't come from below."""
    up: Floats
    """(3,) unit, away from the plane."""
    floor: float | None
    """``up . x`` of the plane, metres, or None if there isn't any."""
    clearance: float
    """How far above the plane touches along it stay, metres."""

    @classmethod
    def of(
        cls,
        region: Region,
        directions: ArrayLike | None,
        support: SupportPlane | None,
        clearance: float,
    ) -> Reach:
        """Touches in a region, along directions, above a plane if there is one; z is up if not."""
        up = np.array([0.0, 0.0, 1.0]) if support is None else support.up
        floor = None if support is None else support.height
        return cls(region, checked_directions(directions), up, floor, clearance)

    @property
    def named(self) -> Floats:
        """(d, 3) the directions in which touches are sent wherever nothing asks for another."""
        if self.directions is not None:
            return self.directions
        axes = np.array(list(AXES.values()))
        kept = axes[axes @ self.up <= LEVEL]
        # Straight down first, and there too where the plane lies askew.
        return np.concatenate([0.0 - self.up[None], kept[np.abs(kept @ self.up + 1.0) > LEVEL]])

    def through(self, points: Floats, directions: Floats) -> Touches:
        """The touches along lines through points, where there are any.

        Args:
            points: (a, 3) world frame, metres.
            directions: (a, 3) of motion, unit.

        Returns:
            At most ``a``: lines that miss the region or run too near along the plane are left out.
        """
        with np.errstate(divide="ignore", invalid="ignore"):
            sides = np.stack([self.region.low - points, self.region.high - points]) / directions
        # Along an axis at right angles to a line it is inside throughout, or never.
        inside = (points >= self.region.low) & (points <= self.region.high)
        level = directions == 0.0
        sides[:, level] = np.where(inside[level], [[-np.inf], [np.inf]], [[np.inf], [-np.inf]])
        enters, leaves = sides.min(axis=0).max(axis=1), sides.max(axis=0).min(axis=1)
        enters = np.where((level & ~inside).any(axis=1), np.inf, enters)
        starts = points + np.where(np.isfinite(enters), enters, 0.0)[:, None] * directions
        lengths = np.where(np.isfinite(enters), leaves - enters, -1.0)
        if self.floor is not None:
            height, falling = starts @ self.up - self.floor, -(directions @ self.up)
            with np.errstate(divide="ignore", invalid="ignore"):
                landing = np.where(falling > LEVEL, height / falling, np.inf)
            lengths = np.where(height > self.clearance, np.minimum(lengths, landing), -1.0)
        return Touches(starts, directions, lengths)[lengths > 0.0]

    def spread(self, count: int) -> Touches:
        """About so many touches, spread evenly over the region along each named direction."""
        named = self.named
        side = max(int(np.ceil(np.sqrt(count / len(named)))), 1)
        return Touches.join([self.grid(direction, side) for direction in named])

    def grid(self, direction: Floats, side: int) -> Touches:
        """At most ``side`` squared parallel touches, in the middles of equal squares."""
        across = across_direction(direction)
        size = np.abs(across) @ (self.region.high - self.region.low)
        middles = ((2.0 * np.arange(side) + 1.0) / side - 1.0) / 2.0
        first, second = (part.ravel() for part in np.meshgrid(middles, middles, indexing="ij"))
        places = np.column_stack([first, second]) * size
        points = self.region.middle + places @ across
        return self.through(points, np.tile(direction, (len(points), 1)))

    def aimed(self, samples: PoseSamples, count: int, rng: np.random.Generator) -> Touches:
        """Touches at random points of the surfaces that samples have, squarely where that can be.

        Args:
            samples: poses that stand for the belief, at least one; each is aimed at as often.
            count: about how many touches.
            rng: source of the points.
        """
        turns, each = Rotation.from_quat(samples.rotations), -(-count // len(samples))
        points, normals = np.empty((2, len(samples), each, 3))
        for row, number in enumerate(samples.objects):
            model = samples.models[number]
            places, faces = sample_surface(model, each, rng)
            points[row] = turns[row].apply(places) + samples.positions[row]
            normals[row] = turns[row].apply(model.normals[faces])
        points, normals = points.reshape(-1, 3), normals.reshape(-1, 3)
        facing = normals @ self.named.T
        directions = self.named[facing.argmin(axis=1)]
        aims = facing.min(axis=1) < -SQUARE
        if self.directions is None:
            # Half of them against the face; all where no named direction meets it well.
            square = ((rng.random(len(points)) < 0.5) | ~aims) & (-normals @ self.up <= LEVEL)
            directions, aims = np.where(square[:, None], -normals, directions), aims | square
        return self.through(points[aims], directions[aims])


def checked_directions(directions: ArrayLike | None) -> Floats | None:
    """(d, 3) directions of unit length; None stays None.

    Raises:
        ValueError: none at all, or rows that aren't three finite numbers other than zeros.
    """
    if directions is None:
        return None
    given = np.array(directions, np.float64)
    if given.ndim != 2 or given.shape[1:] != (3,) or not len(given):
        raise ValueError(f"directions must have shape (d, 3), d at least 1, not {given.shape}")
    lengths = np.linalg.norm(given, axis=1)
    bad = np.flatnonzero(~(np.isfinite(lengths) & (lengths > 0.0)))
    if bad.size:
        row = given[bad[0]].tolist()
        raise ValueError(f"directions: row {bad[0]} is {row}; it must be a finite vector, not zero")
    return given / lengths[:, None]


def direction_name(direction: Floats) -> str | None:
    """The name of a direction along an axis; None if it isn't along one."""
    return next(
        (name for name, axis in AXES.items() if np.abs(direction - axis).max() < LEVEL), None
    )


def across_direction(direction: Floats) -> Floats:
    """(2, 3) two unit vectors at right angles to a direction and to each other."""
    other = np.eye(3)[int(np.abs(direction).argmin())]
    first = np.cross(direction, other)
    first /= np.linalg.norm(first)
    return np.array([first, np.cross(direction, first)], np.float64)
