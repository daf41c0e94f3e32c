"""How long a belief takes, where the time goes, and what the bit operations alone would take."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from time import perf_counter

import numpy as np

from ....assets import STAND_IN_NAMES
from ....envs.library import load_library
from ....recognizer import Belief, PairTables, Polyhedron, Recognizer
from ....recognizer.tree.tree import WORD, prune, spread_order
from ...memo.noise import noise_of
from ...timed import timed
from .report import Case, Row, Section, Settings, draw_cases, median_and_tail, steps

TOUCHES = 16
WARM_UP = 5
"""Cases that are run before the clock starts."""
COMPARISONS = 8
"""Of a pair of contacts against a pair of faces: distance, angle, and the component along either
normal, each against two ends of a range."""
FLOOR_CASES = 20
FLOOR_BUDGET = 200_000
"""The most interpretations that a case of the floor may have; cases with more count so many."""


@dataclass(frozen=True)
class SpeedGoal:
    """A library, bounds, and how fast a belief should be."""

    names: tuple[str, ...]
    pi_over: float
    """The bound on normals is pi over this, radians."""
    inches: float
    """The bound on positions."""
    median: float
    tail: float | None
    """The 99th percentile, as the median in milliseconds; None if there is no goal for it."""


GOALS = (
    SpeedGoal(("housing",), 10, 0.05, 1.0, 20.0),
    SpeedGoal(("complex-hand",), 10, 0.05, 2.0, 40.0),
    SpeedGoal(("stapler",), 8, 0.10, 20.0, 500.0),
    SpeedGoal(STAND_IN_NAMES, 10, 0.05, 3.0, None),
)


def stage_seconds(belief: Belief) -> dict[str, float]:
    """Where the time of a belief went, seconds by the clock."""
    return {
        "masks, tree and model test": sum(search.search_seconds for search in belief.searches),
        "clusters": sum(search.cluster_seconds for search in belief.searches),
    }


def measure_speed(settings: Settings) -> Section:
    """Contacts to belief: goals, shares of the stages, and the floor."""
    models = {model.name: model for model in load_library()}
    return Section(
        f"contacts to belief, {TOUCHES} grid contacts, median / 99th percentile",
        [_speed_row([models[name] for name in goal.names], goal, settings) for goal in GOALS],
        "Shares are of the time by the clock. Floor: a mask entry costs eight comparisons, for"
        " every face of a later contact, once for each face that an earlier one is tried on; an"
        " interpretation of k contacts costs one AND a word of faces for each contact left. Both"
        " are counted, and divided by the rates that numpy reaches here in the first cache,"
        f" {rates()[0] / 1e9:.1f} and {rates()[1] / 1e9:.1f} thousand million a second.",
    )


def _speed_row(library: Sequence[Polyhedron], goal: SpeedGoal, settings: Settings) -> Row:
    label = library[0].name if len(library) == 1 else f"{len(library)} objects"
    recognizer = Recognizer(library)
    noise = noise_of(goal.pi_over, goal.inches)
    cases = draw_cases(library, noise, (TOUCHES, TOUCHES), settings)
    for case in cases[:WARM_UP]:
        recognizer.recognize(case.contacts)
    seconds, beliefs, by_the_clock = [], [], 0.0
    for case in steps(cases, f"speed: {label}"):
        started = perf_counter()
        belief, spent = timed(recognizer.recognize, case.contacts)
        by_the_clock += perf_counter() - started
        seconds.append(spent)
        beliefs.append(belief)
    median, tail = median_and_tail(seconds)
    details = [shares(beliefs, by_the_clock)]
    cut_short = sum(not belief.complete for belief in beliefs)
    if cut_short:
        details.append(f"cut short: {cut_short} of {len(cases)}")
    tables = [recognizer.tables(model.name) for model in library]
    details.append(_floor(tables, cases, beliefs, median))
    return Row(
        f"{label}, π/{goal.pi_over}, {goal.inches:.2f} in",
        f"{median:.2f} / {tail:.1f} ms",
        f"{goal.median:g} ms" if goal.tail is None else f"{goal.median:g} / {goal.tail:g} ms",
        median <= goal.median and (goal.tail is None or tail <= goal.tail),
        details,
    )


def shares(beliefs: Sequence[Belief], by_the_clock: float) -> str:
    """Which share of the time each stage took.

    Args:
        beliefs: what was asked for.
        by_the_clock: seconds of all of them together; stages are timed by the clock too.
    """
    stages = [stage_seconds(belief) for belief in beliefs]
    taken = {name: sum(stage[name] for stage in stages) / by_the_clock for name in stages[0]}
    taken["rest"] = 1.0 - sum(taken.values())
    return "of it: " + ", ".join(f"{name} {share:.0%}" for name, share in taken.items())


def _floor(
    tables: Sequence[PairTables], cases: Sequence[Case], beliefs: Sequence[Belief], median: float
) -> str:
    comparisons, words, seconds = [], [], []
    for case, belief in zip(cases[:FLOOR_CASES], beliefs, strict=False):
        contacts = case.contacts[spread_order(case.contacts)]
        compared, anded, spent = 0, 0, 0.0
        for table, search in zip(tables, belief.searches, strict=True):
            if not search.nodes:
                continue
            pruned, own = timed(prune, table, contacts, sort=False, budget=FLOOR_BUDGET)
            counts = operations(table.face_count, pruned.nodes)
            compared, anded, spent = compared + counts[0], anded + counts[1], spent + own
        comparisons.append(compared)
        words.append(anded)
        seconds.append(spent)
    compared, anded = float(np.median(comparisons)), float(np.median(words))
    comparison_rate, word_rate = rates()
    floor = 1e3 * (compared / comparison_rate + anded / word_rate)
    return (
        f"floor {floor:.2f} ms ({compared / 1e6:.1f} M comparisons, {anded / 1e3:.1f} k words), a"
        f" belief {median / floor:.1f} times that; `prune` alone {1e3 * np.median(seconds):.2f} ms"
    )


def operations(faces: int, nodes: np.ndarray) -> tuple[int, int]:
    """Comparisons that the masks take, and words that the tree ANDs.

    A mask is a row of faces for a face of one contact and for another, later contact. Rows that no
    interpretation asks for are not counted, and no row is counted twice.

    Args:
        faces: faces of the model.
        nodes: (n,) interpretations of the first contact, the first two, and so on.
    """
    left = np.arange(len(nodes))[::-1]
    rows = int((np.minimum(nodes, faces) * left).sum())
    return COMPARISONS * faces * rows, int((nodes * left).sum()) * -(-faces // WORD)


@cache
def rates() -> tuple[float, float]:
    """Comparisons of doubles, and ANDs of words, that numpy does here a second."""
    rng = np.random.default_rng(0)
    size, rounds = 2048, 500
    numbers, words = rng.random((2, size)), rng.integers(2**63, size=(2, size))
    verdicts, both = np.empty(size, bool), np.empty_like(words[0])

    def compare() -> None:
        for _ in range(rounds):
            np.less_equal(numbers[0], numbers[1], out=verdicts)

    def intersect() -> None:
        for _ in range(rounds):
            np.bitwise_and(words[0], words[1], out=both)

    best = [min(timed(call)[1] for _ in range(20)) for call in (compare, intersect)]
    return rounds * size / best[0], rounds * size / best[1]
