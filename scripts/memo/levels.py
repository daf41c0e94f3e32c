"""Tables X and XI: the tree level by level, in random order and sorted (memo, Section 4.5)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ...assets import memo
from ..report.markdown import Table
from .judge import COUNTS, Row, figures, four, judge
from .plan import Plan, Trials, run_rows
from .section import Comparison, Figure, Section
from .trial import Spec, prepared

if TYPE_CHECKING:
    from ...recognizer import Contacts, PairTables

NAMES = ("table10", "table11")
TRIALS = 100
"""As many as the memo ran."""
CONTACTS = 15
"""The last level that the memo prints."""
SPEC = Spec("stapler", 10, 0.01)
"""The memo names neither object nor noise: this is the row of its own Table II whose least, median,
90th percentile and most are nearest to those at the last level of Tables X and XI."""
ORDERS = ("random", "pairs", "nearest")
MOST = 1_000_000
"""The most interpretations of a level that are counted."""
WHY_SPEC = (
    "The memo names neither object nor noise; of the rows of its Table II the stapler's at π/10 and"
    " 0.01 in (2 / 14 / 68 / 276) is nearest to the last level of Tables X and XI (2 / 20 / 80 /"
    " 304 and 2 / 12 / 48 / 288), so that is what is run here."
)


@dataclass(frozen=True)
class LevelCounts:
    """Interpretations at each level of one trial's tree, for each of `ORDERS`."""

    by_order: tuple[tuple[int, ...], ...]
    kept: bool
    """Whether the right one is among the last level's."""


def sections(plan: Plan, names: Sequence[str]) -> tuple[Section, ...]:
    """Run both orders, whichever of `NAMES` are asked for: they share their contacts."""
    trials = plan.trials or TRIALS
    pieces = run_rows(plan, [SPEC], trials, run_piece, "levels of the tree")
    found = [*chain.from_iterable(pieces[SPEC])]
    levels = {
        order: np.array([trial.by_order[at] for trial in found]) for at, order in enumerate(ORDERS)
    }
    make = {"table10": _table10, "table11": _table11}
    lost = sum(not trial.kept for trial in found)
    return tuple(make[name](levels, len(found), lost) for name in names)


def run_piece(piece: Trials[Spec]) -> list[LevelCounts]:
    """Some trials."""
    from ...envs.sensors.grid import sense_grid
    from ...recognizer.tree.tree import far_apart_order

    spec = piece.row
    thing = prepared(spec.object_name)
    counts = []
    for rng in piece.generators():
        truth = sense_grid(thing.model, rng, CONTACTS, CONTACTS)
        contacts = truth.noisy(spec.noise(), rng)
        orders = {
            "random": rng.permutation(CONTACTS),
            "pairs": by_pairs(contacts.positions),
            "nearest": far_apart_order(contacts.positions),
        }
        by_order, kept = [], True
        for name in ORDERS:
            order = orders[name]
            alive, last = _grown(thing.tables, contacts[order])
            kept &= bool((last == truth.faces[order]).all(axis=1).any())
            by_order.append(alive)
        counts.append(LevelCounts(tuple(by_order), kept))
    return counts


def by_pairs(positions: NDArray[np.float64]) -> NDArray[np.intp]:
    """Points in the order in which they turn up among pairs, the farthest apart first.

    Args:
        positions: (n, 3) metres.

    Returns:
        (n,) row indices.
    """
    i, j = np.triu_indices(len(positions), 1)
    apart = np.linalg.norm(positions[i] - positions[j], axis=1)
    order = np.argsort(-apart, kind="stable")
    seen = dict.fromkeys(np.column_stack([i[order], j[order]]).ravel().tolist())
    return np.array([*seen], np.intp)


def _grown(tables: PairTables, contacts: Contacts) -> tuple[tuple[int, ...], NDArray[np.int32]]:
    """Interpretations at each level, and those of the last.

    Level by level: the search that palpate runs looks ahead at contacts still to come, and so has
    fewer at each level than the memo's, which are counted here.
    """
    from ...recognizer.tree.tree import Constraints, InterpretationTree, root

    tree = InterpretationTree(tables, contacts, Constraints())
    faces, alive = root(), []
    for level in range(1, len(contacts) + 1):
        faces, complete = tree.extend(faces, level, MOST)
        if not complete:
            raise RuntimeError(f"more than {MOST} interpretations at level {level}: cut short")
        alive.append(len(faces))
    return tuple(alive), faces


