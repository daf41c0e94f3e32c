"""The figures that AI Memo 738 prints, as data.

Units are the memo's, inches and degrees; a bound on normals is pi over a whole number, radians.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import Any


@dataclass(frozen=True)
class CountRow:
    """One row of a table of counts: least, median, 90th percentile and most of 100 runs."""

    object_name: str
    pi_over: int
    """The bound on normals is pi over this, radians."""
    position_error_in: float
    """The bound on positions, inches."""
    smallest: int
    median: int
    p90: int
    largest: int


@dataclass(frozen=True)
class ClusterRow:
    """One row of Table VI: distinct transforms when their translations count too."""

    object_name: str
    pi_over: int
    """The bound on normals is pi over this, radians."""
    position_error_in: float
    """The bound on positions, inches."""
    translation_tolerance_in: float
    """Translations less far apart are the same, inches."""
    smallest: int
    median: int
    p90: int
    largest: int


@dataclass(frozen=True)
class PlanarRow:
    """One row of Table I: how many runs gave how many interpretations."""

    object_name: str
    edges: int
    direction: bool
    """Whether the direction constraint was used."""
    median: int
    """As the text states it."""
    largest: int | None
    """The most interpretations seen, as the text states it; None where it doesn't."""
    runs: tuple[int, ...]
    """Runs in each of `planar_bins`."""


@dataclass(frozen=True)
class PoseErrorRow:
    """One row of Table V: mean errors of the pose of the right interpretation."""

    object_name: str
    pi_over: int
    """The bound on normals is pi over this, radians."""
    position_error_in: float
    """The bound on positions, inches."""
    direction_deg: float
    """Angle between right and computed direction of rotation, degrees."""
    angle_deg: float
    """Difference of right and computed angle of rotation, degrees."""
    translation_in: float
    """Inches."""
    sure: bool
    """False where the print is damaged and the row may be another's."""


@dataclass(frozen=True)
class LevelRow:
    """One row of Tables X and XI: interpretations at a level of the tree."""

    points: int
    """The level: how many contacts have a face."""
    smallest: int
    median: int
    p90: int
    largest: int
    """Where it is `LARGEST_PRINTED`, at least that."""


@dataclass(frozen=True)
class RangeRow:
    """One view of Section 5."""

    view: str
    """Its figure."""
    points: int
    interpretations: int
    transforms: int


@dataclass(frozen=True)
class RangeSetting:
    """How Section 5 measured."""

    pi_over: int
    """The bound on normals is pi over this, radians."""
    position_error_in: float
    """The bound on positions, inches."""
    grid_cm: tuple[float, float]
    """Spacing of the range image along x and y, centimetres."""
    patch: int
    """Points along a side of the patch that a plane is fitted to."""
    fewest_normals: int
    """Independent normals that the points chosen include."""


@dataclass(frozen=True)
class Timing:
    """Section 7: seconds on a Symbolics 3600."""

    object_name: str
    pi_over: int
    """The bound on normals is pi over this, radians."""
    position_error_in: float
    """The bound on positions, inches."""
    prune_seconds: float
    """Mean time to generate and prune a tree."""
    test_seconds: float
    """Mean time of all model tests of a tree."""
    seconds_a_test: float


@dataclass(frozen=True)
class Place:
    """Where the memo has a table, and what ails its print."""

    section: str
    title: str
    damage: str
    """What the print doesn't let one read for certain; empty if it is sound."""


LARGEST_PRINTED = 1000
"""Table X prints "1000+" for this many and more."""


def place(name: str) -> Place:
    """Where the memo has a table: "table1" to "table11", "section5" or "section7".

    Raises:
        ValueError: unknown name.
    """
    entry = _figures().get(name)
    if not isinstance(entry, dict):
        known = ", ".join(key for key, value in _figures().items() if isinstance(value, dict))
        raise ValueError(f"the memo has no {name!r}; there are: {known}")
    return Place(entry["section"], entry["title"], entry.get("damage", ""))


def table1() -> tuple[PlanarRow, ...]:
    """Table I (Section 4.1): planar objects, five contacts, 250 runs a row."""
    rows = _figures()["table1"]["rows"]
    return tuple(PlanarRow(*row[:5], runs=tuple(row[5])) for row in rows)


def planar_bins() -> tuple[str, ...]:
    """What the columns of Table I count: 1 to 10 interpretations, then tens, then the rest."""
    return tuple(_figures()["table1"]["bins"])


def table2() -> tuple[CountRow, ...]:
    """Table II (Section 4.3): interpretations left by the tree, grid sensing, 12 to 20 points."""
    return _counts("table2")


def table4() -> tuple[CountRow, ...]:
    """Table IV (Section 4.3): distinct transforms, by direction of rotation."""
    return _counts("table4")


def table5() -> tuple[PoseErrorRow, ...]:
    """Table V (Section 4.3): mean errors of the computed pose."""
    return tuple(PoseErrorRow(*row) for row in _figures()["table5"]["rows"])


def table6() -> tuple[ClusterRow, ...]:
    """Table VI (Section 4.3): distinct transforms, by direction of rotation and translation."""
    return tuple(ClusterRow(*row) for row in _figures()["table6"]["rows"])


def table7() -> tuple[CountRow, ...]:
    """Table VII (Section 4.4): interpretations left by the tree, triads, 7 to 9 contacts."""
    return _counts("table7")


def table8() -> tuple[CountRow, ...]:
    """Table VIII (Section 4.4): interpretations left by the model test, triads."""
    return _counts("table8")


def table9() -> tuple[CountRow, ...]:
    """Table IX (Section 4.4): distinct transforms, triads."""
    return _counts("table9")


def table10() -> tuple[LevelRow, ...]:
    """Table X (Section 4.5): interpretations at each level, contacts in random order."""
    return tuple(LevelRow(*row) for row in _figures()["table10"]["rows"])


def table11() -> tuple[LevelRow, ...]:
    """Table XI (Section 4.5): interpretations at each level, far-apart contacts first."""
    return tuple(LevelRow(*row) for row in _figures()["table11"]["rows"])


def range_views() -> tuple[RangeRow, ...]:
    """Section 5: the two views of the housing."""
    return tuple(RangeRow(*row) for row in _figures()["section5"]["rows"])


def range_setting() -> RangeSetting:
    """Section 5: bounds and choice of points."""
    entry = _figures()["section5"]
    return RangeSetting(
        pi_over=entry["pi_over"],
        position_error_in=entry["position_error_in"],
        grid_cm=tuple(entry["grid_cm"]),
        patch=entry["patch"],
        fewest_normals=entry["fewest_normals"],
    )


def timing() -> Timing:
    """Section 7: running times."""
    entry = _figures()["section7"]
    return Timing(
        object_name=entry["object"],
        pi_over=entry["pi_over"],
        position_error_in=entry["position_error_in"],
        prune_seconds=entry["prune_seconds"],
        test_seconds=entry["test_seconds"],
        seconds_a_test=entry["seconds_a_test"],
    )


def _counts(name: str) -> tuple[CountRow, ...]:
    return tuple(CountRow(*row) for row in _figures()[name]["rows"])


@cache
def _figures() -> Mapping[str, Any]:
    text = resources.files("palpate.assets").joinpath("memo738.json").read_text(encoding="utf-8")
    return json.loads(text)
