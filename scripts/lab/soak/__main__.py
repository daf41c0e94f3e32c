"""Soak the environments: `python -m palpate.scripts.lab.soak`.

Ten thousand steps in each, of random actions, extreme ones and ones that are none. Nothing may
raise that should not, nothing may be NaN or outside its space, memory may not grow, and no ray,
ball or finger may go through the object, as plain geometry judges.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from ...one_thread import keep_to_one_thread

if TYPE_CHECKING:
    from rich.table import Table

    from .run import Soaked

COMMAND = "python -m palpate.scripts.lab.soak"
WARM_UP = 20
"""Steps before which memory grows anyhow: code is loaded when it is first needed."""
MOST_GROWTH = 32e6
"""Of memory, bytes: what a heap takes to settle. Three kilobytes kept a step would be as much."""
SLOW = 1.0
"""Seconds."""
MOST_SHOWN = 4
"""Failures of a kind that are told of one environment."""


def soak(
    steps: Annotated[int, typer.Option(metavar="N", min=1, help="Steps in each.")] = 10_000,
    env: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help="Only this one; one or more of: probe, rest, finger, planar (as they come, the"
            " default), ball, ball-dropped, ball-free-space, gaussian, range, range-grid,"
            " rest-dropped, finger-resting, finger-dropped, finger-free-space.",
        ),
    ] = None,
    seed: Annotated[int, typer.Option(metavar="N", min=0, help="Of the first episode.")] = 0,
    cut_short: Annotated[
        bool, typer.Option("--cut-short", help="Have the recogniser give up at once.")
    ] = False,
) -> None:
    """Send random and extreme actions to environments; exits with 1 if anything went wrong.

    Episode k of an environment is reset with seed + k; a failure is told with its episode's seed.
    Ctrl-C ends one environment's run early, and counts what it has found so far.
    """
    keep_to_one_thread()
    # Only now: what these import reads the number of threads once.
    from rich.console import Console

    from ..bench.report import steps as shown
    from .cases import MAIN, SETTINGS
    from .run import Soak

    for name in env or ():
        if name not in SETTINGS:
            raise typer.BadParameter(f"{name!r} is none of: {', '.join(SETTINGS)}")
    console = Console(highlight=False, soft_wrap=True)
    found: dict[str, Soaked] = {}
    for name in env or MAIN:
        made = SETTINGS[name].make(cut_short=cut_short)
        found[name] = Soak(made, seed).run(shown(range(steps), name))
        made.close()
        if found[name].interrupted:
            console.print(f"{name}: interrupted after {found[name].steps} steps")
        for line in failures(name, found[name]):
            console.print(line, markup=False)
    console.print(soak_table(found))
    console.print(
        "\nrefused: actions that are none. beyond: how far a way went beyond the first touch, at"
        " the farthest; positions are noisy.\ntip: how deep a finger's tip was in anything."
        f" memory: when warm, and its growth to the end. Times are the processor's; slow: over"
        f" {SLOW:g} s."
    )
    raise typer.Exit(int(any(failures(name, soaked) for name, soaked in found.items())))


def failures(name: str, soaked: Soaked) -> list[str]:
    """What went wrong, in words; empty if nothing did."""
    told = []
    for what, lines in (
        ("raised", soaked.raised),
        ("no action, but not refused", soaked.taken),
        ("went through the object", soaked.passed),
    ):
        told += [f"{name}: {what}: {line}" for line in lines[:MOST_SHOWN]]
    for what, count in (
        ("not finite", soaked.not_numbers),
        ("observations outside their space", soaked.outside),
    ):
        told += [f"{name}: {count} {what}"] if count else []
    if soaked.steps >= WARM_UP and soaked.growth > MOST_GROWTH:
        told.append(f"{name}: memory grew by {soaked.growth / 1e6:.0f} MB")
    return told


def soak_table(found: dict[str, Soaked]) -> Table:
    """A column an environment."""
    from rich.table import Table

    table = Table("", *found, box=None)
    for column in table.columns[1:]:
        column.justify = "right"
    columns = [_figures(soaked) for soaked in found.values()]
    for what in columns[0]:
        table.add_row(what, *(column[what] for column in columns))
    return table


def _figures(soaked: Soaked) -> dict[str, str]:
    import numpy as np

    seconds = np.array(soaked.seconds or [np.nan])
    median, tail = 1e3 * np.percentile(seconds, (50, 99))
    deepest = "" if soaked.tip_depth is None else f"{1e6 * soaked.tip_depth:.1f}"
    return {
        "steps": str(soaked.steps),
        "episodes": str(soaked.episodes),
        "exceptions": str(len(soaked.raised)),
        "no actions, refused": str(soaked.refused),
        "no actions, let in": str(len(soaked.taken)),
        "not finite": str(soaked.not_numbers),
        "outside their space": str(soaked.outside),
        "ways held against the object": str(soaked.ways),
        "that went through it": str(len(soaked.passed)),
        "farthest beyond first touch, mm": f"{1e3 * soaked.beyond:.3f}",
        "deepest tip, µm": deepest,
        "memory when warm, MB": f"{soaked.warm_memory / 1e6:.0f}",
        "growth to the end, MB": f"{soaked.growth / 1e6:+.1f}",
        "median step, ms": f"{median:.2f}",
        "99 % of steps, ms": f"{tail:.0f}",
        "slowest step, s": f"{seconds.max():.2f}",
        f"steps over {SLOW:g} s": str(int((seconds > SLOW).sum())),
        "steps a second": f"{len(seconds) / seconds.sum():.1f}",
    }


if __name__ == "__main__":
    app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
    app.command()(soak)
    app()