def _table10(levels: Mapping[str, NDArray[np.int64]], checked: int, lost: int) -> Section:
    rows = _rows(memo.table10(), levels["random"])
    comparisons = judge(rows, _why, _why_order)
    ratios = [row.ratio for row in rows]
    peak = max(rows, key=lambda row: row.ours[1])
    return Section(
        name="table10",
        title="Table X: level by level, contacts in random order",
        place="Section 4.5, Table X",
        asked=(
            "The tree gives the contacts their faces one by one. How many interpretations of the"
            " first contacts are there after each step, if the contacts come in random order?"
        ),
        done=(
            f"Grid sensing, {CONTACTS} contacts, {checked} trials. {WHY_SPEC} At each level the"
            " interpretations are counted in which all pairs of contacts so far fit. (The search"
            " that palpate runs looks ahead at contacts still to come, and has fewer.)"
        ),
        found=(
            f"Medians are {min(ratios):.2f} to {max(ratios):.2f} times the memo's. Most are alive"
            f" at contact {peak.key[0]} (in the memo at contact 3); from there they"
            " grow fewer."
        ),
        blocks=(
            _table(rows, comparisons),
            _drawn("table10", {"random order": rows}),
        ),
        comparisons=comparisons,
        checked=checked,
        lost=lost,
    )


def _table11(levels: Mapping[str, NDArray[np.int64]], checked: int, lost: int) -> Section:
    random, rows = (
        _rows(memo.table10(), levels["random"]),
        _rows(memo.table11(), levels["pairs"]),
    )
    comparisons = judge(rows, _why, _why_order)
    ratios = [row.ratio for row in rows]
    fewer = sum(a.ours[1] < b.ours[1] for a, b in zip(rows, random, strict=True))
    nearest = [four(levels["nearest"][:, row.points - 1]) for row in memo.table11()]
    worse = sum(a[1] > b.ours[1] for a, b in zip(nearest, random, strict=True))
    return Section(
        name="table11",
        title="Table XI: level by level, far-apart contacts first",
        place="Section 4.5, Table XI",
        asked=(
            "Contacts that are far apart say more about each other. Does the tree have fewer"
            " interpretations at its levels if the contacts are sorted, those far apart first?"
        ),
        done=(
            f"The contacts of Table X: grid sensing, {CONTACTS} contacts, {checked} trials, the"
            " stapler at π/10 and 0.01 in. The memo sorts “on the basis of pairwise separation”:"
            " here all pairs are sorted, the farthest first, and contacts come in the order in"
            " which they turn up in them. Beside it, another reading: each time the contact comes"
            " next whose nearest predecessor is farthest, which spreads contacts over the object."
        ),
        found=(
            f"Sorted by pairs, there are fewer than in random order at {fewer} of {len(rows)}"
            f" levels, with medians {min(ratios):.2f} to {max(ratios):.2f} times the memo's. Which"
            " reading one takes matters on an object as long as the stapler: spread over it, the"
            f" contacts leave more than in random order at {worse} of {len(rows)} levels."
        ),
        blocks=(
            _table(rows, comparisons, {"ours, spread out": [figures(each) for each in nearest]}),
            _drawn("table11", {"random order": random, "sorted by pairs": rows}),
        ),
        comparisons=comparisons,
        checked=checked,
        lost=lost,
    )


def _rows(table: Sequence[memo.LevelRow], levels: NDArray[np.int64]) -> list[Row]:
    """Rows that aren't ordered by noise: each is a group of its own."""
    return [
        Row(
            (f"{row.points}",),
            f"{row.points}",
            (float(row.points),),
            (row.smallest, row.median, row.p90, row.largest),
            four(levels[:, row.points - 1]),
        )
        for row in table
    ]


def _table(
    rows: Sequence[Row],
    comparisons: Sequence[Comparison],
    beside: Mapping[str, Sequence[str]] | None = None,
) -> Table:
    from .judge import comparison_table

    table = comparison_table(["contacts"], comparisons, beside)
    capped = [
        [
            f"{cell}+"
            if head == "memo" and row.memo and row.memo[3] == memo.LARGEST_PRINTED
            else cell
            for head, cell in zip(table.heads, cells, strict=True)
        ]
        for row, cells in zip(rows, table.rows, strict=True)
    ]
    return Table(table.heads, capped, marked=table.marked)


def _drawn(name: str, titled: Mapping[str, Sequence[Row]]) -> Figure:
    from .plots import draw_levels

    caption = (
        "Interpretations at each level of the tree: medians, and the span from the least to the"
        " 90th percentile, ours as a band, the memo's between dotted lines."
    )
    return Figure(name, draw_levels(titled, "interpretations"), caption)


def _why(row: Row) -> str:
    return (
        "object and noise are a guess, and the shape is a stand-in's: how much the first few"
        " contacts say depends on how many faces it has at its ends"
    )


def _why_order(row: Row, other: Row) -> str:
    return f"levels of the tree aren't ordered by noise ({', '.join(COUNTS)})"
