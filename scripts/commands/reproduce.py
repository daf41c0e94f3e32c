"""`palpate reproduce`: the memo's experiments rerun, its printed figures beside ours."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from rich.console import Console

    from ..memo.section import Experiment, Plan, Section

__all__ = ["reproduce"]


ORDER = (
    *(f"table{number}" for number in range(1, 7)),
    *("figure8", *(f"table{number}" for number in range(7, 12))),
    *("range", "bounds", "timing", "constraints"),
)
"""Names as on the command line, in the order of the page: the memo's."""
EVERYTHING = "all"


def reproduce(
    experiments: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="EXPERIMENT",
            help=f"One or more of: {', '.join(ORDER)}; or all. [dim]default: all[/]",
            show_default=False,
        ),
    ] = None,
    trials: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            min=1,
            help="Random cases a row. [dim]default: as many as the memo ran, 100; 250 in table1[/]",
            show_default=False,
        ),
    ] = None,
    seed: Annotated[int, typer.Option(metavar="N", min=0, help="Seed of the cases.")] = 0,
    workers: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            min=1,
            help="Processes; results are the same with any number. [dim]default: one a"
            " processor[/]",
            show_default=False,
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER",
            help="Write the page there: memo738.html (all in one file), memo738.md with its"
            " drawings, and memo738.json.",
            show_default=False,
        ),
    ] = None,
) -> None:
    """Rerun the experiments of AI Memo 738, with its printed figures beside ours.

    The memo's objects are lost, so stand-ins take their place. A row is within the rule if our
    median is within a factor of four of the memo's and follows the noise as the memo's does; rows
    outside are marked, with the reason.

    table1: outlines in the plane. table2, 3, 4, 6, figure8: a grid of rays; what the tree leaves,
    what the model test leaves, how many transforms. table5: errors of the pose. table7, 8, 9:
    triads of rays. table10, 11: the tree level by level. range, bounds, timing: Sections 5, 6, 7.
    constraints: what each is worth.
    """
    wanted = _checked(experiments or [EVERYTHING])
    if out is not None and out.exists() and not out.is_dir():
        raise ValueError(f"{out} is a file: --out takes a folder")
    from ..one_thread import keep_to_one_thread

    keep_to_one_thread()
    # Only now: what these import reads the number of threads once.
    from rich.console import Console

    from ..memo.page import verdict, write_sections
    from ..memo.pool import open_plan, processors

    console = Console(highlight=False)
    sections: list[Section] = []
    with open_plan(trials, seed, workers or processors(), Console(stderr=True)) as plan:
        for names, run in groups().items():
            asked = [name for name in names if name in wanted]
            for section in run(plan, asked) if asked else ():
                show(section, console)
                sections.append(section)
    sections.sort(key=lambda section: ORDER.index(section.name))
    console.print(verdict(sections), soft_wrap=True)
    if out is not None:
        stem = write_sections(sections, command(experiments, trials, seed), out, trials)
        console.print(f"{stem}.html, .md and .json", soft_wrap=True)


def groups() -> dict[tuple[str, ...], Callable[[Plan, Sequence[str]], tuple[Section, ...]]]:
    """What runs the experiments; those of one group share their trials, so they run together."""
    from ..memo import constraints, grid, levels, planar, timing, triads
    from ..memo.bounds import bounds
    from ..memo.errors import errors
    from ..memo.range import range

    def alone(run: Experiment) -> Callable[[Plan, Sequence[str]], tuple[Section, ...]]:
        return lambda plan, _: (run(plan),)

    return {
        ("table1",): alone(planar.run),
        grid.NAMES: grid.sections,
        ("table5",): alone(errors.run),
        triads.NAMES: triads.sections,
        levels.NAMES: levels.sections,
        ("range",): alone(range.run),
        ("bounds",): alone(bounds.run),
        ("timing",): alone(timing.run),
        ("constraints",): alone(constraints.run),
    }


def show(section: Section, console: Console) -> None:
    """Print a section: every row with the memo's figures and ours, then what came out."""
    from rich.table import Table

    from ..memo.judge import figure
    from ..memo.page import outside

    console.print(f"\n[bold]{section.title}[/]", soft_wrap=True)
    table = Table(box=None, pad_edge=False)
    compared = any(row.memo is not None for row in section.comparisons)
    heads = ["memo", "ours", ""] if compared else ["ours"]
    table.add_column()
    for head in heads:
        table.add_column(head, no_wrap=True, justify="right")
    for row in section.comparisons:
        memo = "–" if row.memo is None else "/".join(map(figure, row.memo))
        ours = "/".join(map(figure, row.ours))
        shown = "outside" if row.verdict == "outside" else ""
        table.add_row(" ".join(row.key), *([memo, ours, shown] if compared else [ours]))
    names = max((row.names for row in section.comparisons), key=len, default=())
    if names:
        console.print(f"Figures are {' / '.join(names)}.")
    console.print(table)
    for line in [section.found, *outside(section)]:
        console.print(line, markup=False)
    if section.checked:
        console.print(
            f"The right interpretation was discarded in {section.lost:,} of {section.checked:,}"
            " trials."
        )


def command(experiments: Sequence[str] | None, trials: int | None, seed: int) -> str:
    """The command that makes the same page."""
    words = ["palpate", "reproduce", *(experiments or [EVERYTHING])]
    if trials is not None:
        words += ["--trials", f"{trials}"]
    return " ".join([*words, "--seed", f"{seed}", "--out", "FOLDER"])


def _checked(experiments: Sequence[str]) -> list[str]:
    """Names of experiments, each once, in the order of the page.

    Raises:
        ValueError: a name that there isn't.
    """
    for name in experiments:
        if name != EVERYTHING and name not in ORDER:
            known = ", ".join((*ORDER, EVERYTHING))
            raise ValueError(f"no experiment is called {name!r}; there are: {known}")
    if EVERYTHING in experiments:
        return list(ORDER)
    return [name for name in ORDER if name in experiments]
