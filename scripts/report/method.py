"""How a report's figures come about: what each of them is, and what to run for the same page."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from ...recognizer import PoseTolerance
from ..benchmark.row import EpisodeRow
from .markdown import code, items, literal
from .statistics import DRAWS, PERMUTATIONS, distinguishable_outcomes

__all__ = ["method", "reproduction"]


def method(rows: Sequence[EpisodeRow]) -> Iterator[str]:
    """What the figures are."""
    outcomes = {
        (row.objects, row.noise): distinguishable_outcomes(
            row.diameter, row.position_error, row.normal_error
        )
        for row in rows
    }
    least, most = min(outcomes.values()), max(outcomes.values())
    yield "## What the figures are"
    yield items(
        [
            "Probes to unique: probes sent, the first included, until the episode was solved;"
            f" {rows[0].max_probes + 1} if it wasn't. The interquartile mean is that of the"
            " middle half.",
            "Mean, if solvable: over the episodes that some strategy solved. The others may"
            " have no solution: where what would tell two poses apart lies out of reach, below"
            " the plane, no probe can.",
            "Solved, right answers: shares with Wilson's 95 % score interval. An answer is"
            " right if it names the true object and, where the pose is asked for, its pose is"
            f" within the pose tolerance ({_tolerance()}) of the true one, up to the object's"
            " symmetries; the recogniser gives one only if all poses within the bounds are. An"
            " episode in which nothing fits any more has ended with a wrong one.",
            f"Intervals of means: percentile bootstrap, {DRAWS} resamples, drawn within strata"
            " (setting and true object); of ratios and differences, episodes are resampled in"
            " pairs.",
            f"p: paired sign-flip permutation test of the mean difference, {PERMUTATIONS}"
            " permutations, both sides, with Holm's correction over the strategies of a"
            " setting.",
            "Floor: the first probe, and ceil(log_B K) further ones, at least one unless the"
            " first solved it; mean over episodes. K is the number of hypotheses after the"
            " first probe. B is a bound on the outcomes of a probe that can be told apart for"
            " sure: each ray misses, or meets the object at one of D/e + 1 depths (D the"
            " diameter of the largest object, e the bound on positions: readings more than 2e"
            " apart, over a length of 2D) with one of (1 + sin a)/(1 - cos a) normals (a the"
            " bound on normals: cones that don't overlap), and there are three rays. Here B is"
            f" {least:.2g} to {most:.2g}. No strategy can be sure to end sooner; the bound is"
            " far from tight, as no object shows a probe that many outcomes.",
        ]
    )


def reproduction(settings: Mapping[str, object], rows: Sequence[EpisodeRow]) -> Iterator[str]:
    """How to get the same page again."""
    versions = Counter(row.versions for row in rows)
    played = [
        ", ".join(f"{name} {number}" for name, number in json.loads(text).items())
        + (f" ({count} episodes)" if len(versions) > 1 else "")
        for text, count in versions.items()
    ]
    folder = str(settings["command"]).rsplit("--out ", 1)[-1]
    yield "## How to get it again"
    yield code(f"{settings['command']}\npalpate report {folder}")
    yield (
        "The same rows come out, however many processes play them and however often it is"
        " stopped in between; only the decision times are measured anew."
    )
    yield items(f"played with {literal(text)}" for text in played)


def _tolerance() -> str:
    tolerance = PoseTolerance()
    return (
        f"{np.degrees(tolerance.rotation):g}°, for the centroid {100 * tolerance.translation:g} %"
        f" of the diameter or {tolerance.position_errors:g} bounds on positions, whichever is more"
    )
