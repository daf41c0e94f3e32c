"""What a benchmark reports, how its cases are drawn and stepped through."""

from __future__ import annotations

import platform
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from textwrap import fill
from time import perf_counter
from typing import TypeVar

import numpy as np
from rich.console import Console
from rich.progress import Progress

from ....envs.sensors.grid import TrueContacts, sense_grid
from ....envs.sensors.noise import SensorNoise
from ....recognizer import Belief, Contacts, Polyhedron

T = TypeVar("T")

REDRAWN_EVERY = 0.5
"""Seconds between two drawings of a progress bar."""
WIDTHS = (42, 26, 24)
"""Columns of the table, characters."""


@dataclass(frozen=True, kw_only=True)
class Settings:
    """How much is measured."""

    cases: int = 200
    """Random cases a row."""
    library: int = 1000
    """Models in the large library."""
    seed: int = 0
    folder: Path | None = None
    """Where the range tables of the large library are kept; None for a temporary folder."""

    def __post_init__(self) -> None:
        if self.cases < 1 or self.library < 5 or self.seed < 0:
            raise ValueError(f"{self}: needs a case, five models, and a seed from 0 on")


@dataclass(frozen=True)
class Row:
    """One figure."""

    what: str
    here: str
    goal: str = ""
    met: bool | None = None
    """None where there is no goal, or only a comparison."""
    details: Sequence[str] = ()
    """What is to be said about it, a line each."""


@dataclass(frozen=True)
class Section:
    """The figures of one question, and what is to be known about them."""

    title: str
    rows: Sequence[Row]
    note: str = ""


@dataclass(frozen=True, eq=False)
class Case:
    """One object, touched."""

    model: Polyhedron
    truth: TrueContacts
    contacts: Contacts

    def held_by(self, belief: Belief) -> bool:
        """Whether the true interpretation is in a belief about these contacts."""
        return any(
            bool((hypothesis.interpretations == self.truth.faces).all(axis=1).any())
            for hypothesis in belief.hypotheses
            if hypothesis.object_name == self.model.name
        )


def draw_cases(
    models: Sequence[Polyhedron], noise: SensorNoise, touches: tuple[int, int], settings: Settings
) -> list[Case]:
    """Grid contacts on the models in turn, with noise uniform in its bounds.

    Args:
        models: what is touched.
        noise: bounds on positions and normals.
        touches: the fewest and the most contacts.
        settings: how many cases, and their seed.
    """
    rng = np.random.default_rng(settings.seed)
    cases = []
    for index in range(settings.cases):
        model = models[index % len(models)]
        truth = sense_grid(model, rng, *touches)
        cases.append(Case(model, truth, truth.noisy(noise, rng)))
    return cases


def steps(items: Sequence[T], description: str) -> Iterator[T]:
    """Go through items under a progress bar that is drawn between them, never during one."""
    console = Console()
    quiet = not console.is_terminal
    with Progress(console=console, auto_refresh=False, transient=True, disable=quiet) as progress:
        task = progress.add_task(description, total=len(items))
        progress.refresh()
        drawn = perf_counter()
        for item in items:
            yield item
            progress.advance(task)
            if perf_counter() - drawn > REDRAWN_EVERY:
                progress.refresh()
                drawn = perf_counter()


def median_and_tail(seconds: Sequence[float]) -> tuple[float, float]:
    """Median and 99th percentile, milliseconds."""
    median, tail = 1e3 * np.percentile(seconds, (50, 99))
    return float(median), float(tail)


def show_header(settings: Settings) -> None:
    """Print what is measured, with what, and the heads of the columns."""
    libraries = ", ".join(f"{name} {version(name)}" for name in ("numpy", "scipy", "numba"))
    print(
        f"{settings.cases} cases a row, seed {settings.seed}, one thread, processor time; Python"
        f" {platform.python_version()}, {libraries}, {platform.machine()}\n\n"
        f"{'':<{WIDTHS[0]}}{'here':>{WIDTHS[1]}}{'goal':>{WIDTHS[2]}}"
    )


def show(section: Section) -> None:
    """Print a section of the table."""
    print(f"\n{section.title}")
    for row in section.rows:
        verdict = "" if row.met is None else "  met" if row.met else "  MISSED"
        what, here = f"  {row.what:<{WIDTHS[0] - 2}}", f"{row.here:>{WIDTHS[1]}}"
        print(f"{what}{here}{row.goal:>{WIDTHS[2]}}{verdict}".rstrip())
        for detail in row.details:
            print(f"      {detail}")
    if section.note:
        print(fill(section.note, 98, initial_indent="  ", subsequent_indent="  "), flush=True)
