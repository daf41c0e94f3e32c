"""How long work is shown: what is done, how much of it, for how long, and what is left."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from time import perf_counter
from typing import TypeVar

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

__all__ = ["under_a_bar"]

Item = TypeVar("Item")

REDRAWN_EVERY = 0.5
"""Seconds between two drawings."""


def under_a_bar(
    items: Iterable[Item], total: int, label: str, console: Console | None, *, done: int = 0
) -> Iterator[Item]:
    """Pass items on; each counts once the next is asked for.

    The bar is drawn between items only, so that nothing is timed during a drawing.

    Args:
        items: what comes piece by piece.
        total: how many there are, those done before among them.
        label: what they are.
        console: where to draw, if it is a terminal; none, and nothing is drawn.
        done: how many were there before.
    """
    shown = console or Console(quiet=True)
    with Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("left:"),
        TimeRemainingColumn(),
        console=shown,
        auto_refresh=False,
        transient=True,
        disable=not shown.is_terminal,
    ) as bar:
        task = bar.add_task(label, total=total, completed=done)
        bar.refresh()
        drawn = perf_counter()
        for item in items:
            yield item
            bar.advance(task)
            if perf_counter() - drawn > REDRAWN_EVERY:
                bar.refresh()
                drawn = perf_counter()
        bar.refresh()
