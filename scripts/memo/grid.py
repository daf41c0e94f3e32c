"""Tables II, III, IV and VI and Figure 8: sensing by a grid of rays (memo, Section 4.3)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...assets import memo
from ..report.markdown import Table
from .counts import HEADS, TRIALS, Runs, counts, loss, most_trials, printed, why_chance, why_shape
from .judge import Row, comparison_table, figure, figures, judge
from .plan import Plan
from .section import Comparison, Figure, Section
from .transforms import table4, table6
from .trial import Spec, Stage, Staged, TrialCounts, count_stages, prepared, run_stages

NAMES = ("table2", "table3", "table4", "table6", "figure8")
HISTOGRAM = "simple-hand"
ENDS = (4, 8, 12, 16, 24, 32, 64)
"""Upper ends of Figure 8's bins, and one more bin for the rest."""


SENSED = (
    "An object is put at a random orientation, and rays on a regular grid are sent along three"
    " orthogonal directions; the pitch of the grid is random, such that 12 to 20 rays meet the"
    " object. Each gives a contact: a point and an outward normal, both blurred within the row's"
    " bounds."
)


def sections(plan: Plan, names: Sequence[str]) -> tuple[Section, ...]:
    """Run what the named ones of `NAMES` need, once for all of them."""
    rows = [Spec.of(row) for row in memo.table2()]
    clustered = {Spec.of(row) for row in memo.table6()}
    stages: dict[Spec, Stage] = {}
    for spec in rows:
        if "table6" in names and spec in clustered:
            stages[spec] = "memo"
        elif {"table3", "table4"} & set(names):
            stages[spec] = "test"
        elif "table2" in names or ("figure8" in names and spec.object_name == HISTOGRAM):
            stages[spec] = "tree"
    runs = run_stages(plan, stages, plan.trials or TRIALS, run_piece, "grid sensing")
    make = {
        "table2": _table2,
        "table3": _table3,
        "table4": table4,
        "table6": table6,
        "figure8": _figure8,
    }
    return tuple(make[name](runs) for name in names)


def run_piece(piece: Staged) -> list[TrialCounts]:
    """Some trials of a row."""
    from ...envs.sensors.grid import sense_grid

    (spec, stage), counted = piece.row, []
    for rng in piece.generators():
        truth = sense_grid(prepared(spec.object_name).model, rng)
        contacts = truth.noisy(spec.noise(), rng)
        counted.append(count_stages(spec.object_name, truth, contacts, stage))
    return counted


def _table2(runs: Runs) -> Section:
    from .plots import draw_rows

    rows = [
        Row(spec.key, spec.object_name, spec.levels, printed(row), counts(runs[spec], "pruned"))
        for row in memo.table2()
        for spec in [Spec.of(row)]
    ]
    comparisons = judge(rows, why_shape, why_chance)
    within = sum(each.verdict == "within" for each in comparisons)
    ratios = [row.ratio for row in rows]
    checked, lost = loss(runs)
    return Section(
        name="table2",
        title="Table II: how many interpretations the local constraints leave",
        place="Section 4.3, Table II",
        asked=(
            "An interpretation says for each contact which face of the object it lies on. With 15"
            " contacts on 40 faces there are about 10²⁴ of them. How many are left once every pair"
            " of contacts has been compared with what the object allows two points on two faces to"
            " be to each other: their distance, the angle between their normals, and how far one"
            " lies above the other's face?"
        ),
        done=f"{SENSED} {most_trials(runs)} trials a row.",
        found=(
            f"Our medians are {min(ratios):.2f} to {max(ratios):.2f} times the memo's;"
            f" {within} of {len(rows)} rows are within the rule. The shapes of the housing, the"
            " stapler and the complex hand were chosen with this table in view (not the simple"
            " hand's), so for those three an agreement of medians is a fit, not a test; how counts"
            " grow with noise, and how far the tails reach, wasn't fitted."
        ),
        blocks=(
            comparison_table(HEADS, comparisons),
            Figure(
                "table2",
                draw_rows(rows, "interpretations"),
                "Interpretations after local pruning: median, and a line from the least to the"
                " 90th percentile. Rows are bounds on normals and on positions.",
            ),
        ),
        comparisons=comparisons,
        checked=checked,
        lost=lost,
    )


