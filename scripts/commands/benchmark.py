"""`palpate benchmark`: strategies against each other, all on the same episodes."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from rich.console import Console

    from ..benchmark.config import BenchmarkConfig
    from ..benchmark.store import RowStore
    from ..benchmark.workers import Play

__all__ = ["benchmark", "run_benchmark"]

MEMO_NOISE = ("pi/10,0.01in", "pi/10,0.05in", "pi/8,0.05in")
"""Rows of the memo's tables; the last is its worst."""
REDRAWN_EVERY = 0.5
"""Seconds between two drawings of the progress bar, so that no decision is timed during one."""
SETTINGS_FILE = "config.json"


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


def check(config: BenchmarkConfig) -> None:
    """Refuse what would only fail once it is played.

    Raises:
        ValueError: objects, bounds, a sensor, a placement or a strategy that won't do.
    """
    from ...policies import make_policy
    from ..benchmark.playing import task_of
    from ..benchmark.workers import environment

    settings = config.settings
    for setting in settings:
        if setting.noise == settings[0].noise or setting.objects == settings[0].objects:
            environment(setting)
    task = task_of(environment(settings[0]), settings[0].goal)
    for name in config.policies:
        make_policy(name, task)


def run_benchmark(
    config: BenchmarkConfig,
    folder: Path,
    play: Play,
    *,
    workers: int = 1,
    backend: str = "joblib",
    console: Console | None = None,
) -> None:
    """Play what a folder lacks of a benchmark's episodes.

    Args:
        config: the benchmark.
        folder: where its rows are, or will be.
        play: what plays an episode.
        workers: how many at a time.
        backend: see `benchmark_workers`.
        console: where to draw a progress bar; none, and nothing is drawn.

    Raises:
        ValueError: the folder holds another benchmark, or another process writes to it; a package
            is missing.
    """
    from ..benchmark.store import RowStore, only_writer
    from ..benchmark.workers import play_all

    store = RowStore(folder)
    with only_writer(folder):
        _settle(config, folder)
        store.clear_leftovers()
        done = {row.number for row in store.rows()}
        missing = [job for job in config.jobs() if job.number not in done]
        rows = play_all(play, missing, workers=workers, backend=backend)
        for row in _under_a_bar(rows, store, len(done), len(config), console):
            store.add(row)
        store.gather()


def _under_a_bar(
    rows: Iterator, store: RowStore, done: int, total: int, console: Console | None
) -> Iterator:
    """Pass rows on; each counts once it has been kept."""
    from rich.console import Console
    from rich.progress import Progress

    from ..progress_bar import columns

    console = console or Console(quiet=True)
    with Progress(
        *columns(), console=console, auto_refresh=False, disable=not console.is_terminal
    ) as bar:
        task = bar.add_task("episodes", total=total, completed=done)
        bar.refresh()
        drawn = perf_counter()
        for row in rows:
            yield row
            bar.advance(task)
            if perf_counter() - drawn > REDRAWN_EVERY:
                bar.refresh()
                drawn = perf_counter()
        bar.refresh()


def _settle(config: BenchmarkConfig, folder: Path) -> None:
    """Write down what the folder holds; if it already says, hold it to that.

    Raises:
        ValueError: it is another benchmark's.
    """
    from ..benchmark.config import versions
    from ..whole_file import write_whole

    path = folder / SETTINGS_FILE
    wanted = json.loads(json.dumps(asdict(config) | {"versions": json.loads(versions())}))
    if not path.exists():
        text = json.dumps(wanted | {"command": config.command(folder)}, indent=1)
        write_whole(path, (text + "\n").encode())
        return
    begun = read_settings(folder)
    for name, value in wanted.items():
        if begun.get(name) != value:
            raise ValueError(
                f"{folder} holds a benchmark whose {name} {_verb(name)} {_said(begun.get(name))},"
                f" not {_said(value)}: go on with that, or give another --out"
            )


def read_settings(folder: Path) -> dict[str, object]:
    """What a benchmark's folder says it holds.

    Raises:
        ValueError: it isn't one.
    """
    path = folder / SETTINGS_FILE
    if not path.is_file():
        raise ValueError(f"{folder}: not the folder of a benchmark, it has no {SETTINGS_FILE}")
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except ValueError as wrong:
        raise ValueError(f"{path}: not JSON ({wrong})") from wrong


def _said(value: object) -> str:
    if isinstance(value, dict):
        return ", ".join(f"{key} {each}" for key, each in value.items())
    return " ".join(map(str, value)) if isinstance(value, list) else str(value)


def _verb(name: str) -> str:
    return "are" if name.endswith("s") else "is"


def _listed(given: Sequence[str] | None) -> tuple[str, ...]:
    return tuple(word.strip() for text in given or () for word in text.split(",") if word.strip())
