"""What a touch may report, and which rivals each report would bear out: for a person to read."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from ...recognizer.predict.prediction import MET_OBJECT, PoseSamples, Predictions

Floats = NDArray[np.float64]


class Purpose(Enum):
    """What a touch is for."""

    FIND = "find the part"
    TELL_APART = "tell rivals apart"
    REFINE = "refine the pose"


@dataclass(frozen=True)
class Rival:
    """An object, and how it may lie, that predicts a report."""

    object_name: str
    hypotheses: tuple[int, ...]
    """Their places among the belief's hypotheses. One whose pose is open may be in several reports,
    or in none of the few poses that stand for it."""
    chance: float
    """How likely the object lies like that, as far as is known."""


@dataclass(frozen=True, eq=False)
class Report:
    """Something that a touch may feel, and who predicts it.

    What two rivals predict is one report if a reading within the bounds may fit both.
    """

    touches: bool
    """Whether the part is touched; if not, the probe gets to the end of its way."""
    depths: tuple[float, float]
    """The least and the largest way to it that its rivals predict, metres."""
    spread: float
    """Standard deviation of the way by what is open of their poses, at most, metres."""
    point_world: Floats
    """(3,) where the likeliest of them has it, metres."""
    normal_world: Floats
    """(3,) the outward normal there; zeros if the part isn't touched."""
    chance: float
    """How likely it is, as far as is known."""
    rivals: tuple[Rival, ...]
    """The likeliest first."""


@dataclass(frozen=True, eq=False)
class Suggestion:
    """A straight touch worth making."""

    start_world: Floats
    """(3,) where the probe's tip starts, metres, free of the part whatever is true."""
    direction_world: Floats
    """(3,) of its motion, unit."""
    length: float
    """How far it goes if it touches nothing, metres."""
    purpose: Purpose
    score: float
    """What the policy's formula makes of it; larger is better, and only to be compared with others
    of the same call."""
    rules_out: float
    """The share of the rivals that it is expected to rule out."""
    reports: tuple[Report, ...]
    """What it may feel, the likeliest first; none before the first contact."""

    @property
    def end_world(self) -> Floats:
        """(3,) where its way ends if it touches nothing, metres."""
        return self.start_world + self.length * self.direction_world


def reports_of(
    samples: PoseSamples,
    told: Predictions,
    start_world: Floats,
    direction_world: Floats,
    *,
    position_error: float,
    normal_error: float,
) -> tuple[Report, ...]:
    """What one straight touch may report.

    The likeliest pose takes all to its report that a reading may not tell from it, then the
    likeliest of the others, and so on.

    Args:
        samples: poses that stand for the belief.
        told: what they predict of it, (s, 1, 1).
        start_world: (3,) metres.
        direction_world: (3,) unit.
        position_error: bound on readings, metres.
        normal_error: bound on normals, radians; pi if they aren't felt.
    """
    touched = told.outcomes[:, 0, 0] == MET_OBJECT
    depths, spreads = told.depths[:, 0, 0], told.depth_spread[:, 0, 0]
    normals = told.normals_world[:, 0, 0]
    slopes = np.abs(normals @ direction_world)
    reports, left = [], np.ones(len(samples), bool)
    for lead in np.argsort(-samples.weights, kind="stable"):
        if not left[lead]:
            continue
        members = left & (touched == touched[lead])
        if touched[lead]:
            gaps = slopes * np.abs(depths - depths[lead])
            slack = position_error + slopes * np.hypot(spreads, spreads[lead])
            angles = np.arccos(np.clip(normals @ normals[lead], -1.0, 1.0))
            turns = np.hypot(samples.rotation_spread, samples.rotation_spread[lead])
            members &= (gaps < 2.0 * slack) & (angles <= 2.0 * (normal_error + turns))
        left &= ~members
        rows = np.flatnonzero(members)
        reports.append(
            Report(
                touches=bool(touched[lead]),
                depths=(float(depths[rows].min()), float(depths[rows].max())),
                spread=float(spreads[rows].max()),
                point_world=start_world + depths[lead] * direction_world,
                normal_world=normals[lead] * touched[lead],
                chance=float(samples.weights[rows].sum()),
                rivals=_rivals(samples, rows),
            )
        )
    return tuple(sorted(reports, key=lambda report: -report.chance))


def _rivals(samples: PoseSamples, rows: NDArray[np.int64]) -> tuple[Rival, ...]:
    """The objects of some samples, each with the hypotheses that these stand for."""
    found = []
    for number in np.unique(samples.objects[rows]):
        own = rows[samples.objects[rows] == number]
        hypotheses = tuple(np.unique(samples.hypotheses[own]).tolist())
        chance = float(samples.weights[own].sum())
        found.append(Rival(samples.models[number].name, hypotheses, chance))
    return tuple(sorted(found, key=lambda rival: -rival.chance))