def _table3(runs: Runs) -> Section:
    rows = [
        Row(spec.key, spec.object_name, spec.levels, None, counts(runs[spec], "tested"))
        for spec in map(Spec.of, memo.table2())
    ]
    damaged = "the transcript of Table III is damaged: no figure of it can be trusted"
    comparisons = judge(rows, why_shape, why_chance, damaged)
    checked, lost = loss(runs)
    medians = [row.ours[1] for row in rows]
    shares = [
        float(np.mean([trial.tested == 1 for trial in runs[spec]]))
        for spec in map(Spec.of, memo.table2())
        if spec.object_name != HISTOGRAM
    ]
    return Section(
        name="table3",
        title="Table III: how many interpretations the model test leaves (ours alone)",
        place="Section 4.3, Table III",
        asked=(
            "The local constraints look at pairs. Which of the interpretations that they leave can"
            " be had from one single pose of the object, with every contact on its face?"
        ),
        done=(
            "Sensed as in Table II: 12 to 20 contacts from a grid of rays. Each interpretation left"
            " by the tree is given to palpate's model test, which"
            " finds a pose within all bounds or proves that there is none. The memo's printed"
            " figures are damaged in the transcript that we have (one figure repeated in several"
            " columns, heads mixed up), so none are shown."
        ),
        found=(
            f"Between {figure(min(medians))} and {figure(max(medians))} in the median, of up to"
            " thousands before the test (Table II). Exactly one is left in"
            f" {100 * min(shares):.0f} % to {100 * max(shares):.0f} % of a row's trials; of the"
            " simple hand, which looks the same after half a turn, never fewer than two."
        ),
        blocks=(
            Table(
                [*HEADS, "after the tree", "after the model test"],
                [
                    [*row.key, figures(counts(runs[spec], "pruned")), figures(row.ours)]
                    for spec, row in zip(map(Spec.of, memo.table2()), rows, strict=True)
                ],
            ),
        ),
        comparisons=comparisons,
        checked=checked,
        lost=lost,
    )


def _figure8(runs: Runs) -> Section:
    from .plots import draw_histograms

    own = {spec: trials for spec, trials in runs.items() if spec.object_name == HISTOGRAM}
    bins = _bin_names()
    counted = {spec: _binned([trial.pruned for trial in own[spec]]) for spec in own}
    comparisons = tuple(
        Comparison(
            spec.key,
            tuple(f"{name} left" for name in bins),
            None,
            tuple(map(float, counted[spec])),
            "not judged",
            "Figure 8 is a drawing, and it is lost",
        )
        for spec in own
    )
    checked, lost = loss(own)
    near = [np.mean([trial.pruned <= 8 for trial in trials]) for trials in own.values()]
    return Section(
        name="figure8",
        title="Figure 8: how the counts are distributed, for the simple hand (ours alone)",
        place="Section 4.3, Figure 8",
        asked=(
            "Are the counts of Table II spread evenly, or clustered near the low end with a shallow"
            " tail, as the memo says of its own?"
        ),
        done="The runs of Table II with the simple hand, as histograms. The memo's are lost.",
        found=(
            "Clustered near the low end, with a shallow tail:"
            f" {100 * min(near):.0f} % to {100 * max(near):.0f} % of a row's trials leave eight"
            " interpretations or fewer. Four is the least: the hand looks the same after half a"
            " turn, and pairs of contacts can't tell it from its mirror image."
        ),
        blocks=(
            Figure(
                "figure8",
                draw_histograms(
                    {", ".join(spec.key[1:]): (None, counted[spec]) for spec in own},
                    bins,
                    "interpretations",
                ),
                "Simple hand: runs by the number of interpretations after local pruning, a panel"
                " for each pair of bounds.",
            ),
        ),
        comparisons=comparisons,
        checked=checked,
        lost=lost,
    )


def _bin_names() -> list[str]:
    starts = [1, *(end + 1 for end in ENDS[:-1])]
    return [*(f"{a}–{b}" for a, b in zip(starts, ENDS, strict=True)), f"{ENDS[-1] + 1}+"]


def _binned(values: Sequence[int]) -> list[int]:
    at = np.searchsorted(ENDS, values)
    return np.bincount(at, minlength=len(ENDS) + 1).tolist()
