"""What a benchmark's rows say, strategy by strategy and setting by setting."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..benchmark.row import EpisodeRow
from .statistics import (
    Estimate,
    bootstrap,
    distinguishable_outcomes,
    floor_of_probes,
    holm,
    interquartile_means,
    mean_differences,
    means,
    paired_p_value,
    ratios_of_means,
    wilson,
)

Floats = NDArray[np.float64]

BASELINES = ("random", "random-hit")
"""What the others are compared with."""
FEW_CONTACTS = 7
"""The memo counts the poses left after 7 to 9: a triad adds three at most, so the first probe that
brings their number to 7 leaves it there."""


@dataclass(frozen=True)
class Comparison:
    """A strategy beside another, on the same episodes."""

    ratio: Estimate
    """Of the mean numbers of probes."""
    difference: Estimate
    """Mean, in probes; below zero where this one needs fewer."""
    p_value: float
    """Holm's, over the strategies of the setting."""


@dataclass(frozen=True)
class PolicyResult:
    """A strategy in a setting."""

    policy: str
    solved: Estimate
    right: Estimate | None
    """Share of the ended episodes with the right answer; None if none ended."""
    ended: int
    mean: Estimate
    """Of the probes to unique."""
    middle: Estimate
    """Interquartile mean, likewise."""
    mean_solvable: float
    """Mean, likewise, over the episodes that some strategy solved."""
    against: dict[str, Comparison]
    """By baseline."""
    decision_ms: tuple[float, float] | None
    """Median and 99th percentile of the processor's milliseconds."""
    poses_left: tuple[float, int, int]
    """Median and most hypotheses after 7 to 9 contacts; of how many episodes."""
    unsolved: Floats
    """(max_probes,) share of the episodes that aren't solved after 1, 2, … probes."""
    left: Floats
    """(max_probes,) mean number of hypotheses then, of the episodes with a contact by then."""


@dataclass(frozen=True)
class SettingResult:
    """All strategies in one setting: objects and noise, or all of them together."""

    objects: str
    noise: str
    episodes: int
    """Of each strategy."""
    policies: tuple[PolicyResult, ...]
    solvable: NDArray[np.bool_]
    """(episodes,) whether some strategy solved it."""
    floor: float | None
    """Mean number of probes below which no strategy can be sure to end; of rays alone."""

    @property
    def best(self) -> PolicyResult:
        """The strategy with the fewest probes at the mean."""
        return min(self.policies, key=lambda result: result.mean.value)


def settle(
    rows: Sequence[EpisodeRow], policies: Sequence[str], objects: str, noise: str
) -> SettingResult | None:
    """The result of rows that are compared with each other; None if no episode is whole.

    An episode counts once every strategy has played it: those that take long would otherwise be
    missing of a benchmark that still runs, and the rest look too easy.

    Args:
        rows: of a setting, or of several to be taken together.
        policies: the strategies.
        objects: what to call the objects.
        noise: what to call the noise.
    """
    by_policy = {
        policy: {(r.objects, r.noise, r.episode): r for r in rows if r.policy == policy}
        for policy in policies
    }
    common = sorted(set.intersection(*(set(played) for played in by_policy.values())))
    if not common:
        return None
    played = {policy: [by_policy[policy][key] for key in common] for policy in policies}
    # A generator of its own: figures of a setting don't depend on which others there are.
    rng = np.random.default_rng(0)
    needed = {
        policy: np.array([row.probes_to_unique for row in own], np.float64)
        for policy, own in played.items()
    }
    first = played[policies[0]]
    strata = [f"{row.objects} {row.noise} {row.true_object}" for row in first]
    against = {
        baseline: _comparisons(needed, baseline, strata, rng)
        for baseline in BASELINES
        if baseline in needed
    }
    solvable = np.any([[row.solved for row in own] for own in played.values()], axis=0)
    results = [
        _policy_result(
            policy,
            played[policy],
            float(needed[policy][solvable].mean()) if solvable.any() else np.nan,
            bootstrap([needed[policy]], strata, means, rng),
            bootstrap([needed[policy]], strata, interquartile_means, rng),
            {name: found[policy] for name, found in against.items() if policy in found},
        )
        for policy in policies
    ]
    # The bound on outcomes is that of points that go along rays.
    rays = all(row.sensor == "ray" for row in first)
    floor = float(np.mean([_floor(row) for row in first])) if rays else None
    return SettingResult(objects, noise, len(common), tuple(results), solvable, floor)


def _comparisons(
    needed: dict[str, Floats], baseline: str, strata: Sequence[str], rng: np.random.Generator
) -> dict[str, Comparison]:
    others = [policy for policy in needed if policy != baseline]
    adjusted = holm([paired_p_value(needed[one], needed[baseline], rng) for one in others])
    return {
        policy: Comparison(
            bootstrap([needed[policy], needed[baseline]], strata, ratios_of_means, rng),
            bootstrap([needed[policy], needed[baseline]], strata, mean_differences, rng),
            p_value,
        )
        for policy, p_value in zip(others, adjusted, strict=True)
    }


def _policy_result(
    policy: str,
    rows: Sequence[EpisodeRow],
    mean_solvable: float,
    mean: Estimate,
    middle: Estimate,
    against: dict[str, Comparison],
) -> PolicyResult:
    answers = [row.right for row in rows if row.right is not None]
    spent = [1e3 * one for row in rows for one in row.decision_processor_seconds]
    poses = [left for row in rows if (left := poses_left(row)) is not None]
    most = max(row.max_probes for row in rows)
    left = np.array([_left(row, most) for row in rows])
    touched = (left > 0.0).sum(axis=0)
    median, tail = np.percentile(spent, (50, 99)) if spent else (0.0, 0.0)
    return PolicyResult(
        policy=policy,
        solved=wilson(sum(row.solved for row in rows), len(rows)),
        right=wilson(sum(answers), len(answers)) if answers else None,
        ended=len(answers),
        mean=mean,
        middle=middle,
        mean_solvable=mean_solvable,
        against=against,
        decision_ms=(float(median), float(tail)) if spent else None,
        poses_left=(float(np.median(poses)), max(poses), len(poses)) if poses else (np.nan, 0, 0),
        unsolved=np.mean(
            [[row.probes_to_unique > sent for sent in range(1, most + 1)] for row in rows], axis=0
        ),
        left=np.where(touched, left.sum(axis=0) / np.maximum(touched, 1), np.nan),
    )


def _left(row: EpisodeRow, most: int) -> list[int]:
    """Hypotheses after each probe; an episode that has ended stays as it was."""
    return [*row.hypotheses, *[row.hypotheses[-1]] * (most - row.probes)]


def poses_left(row: EpisodeRow) -> int | None:
    """Hypotheses left after the first probe that brings the contacts to 7, 8 or 9.

    One that was solved with fewer contacts has one left; None of one that gave up with fewer, or of
    a probe that touched more often at once.
    """
    for felt, left in zip(row.contacts_felt, row.hypotheses, strict=True):
        if felt >= FEW_CONTACTS:
            return left if felt < FEW_CONTACTS + 3 else None
    return row.hypotheses[-1] if row.solved else None


def _floor(row: EpisodeRow) -> int:
    """Probes that an episode takes at the least, its first probe being given."""
    if row.solved and row.probes == 1:
        return 1
    outcomes = distinguishable_outcomes(row.diameter, row.position_error, row.normal_error)
    # One rival whose pose is open, or an object not yet touched, takes one more probe too.
    return 1 + max(1, floor_of_probes(max(row.hypotheses[0], 1), outcomes))
