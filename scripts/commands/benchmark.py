"""`palpate benchmark`: strategies against each other, all on the same episodes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

__all__ = ["benchmark"]

MEMO_NOISE = ("pi/10,0.01in", "pi/10,0.05in", "pi/8,0.05in")
"""Rows of the memo's tables; the last is its worst."""


def benchmark(
    out: Annotated[
        Path,
        typer.Option(
            metavar="FOLDER",
            help="Where the rows go. One that was begun is gone on with.",
            show_default=False,
        ),
    ],
    policies: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAMES",
            help="Strategies, with commas between; module:Class is one of your own."
            " [dim]default: all that come with palpate[/]",
            show_default=False,
        ),
    ] = None,
    objects: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAMES",
            help="What is touched, with commas between: an object, a folder of meshes, or library,"
            " which is any of the objects, not known which. [dim]default: each object, and the"
            " library[/]",
            show_default=False,
        ),
    ] = None,
    sensor: Annotated[
        str, typer.Option(metavar="NAME", help="What touches, as in palpate episode.")
    ] = "ray",
    noise: Annotated[
        list[str] | None,
        typer.Option(
            metavar="BOUNDS",
            help="Bounds on normals and positions, with units (pi/N, deg, rad; in, mm, um, m), as"
            " in pi/8,0.05in or 22.5deg,1.27mm. May be given more than once. [dim]default: "
            + "  ".join(MEMO_NOISE)
            + "[/]",
            show_default=False,
        ),
    ] = None,
    episodes: Annotated[
        int, typer.Option(metavar="N", min=1, help="Episodes a strategy, object and noise.")
    ] = 200,
    placement: Annotated[
        str, typer.Option(metavar="HOW", help="How objects lie, as in palpate episode.")
    ] = "across",
    goal: Annotated[
        str,
        typer.Option(
            metavar="WHAT", help="What is to be found out: the object, its pose, or both."
        ),
    ] = "both",
    max_probes: Annotated[
        int, typer.Option(metavar="N", min=1, help="Give an episode up after this many.")
    ] = 40,
    seed: Annotated[
        int, typer.Option(metavar="N", min=0, help="Of the first episode; the others' follow.")
    ] = 0,
    workers: Annotated[
        int, typer.Option(metavar="N", min=1, help="Episodes at a time; rows don't depend on it.")
    ] = 1,
    backend: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help="Who plays: joblib, processes of this machine; or ray, a cluster: that of"
            " RAY_ADDRESS if it is set, else one started here.",
        ),
    ] = "joblib",
) -> None:
    """Play every strategy on the same episodes, and keep a row of each in a Parquet file.

    It may be stopped or killed at any moment: the same command goes on where it was. Then
    `palpate report FOLDER` makes a page of it.
    """
    from ..one_thread import keep_to_one_thread

    keep_to_one_thread()
    # Only now: what these import reads the number of threads once.
    from rich.console import Console

    from ...assets import STAND_IN_NAMES
    from ...policies import POLICY_NAMES
    from ..benchmark.config import ALL_OBJECTS, BenchmarkConfig
    from ..benchmark.run import check, run_benchmark
    from ..benchmark.workers import look_in, player

    here = str(Path.cwd())
    look_in(here)
    config = BenchmarkConfig(
        policies=_listed(policies) or POLICY_NAMES,
        objects=_listed(objects) or (*STAND_IN_NAMES, ALL_OBJECTS),
        noise=tuple(noise or MEMO_NOISE),
        sensor=sensor,
        placement=placement,
        goal=goal,
        episodes=episodes,
        seed=seed,
        max_probes=max_probes,
    )
    check(config)
    console = Console(highlight=False, soft_wrap=True)
    run_benchmark(config, out, player(here), workers=workers, backend=backend, console=console)
    console.print(f"{len(config)} episodes are in {out}; next: palpate report {out}")


def _listed(given: Sequence[str] | None) -> tuple[str, ...]:
    return tuple(word.strip() for text in given or () for word in text.split(",") if word.strip())
