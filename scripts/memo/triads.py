"""Tables VII, VIII and IX: sensing by triads of rays (memo, Section 4.4)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from ...assets import memo
from .coarse import MemoLeft, memo_left
from .counts import (
    HEADS,
    REBUILT,
    TRIALS,
    Runs,
    counts,
    loss,
    most_trials,
    printed,
    why_chance,
    why_shape,
)
from .judge import Four, Row, comparison_table, figure, figures, four, judge
from .plan import Plan
from .section import Figure, Section
from .trial import Spec, Stage, Staged, TrialCounts, count_stages, prepared, run_stages

if TYPE_CHECKING:
    from ...envs.sensors.grid import TrueContacts

NAMES = ("table7", "table8", "table9")
FEWEST = 7
"""Contacts of a trial: triads are sent until there are at least these; that gives 7 to 9."""
SENSED = (
    "Three mutually orthogonal rays meet at a random point of a horizontal plane through the"
    " object, which is at a random orientation; each runs downwards until it meets the object or"
    " the plane. That is repeated until there are 7 to 9 contacts on the object, each blurred"
    " within the row's bounds."
)


def sections(plan: Plan, names: Sequence[str]) -> tuple[Section, ...]:
    """Run what the named ones of `NAMES` need, once for all of them."""
    stage: Stage = "tree" if set(names) == {"table7"} else "memo"
    stages: dict[Spec, Stage] = dict.fromkeys(map(Spec.of, memo.table7()), stage)
    runs = run_stages(plan, stages, plan.trials or TRIALS, run_piece, "triad sensing")
    left = {}
    if stage == "memo":
        left = {
            spec: memo_left([t.memo_poses for t in trials if t.memo_poses is not None])
            for spec, trials in runs.items()
        }
    made: dict[str, Callable[[], Section]] = {
        "table7": lambda: _table7(runs),
        "table8": lambda: _table8(runs, left),
        "table9": lambda: _table9(runs, left),
    }
    return tuple(made[name]() for name in names)


def run_piece(piece: Staged) -> list[TrialCounts]:
    """Some trials of a row."""
    (spec, stage), counted = piece.row, []
    for rng in piece.generators():
        truth = sense_triads(spec.object_name, rng)
        contacts = truth.noisy(spec.noise(), rng)
        counted.append(count_stages(spec.object_name, truth, contacts, stage))
    return counted


def sense_triads(object_name: str, rng: np.random.Generator) -> TrueContacts:
    """Touch an object at a random orientation with triads of rays.

    Args:
        object_name: of the library; its origin is put on the plane.
        rng: source of randomness.
    """
    from scipy.spatial.transform import RigidTransform, Rotation

    from ...envs.sensors.grid import TrueContacts
    from ...envs.sensors.touch import triad
    from ...recognizer.models.rays import cast_rays

    model = prepared(object_name).model
    pose = RigidTransform.from_components(np.zeros(3), Rotation.random(rng=rng))
    shadow = pose.apply(model.vertices)[:, :2]
    low, high = shadow.min(axis=0), shadow.max(axis=0)
    reach = 2.0 * model.diameter
    points, normals, faces = [], [], []
    while len(faces) < FEWEST:
        x, y = rng.uniform(low, high)
        starts, directions = triad(x, y, 2.0 * np.pi * rng.random(), reach)
        hits = cast_rays(model, pose, starts, directions)
        # A ray ends at the plane, where the three meet.
        met = hits.hit & (hits.distances < reach)
        points += [*hits.points_world[met]]
        normals += [*hits.normals_world[met]]
        faces += [*hits.faces[met]]
    return TrueContacts(pose, np.array(points), np.array(normals), np.array(faces, np.int32))


def _table7(runs: Runs) -> Section:
    rows = _rows(memo.table7(), runs, "pruned")
    comparisons = judge(rows, why_shape, why_chance)
    checked, lost = loss(runs)
    ratios = [row.ratio for row in rows]
    return Section(
        name="table7",
        title="Table VII: touching at random, interpretations after the local constraints",
        place="Section 4.4, Table VII",
        asked=(
            "A grid of rays is how a camera senses. A hand touches here and there. How many"
            " interpretations do the pairwise constraints leave of 7 to 9 touches?"
        ),
        done=f"{SENSED} {most_trials(runs)} trials a row.",
        found=(
            f"Medians are {min(ratios):.2f} to {max(ratios):.2f} times the memo's. Neither object"
            " was fitted to this table, nor was any other to a figure of Section 4.4."
        ),
        blocks=(comparison_table(HEADS, comparisons), _drawn("table7", rows, "interpretations")),
        comparisons=comparisons,
        checked=checked,
        lost=lost,
    )


def _table8(runs: Runs, left: dict[Spec, MemoLeft]) -> Section:
    rows = _rows(memo.table8(), runs, "tested")
    memo_way: dict[tuple[str, ...], Four] = {
        spec.key: four(each.interpretations) for spec, each in left.items()
    }
    comparisons = judge(rows, _why_test(memo_way), why_chance)
    checked, lost = loss(runs)
    ranges = [each.range_in for each in left.values()]
    lower = sum(row.ratio < 1.0 for row in rows)
    like = sum(
        0.5 <= memo_way[row.key][1] / row.memo[1] <= 2.0 for row in rows if row.memo is not None
    )
    return Section(
        name="table8",
        title="Table VIII: touching at random, interpretations after the model test",
        place="Section 4.4, Table VIII",
        asked="How many of the interpretations of Table VII can be had from one single pose?",
        done=(
            "Sensed as in Table VII: 7 to 9 contacts from triads of rays. Each interpretation is"
            f" given to palpate's model test. {REBUILT}"
            f" ({min(ranges):.2f} to {max(ranges):.2f} in)."
        ),
        found=(
            f"palpate leaves fewer in {lower} of {len(rows)} rows: its test is exact, where the"
            " memo's, with poses off by degrees, has to let much pass. The last column shows what a"
            " test like the memo's leaves of the very same contacts (in some trials, nothing):"
            f" there {like} of {len(rows)} medians are within a factor of two of the memo's."
        ),
        blocks=(
            comparison_table(
                HEADS,
                comparisons,
                {"with the memo's test": [figures(memo_way[row.key]) for row in rows]},
            ),
            _drawn("table8", rows, "interpretations"),
        ),
        comparisons=comparisons,
        checked=checked,
        lost=lost,
    )


def _table9(runs: Runs, left: dict[Spec, MemoLeft]) -> Section:
    rows = _rows(memo.table9(), runs, "directions")
    memo_way: dict[tuple[str, ...], Four] = {
        spec.key: four(each.directions) for spec, each in left.items()
    }
    comparisons = judge(rows, _why_test(memo_way), why_chance)
    checked, lost = loss(runs)
    by_pose = [figures(counts(runs[Spec.of(row)], "poses", 1)) for row in memo.table9()]
    housing = [
        trial.directions > 1
        for spec, trials in runs.items()
        if spec.object_name == "housing-34"
        for trial in trials
    ]
    more = float(np.mean(housing))
    above = sum(memo_way[row.key][1] > 2.0 * row.memo[1] for row in rows if row.memo is not None)
    return Section(
        name="table9",
        title="Table IX: touching at random, distinct transforms",
        place="Section 4.4, Table IX",
        asked="How many different transforms do the interpretations of Table VIII come to?",
        done=(
            "Sensed as in Table VII, counted as in Table IV: by the direction of rotation, 1.5°,"
            " and beside it by poses, 1.5° and 0.05 in. The last column is with a test like the"
            " memo's, as in Table VIII."
        ),
        found=(
            f"{100 * more:.0f} % of the housing's trials leave more than one. The memo found more"
            " than from a grid, and so it is here (see Table IV): but for its lip the housing is"
            " nearly symmetric about two axes, and few touches meet the lip. With a test like the"
            f" memo's, {above} of {len(rows)} medians are above twice the memo's"
            f"{': its own poses must have agreed better than ours rebuilt' if above else ''}."
        ),
        blocks=(
            comparison_table(
                HEADS,
                comparisons,
                {
                    "ours, by pose": by_pose,
                    "with the memo's test": [figures(memo_way[row.key]) for row in rows],
                },
            ),
            _drawn("table9", rows, "transforms"),
        ),
        comparisons=comparisons,
        checked=checked,
        lost=lost,
    )


def _rows(table: Sequence[memo.CountRow], runs: Runs, name: str) -> list[Row]:
    return [
        Row(spec.key, spec.object_name, spec.levels, printed(row), counts(runs[spec], name))
        for row in table
        for spec in [Spec.of(row)]
    ]


def _why_test(memo_way: Mapping[tuple[str, ...], Four]) -> Callable[[Row], str]:
    def why(row: Row) -> str:
        return (
            "palpate's model test is exact, the memo's has to let much pass; with a test like the"
            f" memo's, on the same contacts, the median is {figure(memo_way[row.key][1])}"
        )

    return why


def _drawn(name: str, rows: Sequence[Row], label: str) -> Figure:
    from .plots import draw_rows

    caption = f"Triad sensing, {label}: median, and a line from the least to the 90th percentile."
    return Figure(name, draw_rows(rows, label), caption)
