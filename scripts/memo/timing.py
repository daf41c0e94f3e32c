"""The memo's running times (Section 7): seconds to prune the tree and to test what it leaves."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ...assets.memo import place, table2, timing
from ..report.drawing import COLOURS, FAINT, in_style, panels_of, svg_of
from ..report.markdown import Table
from .plan import Plan, run_rows
from .section import Comparison, Figure, Section
from .timing_trials import COUNTED, KEPT, PRUNED, RECOGNIZED, TESTED, measure_times
from .trial import Spec

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Floats = NDArray[np.float64]

TRIALS = 100
"""As many as the memo ran in its simulations; of its timing it doesn't say."""
MEANT = (15, 10)
"""Bounds on normals, pi over these, that the memo may have meant by the one it prints."""
NAMES = ("prune, s", "all tests, s", "a test, s")


def run(plan: Plan) -> Section:
    """Time the housing at the memo's bounds, and at all bounds of its Table II."""
    memo, trials = timing(), plan.trials or TRIALS
    here = [replace(Spec.of(memo), pi_over=pi_over) for pi_over in (memo.pi_over, *MEANT)]
    table = [Spec.of(row) for row in table2() if row.object_name == memo.object_name]
    specs = dict.fromkeys([*here, *table])
    found = run_rows(plan, specs, trials, measure_times, "running times")
    joined = {spec: np.concatenate([one.rows for one in found[spec]]) for spec in specs}
    return _section(
        {spec: joined[spec] for spec in here},
        np.concatenate([joined[spec] for spec in table]),
        checked=trials * len(specs),
        lost=sum(one.lost for pieces in found.values() for one in pieces),
    )


def _section(here: Mapping[Spec, Floats], table: Floats, *, checked: int, lost: int) -> Section:
    memo = timing()
    printed = memo.prune_seconds, memo.test_seconds, memo.seconds_a_test
    tests = memo.test_seconds / memo.seconds_a_test
    first, *_ = (_means(rows) for rows in here.values())
    slopes = [growth(table, column) for column in (PRUNED, TESTED)]
    compared = Comparison(
        key=Spec.of(memo).key,
        names=NAMES,
        memo=printed,
        ours=first,
        verdict="not judged",
        why="seconds of another machine, decades younger than a Symbolics 3600",
    )
    return Section(
        name="timing",
        title="Section 7: time to prune and to test",
        place="Section 7",
        asked=(
            "How long does it take to grow and prune the tree, and how long to test the"
            " interpretations it leaves, each for a pose that fits? The memo gives mean times for"
            f" the {memo.object_name} on a Symbolics 3600, a Lisp machine of 1983:"
            f" {memo.prune_seconds} s, {memo.test_seconds} s, and {memo.seconds_a_test} s a test."
        ),
        done=(
            f"{len(next(iter(here.values())))} trials at each pair of bounds, 12 to 20 contacts"
            " from grids of rays. Timed by the processor's clock on one core: the tree, compiled,"
            " with its tables ready, as in the memo; and the model test of all it leaves, which"
            " here is more than the memo's, since it looks for a pose within all bounds and"
            " rejects only with a proof. The last column is the recogniser as palpate uses it,"
            f" which tests within the tree. {place('section7').damage} So all three are shown."
        ),
        found=(
            f"At π/{memo.pi_over} pruning takes {1e3 * first[0]:.2f} ms and all tests"
            f" {1e3 * first[1]:.2f} ms, {_times(printed[0] / first[0])} and"
            f" {_times(printed[1] / first[1])} times as fast as then; a test takes"
            f" {1e6 * first[2]:.0f} µs, {_times(printed[2] / first[2])} times as fast. In the memo"
            f" testing took {printed[1] / printed[0]:.1f} times as long as pruning, here"
            f" {first[1] / first[0]:.1f} times. Its times come to {tests:.0f} tests a trial;"
            f" {_counts(here, tests)} Over all bounds of Table II, the time to test grows with the"
            f" number of interpretations to the power of {slopes[1]:.2f}; the memo says linearly,"
            f" which is 1. The time to prune grows to the power of {slopes[0]:.2f}: most of it goes"
            " into asking which two faces any two contacts may be on, which is much the same work"
            " however many interpretations that leaves. The memo's grew faster, it says:"
            " not linearly."
        ),
        blocks=(
            _table(here),
            (
                "Means over the trials. Interpretations are those that the tree leaves and the"
                " tests are run on."
            ),
            Figure(
                "times",
                draw_growth(table),
                "Time to prune and time to test against the interpretations that the tree leaves,"
                " one dot a trial, all nine bounds of the housing in Table II. Lines: powers"
                " fitted to trials of ten interpretations or more.",
            ),
        ),
        comparisons=(compared,),
        checked=checked,
        lost=lost,
    )


