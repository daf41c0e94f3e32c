"""Try to lose the truth: `make soundness`, or `python -m palpate.scripts.soundness`.

First random cases, see `soundness_cases`: in each the true interpretation is to be among those of
some hypothesis, and every pose that is called proven is to meet every bound, as `soundness_check`
finds without palpate's own geometry. Then whole episodes, see `soundness_episodes`.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from typing import TYPE_CHECKING, Any, TypeVar

from .bench import keep_to_one_thread

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

    from .soundness_check import Outcome

T = TypeVar("T")

COMMAND = "python -m palpate.scripts.soundness"
MOST_SHOWN = 4
"""Broken bounds that are told of one case."""


def run_case(kind: str, seed: int, index: int) -> Outcome:
    """Draw and judge a case; one that raises counts as lost, and says so."""
    from .soundness_cases import draw_case
    from .soundness_check import judge, raised

    case = draw_case(kind, seed, index)
    try:
        return judge(case)
    except Exception as error:
        return raised(case, error)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the campaign and print its tables; 1 if a truth was lost or a pose broke a bound."""
    keep_to_one_thread()
    # Only now: what these import reads the number of threads once.
    from rich.console import Console

    from .soundness_cases import KINDS

    options = _parser({name: kind.what for name, kind in KINDS.items()}).parse_args(arguments)
    console = Console(highlight=False, soft_wrap=True)
    if options.only:
        return _only(console, options.only, options.seed)
    failed = False
    if options.cases:
        failed |= _cases(console, options, tuple(options.kinds or KINDS))
    if options.episodes:
        failed |= _episodes(console, options)
    return int(failed)


def _cases(console: Console, options: argparse.Namespace, kinds: tuple[str, ...]) -> bool:
    from .soundness_cases import draw_kind

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
    from ..assets import STAND_IN_NAMES
    from .soundness_episodes import episode_table, play

    jobs = [(name, seed) for name in STAND_IN_NAMES for seed in range(options.episodes)]
    outcomes = list(_spread(play, jobs, "episodes", console, options.workers))
    outcomes.sort(key=lambda o: (STAND_IN_NAMES.index(o.object_name), o.seed))
    console.print(
        "\nEpisodes with random probes, at 0.01 in and pi/10, at most 40 probes.\n"
        "wrong: ended with one hypothesis, and not the truth; s: mean seconds an episode.\n"
    )
    console.print(episode_table(outcomes))
    lost = [outcome for outcome in outcomes if not outcome.kept]
    for outcome in lost:
        console.print(f"lost: palpate episode --object {outcome.object_name} --seed {outcome.seed}")
    return bool(lost)


def _only(console: Console, name: str, seed: int) -> int:
    from .soundness_cases import KINDS, draw_case
    from .soundness_check import judge

    kind, _, index = name.partition(":")
    if kind not in KINDS or not index.isdecimal():
        console.print(f"{name!r} names no case: say KIND:INDEX, of the kinds {', '.join(KINDS)}")
        return 2
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
        for job in track(as_completed(running), **bar):
            yield job.result()


def _parser(kinds: dict[str, str]) -> argparse.ArgumentParser:
    listed = "\n".join(f"  {name:<14}{what}" for name, what in kinds.items())
    parser = argparse.ArgumentParser(
        prog=COMMAND,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        description="Touch known objects at known poses, with noise inside its bounds and on them,"
        "\nand look for a truth that is lost or for a proven pose that breaks a bound."
        "\nExits with 1 if there is one.",
        epilog=f"kinds of case:\n{listed}\n\n"
        "A case is fixed by seed, kind and index, whatever else runs and on however many\n"
        "workers. Each that fails is printed as the command that runs it alone, such as:\n"
        f"  {COMMAND} --seed 0 --only free:17",
    )
    add = parser.add_argument
    add("--cases", metavar="N", type=_count, default=20_000, help="random cases (20000)")
    add("--episodes", metavar="N", type=_count, default=100, help="episodes an object (100)")
    add("--seed", metavar="S", type=_count, default=0, help="seed of the cases (0)")
    add(
        "--workers",
        metavar="N",
        type=_one_or_more,
        default=os.cpu_count() or 1,
        help="processes (as many as there are processors)",
    )
    add("--kinds", metavar="KIND", nargs="+", choices=list(kinds), help="only these kinds (all)")
    add("--only", metavar="KIND:INDEX", help="one case alone, told in full; no episodes")
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
