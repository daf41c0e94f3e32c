"""What the experiments in space share: counts of trials, and why ours differ from the memo's."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ...assets import memo
from .judge import Four, Row, four
from .trial import Spec, TrialCounts

TRIALS = 100
"""As many as the memo ran."""
HEADS = ("object", "normal", "position")

Runs = Mapping[Spec, Sequence[TrialCounts]]

REBUILT = (
    "Because the memo's model test differs from palpate's, it was rebuilt too: its poses, averaged"
    " from pairs of normals and from triples of planes, and its check that contacts lie on their"
    " faces to within “some error range”. The memo gives no figure for that; here it is as wide as"
    " it has to be for the right interpretation to pass in nine trials of ten"
)


def printed(row: memo.CountRow | memo.ClusterRow) -> Four:
    """A row's figures in the memo."""
    return row.smallest, row.median, row.p90, row.largest


def counts(trials: Sequence[TrialCounts], name: str, at: int | None = None) -> Four:
    """Least, median, 90th percentile and most of one of the counts of trials."""
    values = [getattr(trial, name) for trial in trials]
    return four([value if at is None else value[at] for value in values])


def loss(runs: Runs) -> tuple[int, int]:
    """In how many trials it was looked whether the right interpretation was kept, and lost.

    Raises:
        RuntimeError: a tree that wasn't searched to its end, so that its counts are too low.
    """
    trials = [trial for each in runs.values() for trial in each]
    if not all(trial.complete for trial in trials):
        raise RuntimeError("a tree has more than a million interpretations: it was cut short")
    return len(trials), sum(not trial.kept for trial in trials)


def why_shape(row: Row) -> str:
    """Why a count differs where nothing but the object does."""
    return (
        "this count depends on which faces of the shape can be taken for one another, and the"
        " stand-in's shape isn't the memo's"
    )


def why_chance(row: Row, other: Row) -> str:
    """Why two rows stand in another order than the memo's."""
    return "the two medians are close, and so within what another draw of trials may turn round"


def most_trials(runs: Runs) -> int:
    """How many trials a row has."""
    return max(len(trials) for trials in runs.values())