def growth(rows: Floats, column: int) -> float:
    """The power of the number of interpretations with which a time grows; NaN if it can't be told.

    Trials of fewer than ten interpretations are left out: what is done once outweighs the rest.
    """
    return _power(rows, column)[0]


def _power(rows: Floats, column: int) -> tuple[float, float]:
    """Slope and intercept of a line through logarithms."""
    many = rows[rows[:, COUNTED] >= 10.0]
    if len(np.unique(many[:, COUNTED])) < 2:
        return math.nan, math.nan
    slope, intercept = np.polyfit(np.log(many[:, COUNTED]), np.log(many[:, column]), 1)
    return float(slope), float(intercept)


def _means(rows: Floats) -> tuple[float, float, float]:
    """Mean seconds to prune, to run all tests, and of a test."""
    prune_seconds, test_seconds = rows[:, [PRUNED, TESTED]].mean(axis=0)
    return (
        float(prune_seconds),
        float(test_seconds),
        float(rows[:, TESTED].sum() / rows[:, COUNTED].sum()),
    )


def _times(factor: float) -> str:
    """A factor to two digits, with separators."""
    digits = 1 - math.floor(math.log10(factor))
    return f"{round(factor, digits):,.0f}"


def _counts(here: Mapping[Spec, Floats], tests: float) -> str:
    """How many tests a trial takes here, and which bound comes nearest to the memo's number."""
    counts = {spec.pi_over: rows[:, COUNTED].mean() for spec, rows in here.items()}
    nearest = min(counts, key=lambda pi_over: abs(math.log(counts[pi_over] / tests)))
    shown = ", ".join(f"{count:.0f} at π/{pi_over}" for pi_over, count in counts.items())
    likelier = f", so what was timed may have been π/{nearest}"
    return f"here there are {shown}{likelier if nearest != timing().pi_over else ''}."


def _table(here: Mapping[Spec, Floats]) -> Table:
    memo = timing()
    tests = memo.test_seconds / memo.seconds_a_test
    printed = [
        "memo, 1983",
        f"{tests:.0f}",
        "",
        f"{1e3 * memo.prune_seconds:,.0f}",
        f"{1e3 * memo.test_seconds:,.0f}",
        f"{1e6 * memo.seconds_a_test:,.0f}",
        "",
    ]
    rows = [printed]
    for spec, values in here.items():
        prune_seconds, test_seconds, a_test = _means(values)
        rows.append(
            [
                ", ".join(spec.key),
                f"{values[:, COUNTED].mean():.1f}",
                f"{values[:, KEPT].mean():.1f}",
                f"{1e3 * prune_seconds:.2f}",
                f"{1e3 * test_seconds:.2f}",
                f"{1e6 * a_test:.0f}",
                f"{1e3 * values[:, RECOGNIZED].mean():.2f}",
            ]
        )
    heads = ["", "interpretations", "left by the tests", "prune, ms", "all tests, ms", "a test, µs"]
    return Table([*heads, "recogniser, ms"], rows)


@in_style
def draw_growth(rows: Floats) -> str:
    """Time to prune and to test against the number of interpretations."""
    figure, panels = panels_of(2, (3.25, 2.2), sharey=True)
    titles: Sequence[tuple[Axes, int, str]] = (
        (panels[0], PRUNED, "to prune"),
        (panels[1], TESTED, "to test all of them"),
    )
    reach = np.array([10.0, max(rows[:, COUNTED].max(), 10.0)])
    for (panel, column, title), colour in zip(titles, COLOURS, strict=False):
        panel.plot(
            rows[:, COUNTED],
            1e3 * rows[:, column],
            ".",
            markersize=2.5,
            color=colour,
            alpha=0.5,
            rasterized=True,
        )
        slope, intercept = _power(rows, column)
        if math.isfinite(slope):
            fitted = 1e3 * np.exp(intercept) * reach**slope
            panel.plot(reach, fitted, "-", color="#000000", linewidth=0.9)
            title = f"{title}: power {slope:.2f}"
        panel.set(title=title, xscale="log", yscale="log", xlabel="interpretations")
        panel.xaxis.set_major_formatter("{x:g}")
        panel.grid(color=FAINT, linewidth=0.6)
    panels[0].set_ylabel("ms")
    panels[0].yaxis.set_major_formatter("{x:g}")
    return svg_of(figure)
