"""How the memo's experiments are run: their cases on the processes there are, under a bar."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import get_context
from typing import TypeVar

from rich.console import Console

from ..progress_bar import under_a_bar

Case = TypeVar("Case")
Result = TypeVar("Result")


@dataclass(eq=False)
class PoolPlan:
    """A `section.Plan`: what was asked for, and who runs it."""

    trials: int | None
    seed: int
    console: Console
    """Where progress is shown, if it is a terminal."""
    pool: ProcessPoolExecutor | None
    """None: this process runs the cases itself."""

    def map(
        self, function: Callable[[Case], Result], cases: Sequence[Case], label: str
    ) -> Iterable[Result]:
        """Results in the order of the cases; see `section.Plan`."""
        if self.pool is None:
            results: Iterable[Result] = map(function, cases)
        else:
            results = self.pool.map(function, cases)
        return under_a_bar(results, len(cases), label, self.console)


@contextmanager
def open_plan(trials: int | None, seed: int, workers: int, console: Console) -> Iterator[PoolPlan]:
    """A plan with as many processes as are asked for; they end with it.

    Args:
        trials: a row; None for as many as the memo ran.
        seed: of all cases.
        workers: processes; with one, no other than this.
        console: where progress is shown, if it is a terminal.
    """
    if workers == 1:
        yield PoolPlan(trials, seed, console, None)
        return
    # A process that is forked while others run threads can hang.
    pool = ProcessPoolExecutor(workers, get_context("spawn"), initializer=_leave_interrupts)
    try:
        yield PoolPlan(trials, seed, console, pool)
    finally:
        pool.shutdown(cancel_futures=True)


def processors() -> int:
    """How many processors this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _leave_interrupts() -> None:
    """Let the process that was started by hand answer Ctrl-C, for all."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
