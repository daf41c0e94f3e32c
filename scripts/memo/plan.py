"""How an experiment is run: the trials of its rows, handed out in pieces."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Sequence
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

import numpy as np

Case = TypeVar("Case")
Result = TypeVar("Result")
Row = TypeVar("Row", bound=Hashable, covariant=True)

PIECE = 10
"""Trials that a process is given at a time."""


class Plan(Protocol):
    """How an experiment is to be run."""

    trials: int | None
    """Trials a row; None for as many as the memo ran."""
    seed: int

    def map(
        self, function: Callable[[Case], Result], cases: Sequence[Case], label: str
    ) -> Iterable[Result]:
        """Results in the order of the cases, on the processes there are, with progress shown.

        The function is one of a module, so that other processes find it. A case holds what it
        needs, its own seed too, so that results don't depend on the number of processes.
        """
        ...


@dataclass(frozen=True)
class Trials(Generic[Row]):
    """Some trials of a row, with all that another process needs to run them."""

    row: Row
    seed: int
    first: int
    count: int

    @property
    def numbers(self) -> range:
        """Of its trials."""
        return range(self.first, self.first + self.count)

    def generators(self) -> list[np.random.Generator]:
        """One a trial. Every row sees the same cases, so that rows differ by their noise alone."""
        return [np.random.default_rng([self.seed, number]) for number in self.numbers]


def run_rows(
    plan: Plan,
    rows: Iterable[Row],
    trials: int,
    function: Callable[[Trials[Row]], Result],
    label: str,
) -> dict[Row, list[Result]]:
    """Run all trials of all rows; of each row what comes of its pieces, in order.

    Args:
        plan: how.
        rows: each has the same number of trials.
        trials: how many that is.
        function: runs a piece; one of a module.
        label: what is shown meanwhile.
    """
    pieces = [
        Trials(row, plan.seed, first, min(PIECE, trials - first))
        for row in rows
        for first in range(0, trials, PIECE)
    ]
    found: dict[Row, list[Result]] = {piece.row: [] for piece in pieces}
    for piece, result in zip(pieces, plan.map(function, pieces, label), strict=True):
        found[piece.row].append(result)
    return found
