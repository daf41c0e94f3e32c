"""Table V of the memo beside ours: means, and the stated rule by which a row counts as alike."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ....assets.memo import PoseErrorRow
from ..section import Comparison
from ..trial import Spec
from .trials import ANGLE, DIRECTION, METHODS, TRANSLATION, Errors

Floats = NDArray[np.float64]

TRIALS = 100
"""As many as the memo ran a row."""
FACTOR = 4.0
"""A mean counts as of the memo's order if it is within this factor: the shapes are stand-ins."""
SURE = 2.0
"""Standard errors by which two rows must differ, in the memo and here, to have an order."""
NAMES = ("direction, °", "angle, °", "translation, in")
COLUMNS = (DIRECTION, ANGLE, TRANSLATION)
"""What the memo prints."""
DAMAGED = "the transcript of this row is damaged: its figures may be another row's"
STAND_INS = "the shape and its origin are a stand-in's, and the memo leaves open how it clusters"


def printed(row: PoseErrorRow) -> tuple[float, float, float]:
    """The memo's means, as in `NAMES`."""
    return row.direction_deg, row.angle_deg, row.translation_in


def given(errors: Floats) -> Floats:
    """(k, 4) errors of the trials that gave a pose."""
    return errors[~np.isnan(errors[:, 0])]


def means(errors: Floats) -> Floats:
    """(4,) means over the trials that gave a pose; NaN if none did."""
    rows = given(errors)
    return rows.mean(axis=0) if len(rows) else np.full(4, np.nan)


def standard_errors(errors: Floats, trials: int | None = None) -> Floats:
    """(4,) standard errors of the means, or of means of so many trials; infinite if unknown."""
    rows = given(errors)
    if len(rows) < 2:
        return np.full(4, np.inf)
    return rows.std(axis=0, ddof=1) / math.sqrt(trials or len(rows))


def judge(rows: Sequence[PoseErrorRow], errors: Sequence[Errors]) -> tuple[Comparison, ...]:
    """Every row with its verdict on the memo's method.

    A readable row is within if each mean is within `FACTOR` of the memo's, and none is ordered the
    other way against a neighbour along a noise axis, see `misplaced`.
    """
    method = [error.by_method[METHODS[0]] for error in errors]
    disordered = misplaced(rows, method)
    compared = []
    for row, values, disorder in zip(rows, method, disordered, strict=True):
        ours = tuple(float(mean) for mean in means(values)[list(COLUMNS)])
        faults = [
            f"{name}: {here / there:.2f} times the memo's"
            for name, here, there in zip(NAMES, ours, printed(row), strict=True)
            if not 1.0 / FACTOR <= here / there <= FACTOR
        ]
        why, verdict = "; ".join([*faults, *disorder, STAND_INS]), "outside"
        if not row.sure:
            why, verdict = DAMAGED, "not judged"
        elif not (faults or disorder):
            why, verdict = "", "within"
        compared.append(Comparison(Spec.of(row).key, NAMES, printed(row), ours, verdict, why))
    return tuple(compared)


def misplaced(rows: Sequence[PoseErrorRow], method: Sequence[Floats]) -> list[list[str]]:
    """For each row, where its order against a neighbour along a noise axis isn't the memo's.

    Means of a hundred trials scatter: two rows have an order only where both the memo and we have
    them apart by more than that. The memo prints no scatter; ours stands in for it.

    Args:
        rows: of the memo.
        method: (t, 4) our errors of each.
    """
    faults: list[list[str]] = [[] for _ in rows]
    for a, b in neighbours(rows):
        here = means(method[b]) - means(method[a])
        scatter = SURE * np.hypot(standard_errors(method[a]), standard_errors(method[b]))
        of_memo = SURE * np.hypot(*(standard_errors(method[row], TRIALS) for row in (a, b)))
        there = np.subtract(printed(rows[b]), printed(rows[a]))
        for name, column, step in zip(NAMES, COLUMNS, there, strict=True):
            ordered = abs(here[column]) > scatter[column] and abs(step) > of_memo[column]
            if ordered and here[column] * step < 0.0:
                other = ", ".join(Spec.of(rows[a]).key[1:])
                faults[b].append(f"{name}: ordered the other way against {other}")
    return faults


def neighbours(rows: Sequence[PoseErrorRow]) -> list[tuple[int, int]]:
    """Pairs of readable rows one step apart along one noise axis, the one of less noise first."""
    levels = [Spec.of(row).levels for row in rows]
    readable = [number for number, row in enumerate(rows) if row.sure]
    pairs = []
    for b in readable:
        for axis in (0, 1):
            lower = [
                a
                for a in readable
                if rows[a].object_name == rows[b].object_name
                and levels[a][1 - axis] == levels[b][1 - axis]
                and levels[a][axis] < levels[b][axis]
            ]
            pairs += [(max(lower, key=lambda a: levels[a][axis]), b)] if lower else []
    return pairs
