"""Tables IV and VI: distinct transforms, sensed by a grid of rays (memo, Section 4.3)."""

from __future__ import annotations

import numpy as np

from ...assets import memo
from .coarse import memo_left
from .counts import HEADS, REBUILT, Runs, counts, loss, printed, why_chance, why_shape
from .groups import SHIFT_TOLERANCES_IN
from .judge import Row, comparison_table, figure, figures, four, judge
from .section import Figure, Section
from .trial import Spec

AGAIN = "Sensed as in Table II: 12 to 20 contacts from a grid of rays."
SYMMETRIC = "simple-hand"
"""Looks the same after half a turn: it has two transforms at least."""


def table4(runs: Runs) -> Section:
    """Table IV, of tested trials."""
    from .plots import draw_rows

    printed_rows = memo.table4()
    rows = [
        Row(spec.key, spec.object_name, spec.levels, printed(row), counts(runs[spec], "directions"))
        for row in printed_rows
        for spec in [Spec.of(row)]
    ]
    comparisons = judge(rows, why_shape, why_chance)
    checked, lost = loss(runs)
    by_pose = [counts(runs[spec], "poses", 1) for spec in map(Spec.of, printed_rows)]
    fewest = np.mean(
        [
            trial.directions == (2 if spec.object_name == SYMMETRIC else 1)
            for spec, trials in runs.items()
            for trial in trials
        ]
    )
    more = sum(pose[1] > row.ours[1] for pose, row in zip(by_pose, rows, strict=True))
    return Section(
        name="table4",
        title="Table IV: how many distinct transforms are left",
        place="Section 4.3, Table IV",
        asked=(
            "Interpretations that differ in one or two faces often place the object alike. How many"
            " different transforms (places and orientations of the object) do the surviving ones"
            " come to?"
        ),
        done=(
            f"{AGAIN} Each interpretation that passes the model test has a pose. The memo counts"
            " two as one if their directions of rotation differ by less than 1.5°, whatever the"
            " angle of rotation and the translation; that rule is ill defined near rotations by 0"
            " and by π. Beside it we count by poses: the rotation between two is below 1.5° and"
            " their centroids are within 0.05 in."
        ),
        found=(
            f"In {100 * fewest:.0f} % of all trials as few as there can be: one, or two of the"
            f" simple hand. Counted by poses, {more} of {len(rows)} rows have a higher median."
        ),
        blocks=(
            comparison_table(
                HEADS, comparisons, {"ours, by pose": [figures(each) for each in by_pose]}
            ),
            Figure(
                "table4",
                draw_rows(rows, "transforms"),
                "Distinct transforms by the memo's rule: median, and a line from the least to the"
                " 90th percentile.",
            ),
        ),
        comparisons=comparisons,
        checked=checked,
        lost=lost,
    )


def table6(runs: Runs) -> Section:
    """Table VI, of trials tested in the memo's way too."""
    printed_rows = memo.table6()
    rows, by_pose, memo_way, ranges = [], [], [], {}
    for row in printed_rows:
        spec = Spec.of(row)
        at = SHIFT_TOLERANCES_IN.index(row.translation_tolerance_in)
        left = memo_left([t.memo_poses for t in runs[spec] if t.memo_poses is not None])
        key = (*spec.key, f"{row.translation_tolerance_in:.2f} in")
        # A wider tolerance leaves fewer: the axis runs the other way.
        levels = (*spec.levels, -row.translation_tolerance_in)
        ours = counts(runs[spec], "shifted", at)
        rows.append(Row(key, row.object_name, levels, printed(row), ours))
        by_pose.append(figures(counts(runs[spec], "poses", at)))
        memo_way.append(four(left.shifted[at]))
        ranges[spec] = left.range_in
    beside = dict(zip((row.key for row in rows), memo_way, strict=True))

    def why(row: Row) -> str:
        return (
            "palpate's model test keeps only what one pose explains within all bounds, and fits"
            " that pose to tenths of a degree; with poses and a test like the memo's, on the same"
            f" contacts, the median is {figure(beside[row.key][1])}"
        )

    comparisons = judge(rows, why, why_chance)
    used = {spec: trials for spec, trials in runs.items() if spec in ranges}
    checked, lost = loss(used)
    outside = sum(each.verdict == "outside" for each in comparisons)
    like = sum(
        row.memo is not None and 0.25 <= beside[row.key][1] / row.memo[1] <= 4.0 for row in rows
    )
    return Section(
        name="table6",
        title="Table VI: how many distinct transforms, when translations count too",
        place="Section 4.3, Table VI",
        asked=(
            "Table IV leaves translations out. How many transforms are there if two also count as"
            " different when their translations are more than 0.01 in, or 0.05 in, apart?"
        ),
        done=(
            f"{AGAIN} Counted as in Table IV, with translations. {REBUILT}: "
            + ", ".join(f"{spec.object_name} {value:.2f} in" for spec, value in ranges.items())
            + "."
        ),
        found=(
            f"{outside} of {len(rows)} rows are outside the rule. palpate mostly leaves fewer"
            " transforms than the memo, and the cause is the model test: with poses and a test like"
            f" the memo's, on the same contacts, {like} of {len(rows)} medians are within the"
            " factor, and long tails come back too."
        ),
        blocks=(
            comparison_table(
                (*HEADS, "translation"),
                comparisons,
                {
                    "ours, by pose": by_pose,
                    "with the memo's test": [figures(each) for each in memo_way],
                },
            ),
        ),
        comparisons=comparisons,
        checked=checked,
        lost=lost,
    )
