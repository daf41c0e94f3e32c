"""Try to lose the truth: `make soundness`, or `python -m palpate.scripts.lab.soundness`.

First random cases, see `soundness_cases`: in each the true interpretation is to be among those of
some hypothesis, and every pose that is called proven is to meet every bound, as `soundness_check`
finds without palpate's own geometry. Then whole episodes of every sensor and placement, see
`soundness_episodes`: the true pose is to be in every belief.
"""

from __future__ import annotations

import argparse
import os
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, TypeVar

from ...one_thread import keep_to_one_thread

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

    from .check import Outcome
    from .episodes import Episode

T = TypeVar("T")

COMMAND = "python -m palpate.scripts.lab.soundness"
STOPPED = 130
"""What a run returns that was told to stop, as shells have it."""
MOST_SHOWN = 4
"""Broken bounds that are told of one case."""


def run_case(kind: str, seed: int, index: int) -> Outcome:
    """Draw and judge a case; one that raises counts as lost, and says so."""
    from .cases import draw_case
    from .check import judge, raised

    case = draw_case(kind, seed, index)
    try:
        return judge(case)
    except Exception as error:
        return raised(case, error)


def run_episode(setting: str, seed: int, index: int, probes: int | None) -> Episode:
    """Play and judge an episode; one that raises counts as failed, and says so."""
    from .episodes import play, raised

    try:
        return play(setting, seed, index, probes)
    except Exception as error:
        return raised(f"{setting}:{index}", error)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the campaign and print its tables; 1 if a truth was lost or a pose broke a bound."""
    keep_to_one_thread()
    # Only now: what these import reads the number of threads once.
    from rich.console import Console

    from .cases import KINDS
    from .episodes import PLACEMENTS, SENSORS, settings

    parser = _parser(
        {name: kind.what for name, kind in KINDS.items()}, list(SENSORS), list(PLACEMENTS)
    )
    options = parser.parse_args(arguments)
    options.settings = settings(options.sensor, options.placement)
    if not options.settings:
        parser.error("rays in the plane have no placement: leave it out, or name another sensor")
    console = Console(highlight=False, soft_wrap=True)
    if options.only:
        return _only(console, options)
    failed = False
    try:
        with _told_to_stop():
            if options.cases:
                failed |= _cases(console, options, tuple(options.kinds or KINDS))
            if options.episodes:
                failed |= _episodes(console, options)
    except KeyboardInterrupt:
        console.print("stopped before the end")
        return STOPPED
    return int(failed)


@contextmanager
def _told_to_stop() -> Iterator[None]:
    """Take a request to terminate as Ctrl-C is taken, so that what was found is still told."""

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGTERM, interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def _cases(console: Console, options: argparse.Namespace, kinds: tuple[str, ...]) -> bool:
    from .cases import draw_kind

    jobs = [
        (draw_kind(options.seed, index, kinds), options.seed, index)
        for index in range(options.cases)
    ]
    with console.status("compiling kernels, if any are new"):
        for kind in kinds:
            run_case(kind, 0, 0)
    outcomes = list(_spread(run_case, jobs, "cases", console, options.workers))
    outcomes.sort(key=lambda outcome: int(outcome.name.partition(":")[2]))
    console.print(
        f"\n{len(outcomes)} random cases, seed {options.seed}. lost: the true interpretation is in"
        " no hypothesis.\ncut short: a limit ended the search, so that the truth may be missing"
        " (held: it is not).\nundecided: hypotheses not called proven; bad: cases in which a proven"
        " pose breaks a bound.\n"
    )
    console.print(_table("kind", outcomes, lambda outcome: outcome.kind))
    console.print(_table("object", outcomes, lambda outcome: outcome.object_name))
    failures = [outcome for outcome in outcomes if outcome.lost or outcome.bad]
    for outcome in failures:
        _tell(console, outcome, options.seed)
    return bool(failures)


def _episodes(console: Console, options: argparse.Namespace) -> bool:
    from .episodes import head_line, line, tell

    console.print(
        "\nEpisodes with random probes, at 0.01 in and pi/10 (planar: 0.1 in and pi/8); half of"
        "\nthem with Gaussian noise, half told of free space. truth kept: in every belief, after"
        "\nevery probe. cut short: a limit ended a search, so that the truth may be missing there."
        "\nwrong: ended with one hypothesis, and not the truth; off: by how much at most such a"
        "\npose is, in pose tolerances; s: mean seconds an episode.\n"
    )
    console.print(head_line())
    failed = False
    for setting in options.settings:
        jobs = [(setting, options.seed, k, options.probes) for k in range(options.episodes)]
        outcomes = []
        try:
            for outcome in _spread(run_episode, jobs, setting, console, options.workers):
                outcomes.append(outcome)
        finally:
            # Here, so that a run that is stopped says what it had.
            if outcomes:
                console.print(line(setting, outcomes))
            for bad in sorted((o for o in outcomes if o.failed), key=lambda o: o.index):
                failed = True
                console.print(f"{_command(bad.name, options)}\n    {tell(bad)}", markup=False)
    return failed


def _command(name: str, options: argparse.Namespace) -> str:
    """The command that runs one case or episode alone."""
    probes = f" --probes {options.probes}" if options.probes else ""
    return f"{COMMAND} --seed {options.seed}{probes} --only {name}"


def _only(console: Console, options: argparse.Namespace) -> int:
    from .cases import KINDS, draw_case
    from .check import judge
    from .episodes import SETTINGS, play, tell

    name, seed = options.only, options.seed
    kind, _, index = name.partition(":")
    if kind not in (*KINDS, *SETTINGS) or not index.isdecimal():
        known = ", ".join((*KINDS, *SETTINGS))
        console.print(f"{name!r} names no case: say KIND:INDEX, of the kinds {known}")
        return 2
    if kind in SETTINGS:
        episode = play(kind, seed, int(index), options.probes)
        console.print(f"{_command(name, options)}\n    {tell(episode)}", markup=False)
        return int(episode.failed)
    outcome = judge(draw_case(kind, seed, int(index)))
    _tell(console, outcome, seed)
    return int(outcome.lost or bool(outcome.bad))


def _tell(console: Console, outcome: Outcome, seed: int) -> None:
    verdict = "held" if outcome.held else "LOST" if outcome.lost else "missing, but cut short"
    if outcome.bad:
        verdict += ", BAD WITNESS"
    console.print(
        f"{verdict}: {COMMAND} --seed {seed} --only {outcome.name}\n"
        f"    {outcome.object_name}, {outcome.contacts} contacts, {outcome.hypotheses} hypotheses,"
        f" {outcome.undecided} of them undecided, {outcome.milliseconds:.0f} ms"
    )
    for line in outcome.bad[:MOST_SHOWN]:
        console.print(f"    {line}", markup=False)


def _table(title: str, outcomes: Sequence[Outcome], key: Callable[[Outcome], str]) -> Table:
    import numpy as np
    from rich.table import Table

    heads = ("cases", "lost", "cut short", "held", "hypotheses", "undecided", "bad", "ms", "99 %")
    table = Table(title, *heads, box=None)
    for column in table.columns[1:]:
        column.justify = "right"
    groups = sorted({key(outcome) for outcome in outcomes})
    for group in (*groups, "all"):
        own = [outcome for outcome in outcomes if group in ("all", key(outcome))]
        short = [outcome for outcome in own if not outcome.complete]
        median, tail = np.percentile([outcome.milliseconds for outcome in own], (50, 99))
        table.add_row(
            group,
            str(len(own)),
            str(sum(outcome.lost for outcome in own)),
            str(len(short)),
            str(sum(outcome.held for outcome in short)),
            str(sum(outcome.hypotheses for outcome in own)),
            str(sum(outcome.undecided for outcome in own)),
            str(sum(bool(outcome.bad) for outcome in own)),
            f"{median:.1f}",
            f"{tail:.0f}",
        )
    return table


def _spread(
    call: Callable[..., T],
    jobs: Sequence[tuple[Any, ...]],
    what: str,
    console: Console,
    workers: int,
) -> Iterator[T]:
    """What the jobs return, in the order they end, under a progress bar that says how long yet."""
    from rich.progress import track

    bar = {"total": len(jobs), "description": what, "console": console}
    if workers == 1:
        yield from track((call(*job) for job in jobs), **bar)
        return
    with ProcessPoolExecutor(workers) as pool:
        running = [pool.submit(call, *job) for job in jobs]
        try:
            for job in track(as_completed(running), **bar):
                yield job.result()
        finally:
            # Whoever stops listening doesn't wait for what hasn't begun.
            pool.shutdown(wait=False, cancel_futures=True)


def _parser(
    kinds: dict[str, str], sensors: list[str], placements: list[str]
) -> argparse.ArgumentParser:
    listed = "\n".join(f"  {name:<14}{what}" for name, what in kinds.items())
    parser = argparse.ArgumentParser(
        prog=COMMAND,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        description="Touch known objects at known poses, with noise inside its bounds and on them,"
        "\nand look for a truth that is lost or for a proven pose that breaks a bound."
        "\nExits with 1 if there is one.",
        epilog=f"kinds of case:\n{listed}\n\n"
        "A case is fixed by seed, kind and index, and an episode by seed, sensor, placement and\n"
        "index, whatever else runs and on however many workers. Each that fails is printed as the\n"
        "command that runs it alone, such as:\n"
        f"  {COMMAND} --seed 0 --only free:17\n"
        f"  {COMMAND} --seed 0 --only ball/resting:17",
    )
    add = parser.add_argument
    add("--cases", metavar="N", type=_count, default=20_000, help="random cases (20000)")
    add(
        "--episodes",
        metavar="N",
        type=_count,
        default=100,
        help="episodes of each sensor and placement (100)",
    )
    add("--seed", metavar="S", type=_count, default=0, help="seed of all (0)")
    add(
        "--workers",
        metavar="N",
        type=_one_or_more,
        default=os.cpu_count() or 1,
        help="processes (as many as there are processors)",
    )
    add("--kinds", metavar="KIND", nargs="+", choices=list(kinds), help="only these kinds (all)")
    add(
        "--sensor",
        nargs="+",
        choices=sensors,
        metavar="NAME",
        help=f"episodes of only these sensors, of {', '.join(sensors)} (all)",
    )
    add(
        "--placement",
        nargs="+",
        choices=placements,
        metavar="NAME",
        help=f"episodes of only these placements, of {', '.join(placements)} (all)",
    )
    add("--probes", metavar="N", type=_one_or_more, help="most probes an episode (by sensor)")
    add("--only", metavar="KIND:INDEX", help="one case or episode alone, told in full")
    return parser


def _count(text: str) -> int:
    value = int(text)
    if value < 0:
        raise argparse.ArgumentTypeError(f"{value} is below zero")
    return value


def _one_or_more(text: str) -> int:
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"{value} is below one")
    return value


if __name__ == "__main__":
    sys.exit(main())
