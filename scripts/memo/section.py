"""What a rerun experiment of the memo comes to: a section of the page, and every row judged."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from ..report.markdown import Table
from .plan import Plan


@dataclass(frozen=True)
class Comparison:
    """A row that the memo prints, beside ours."""

    key: tuple[str, ...]
    """What the row is about, such as ("housing", "π/10", "0.05 in")."""
    names: tuple[str, ...]
    """What each figure is, such as ("least", "median", "90 %", "most")."""
    memo: tuple[float, ...] | None
    """The printed figures; None where the memo prints none, or its print is damaged."""
    ours: tuple[float, ...]
    verdict: Literal["within", "outside", "not judged"]
    why: str
    """Why it is outside or not judged; empty if within."""


@dataclass(frozen=True)
class Figure:
    """A drawing of a page."""

    name: str
    """Of its file, without what the page's files are called and without ending."""
    svg: str
    caption: str


@dataclass(frozen=True)
class Section:
    """An experiment: what was asked, what was done, what came out."""

    name: str
    """As on the command line, such as "table2"."""
    title: str
    place: str
    """Where the memo has it, such as "Section 4.3, Table II"."""
    asked: str
    done: str
    found: str
    blocks: tuple[str | Table | Figure, ...]
    """Tables, figures and Markdown in the order in which they are read."""
    comparisons: tuple[Comparison, ...]
    checked: int
    """Trials in which it was looked whether the right interpretation was kept."""
    lost: int
    """Those of them that discarded it."""


Experiment = Callable[[Plan], Section]
"""What each `memo_*` module has as `run`."""
