"""The stated rule by which a row of ours counts as like the memo's, and how rows are shown."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..report.markdown import Table
from .section import Comparison

FACTOR = 4.0
"""A median counts as of the memo's order if it is within this factor: the shapes are stand-ins."""
COUNTS = ("least", "median", "90 %", "most")
MEDIAN = COUNTS.index("median")

Four = tuple[float, float, float, float]


@dataclass(frozen=True)
class Row:
    """Counts of one row of a table, ours and the memo's: least, median, 90th percentile, most."""

    key: tuple[str, ...]
    """What the row is about, as shown."""
    group: str
    """Rows of one group can be compared with one another."""
    levels: tuple[float, ...]
    """Where the row stands on each axis along which the memo's rows are ordered."""
    memo: Four | None
    ours: Four

    @property
    def ratio(self) -> float:
        """Our median over the memo's; NaN where the memo prints none."""
        return self.ours[MEDIAN] / self.memo[MEDIAN] if self.memo else float("nan")


def four(counts: ArrayLike) -> Four:
    """Least, median, 90th percentile and most of counts."""
    least, median, p90, most = np.percentile(np.asarray(counts, np.float64), (0, 50, 90, 100))
    return float(least), float(median), float(p90), float(most)


def judge(
    rows: Sequence[Row],
    why_far: Callable[[Row], str],
    why_disordered: Callable[[Row, Row], str],
    why_not: str = "",
) -> tuple[Comparison, ...]:
    """Every row with its verdict.

    A row is within the rule if its median is within a factor of `FACTOR` of the memo's, and if,
    against the next lower row on each axis, it doesn't fall where the memo's median rises, nor
    rises where that falls.

    Args:
        rows: of one table.
        why_far: the reason why a row's median is beyond the factor.
        why_disordered: the reason why a row, given first, stands on the wrong side of another.
        why_not: why rows without figures of the memo aren't judged.
    """
    return tuple(_judged(row, rows, why_far, why_disordered, why_not) for row in rows)


def comparison_table(
    heads: Sequence[str],
    comparisons: Sequence[Comparison],
    beside: Mapping[str, Sequence[str]] | None = None,
) -> Table:
    """Rows as a table: the key, the memo's figures, ours, the ratio of medians, the verdict.

    Args:
        heads: of the key's parts.
        comparisons: the rows; of `COUNTS`.
        beside: further columns, a cell a row.
    """
    further = dict(beside or {})
    rows = [
        [*_cells(each), *(cells[number] for cells in further.values())]
        for number, each in enumerate(comparisons)
    ]
    marked = [n for n, each in enumerate(comparisons) if each.verdict == "outside"]
    return Table([*heads, "memo", "ours", "ratio", "verdict", *further], rows, marked=marked)


def figures(values: Sequence[float] | None) -> str:
    """Figures of a row in one cell, such as "1 / 4 / 8 / 36"."""
    return "–" if values is None else " / ".join(figure(value) for value in values)


def figure(value: float) -> str:
    """A number, short: "1,144", "20.4", "0.08"."""
    return f"{value:,.0f}" if abs(value) >= 100.0 else f"{value:.3g}"


def _judged(
    row: Row,
    rows: Sequence[Row],
    why_far: Callable[[Row], str],
    why_disordered: Callable[[Row, Row], str],
    why_not: str,
) -> Comparison:
    if row.memo is None:
        return Comparison(row.key, COUNTS, None, row.ours, "not judged", why_not)
    reasons = []
    if not 1.0 / FACTOR <= row.ratio <= FACTOR:
        reasons.append(f"median {row.ratio:.2g} times the memo's: {why_far(row)}")
    for other in _lower_neighbours(row, rows):
        if _disordered(row, other):
            beside = ", ".join(other.key)
            reasons.append(
                f"the memo's median goes from {figure(_median(other))} to {figure(_median(row))}"
                f" after {beside}, ours from {figure(other.ours[MEDIAN])} to"
                f" {figure(row.ours[MEDIAN])}: {why_disordered(row, other)}"
            )
    verdict = "outside" if reasons else "within"
    return Comparison(row.key, COUNTS, row.memo, row.ours, verdict, "; ".join(reasons))


def _lower_neighbours(row: Row, rows: Sequence[Row]) -> list[Row]:
    """On each axis the next lower row of the group that is alike on the others."""
    found = []
    for axis in range(len(row.levels)):
        lower = [
            other
            for other in rows
            if other.group == row.group
            and other.levels[axis] < row.levels[axis]
            and all(other.levels[i] == row.levels[i] for i in range(len(row.levels)) if i != axis)
        ]
        if lower:
            found.append(max(lower, key=lambda other: other.levels[axis]))
    return found


def _disordered(row: Row, lower: Row) -> bool:
    if lower.memo is None:
        return False
    rise, own = _median(row) - _median(lower), row.ours[MEDIAN] - lower.ours[MEDIAN]
    return rise * own < 0.0


def _median(row: Row) -> float:
    assert row.memo is not None
    return row.memo[MEDIAN]


def _cells(comparison: Comparison) -> list[str]:
    ratio = "–"
    if comparison.memo is not None:
        ratio = f"{comparison.ours[MEDIAN] / comparison.memo[MEDIAN]:.2f}"
    four = (figures(comparison.memo), figures(comparison.ours))
    return [*comparison.key, *four, ratio, comparison.verdict]
