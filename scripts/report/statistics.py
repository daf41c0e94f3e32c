"""The statistics of a report: intervals, paired tests, and a floor that no strategy gets below.

What Agarwal et al. ("Deep Reinforcement Learning at the Edge of the Statistical Precipice", NeurIPS
2021) ask of a benchmark: interquartile means, and bootstrap intervals that are drawn stratum by
stratum. Strategies are compared in pairs, episode by episode.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Statistic = Callable[[Floats], Floats]
"""Of (b, n, c) resampled rows of c columns, (b,) values."""

DRAWS = 2000
"""Of a bootstrap."""
PERMUTATIONS = 9999
"""Of a test, or all there are if they are no more than that."""
LEVEL = 0.95
CHUNK = 2_000_000
"""Resampled values that are held at a time."""


@dataclass(frozen=True)
class Estimate:
    """A figure and its 95 % interval."""

    value: float
    low: float
    high: float


def wilson(successes: int, trials: int) -> Estimate:
    """A share and its Wilson score interval (Wilson, 1927).

    Raises:
        ValueError: no trials, or more successes than trials.
    """
    if not 0 <= successes <= trials or trials < 1:
        raise ValueError(f"{successes} of {trials} is no share")
    from scipy.stats import binomtest

    interval = binomtest(successes, trials).proportion_ci(LEVEL, method="wilson")
    return Estimate(successes / trials, float(interval.low), float(interval.high))


def means(resampled: Floats) -> Floats:
    """(b,) means of the first column of (b, n, c) rows."""
    return resampled[:, :, 0].mean(axis=1)


def interquartile_means(resampled: Floats) -> Floats:
    """(b,) means of the middle half of the first column of (b, n, c) rows."""
    from scipy.stats import trim_mean

    return np.asarray(trim_mean(resampled[:, :, 0], 0.25, axis=1), np.float64)


def mean_differences(resampled: Floats) -> Floats:
    """(b,) means of the first column less the second, of (b, n, 2) rows."""
    return (resampled[:, :, 0] - resampled[:, :, 1]).mean(axis=1)


def ratios_of_means(resampled: Floats) -> Floats:
    """(b,) means of the first column over those of the second, of (b, n, 2) rows."""
    return resampled[:, :, 0].mean(axis=1) / resampled[:, :, 1].mean(axis=1)


def bootstrap(
    columns: Sequence[Floats],
    strata: Sequence[str],
    statistic: Statistic,
    rng: np.random.Generator,
    draws: int = DRAWS,
) -> Estimate:
    """A statistic and its percentile interval, resampled within strata.

    Args:
        columns: c times (n,) values of the same n episodes: resampled together, so paired.
        strata: (n,) what each episode is of; each keeps its number of episodes.
        statistic: of resampled rows.
        rng: source of the resamples.
        draws: how many.
    """
    values = np.stack([np.asarray(column, np.float64) for column in columns], axis=1)
    names, of = np.unique(np.asarray(strata), return_inverse=True)
    groups = [np.flatnonzero(of == stratum) for stratum in range(len(names))]
    at_a_time = max(CHUNK // values.size, 1)
    found = []
    for begun in range(0, draws, at_a_time):
        many = min(at_a_time, draws - begun)
        picked = [group[rng.integers(len(group), size=(many, len(group)))] for group in groups]
        found.append(statistic(values[np.concatenate(picked, axis=1)]))
    tail = 100.0 * (1.0 - LEVEL) / 2.0
    low, high = np.percentile(np.concatenate(found), (tail, 100.0 - tail))
    return Estimate(float(statistic(values[None])[0]), float(low), float(high))


def paired_p_value(one: Floats, other: Floats, rng: np.random.Generator) -> float:
    """How often the mean of paired differences is as far from zero by chance, both sides.

    Under the null hypothesis the sign of each difference is a coin's (Fisher's randomisation test).

    Args:
        one: (n,) values.
        other: (n,) values of the same episodes.
        rng: source of the signs.
    """
    differences = np.asarray(one, np.float64) - np.asarray(other, np.float64)
    differences = differences[differences != 0.0]
    count = len(differences)
    # Rounding must not make a sum that is as far look nearer.
    observed = np.abs(differences.sum()) * (1.0 - 1e-12)
    if 2**count <= PERMUTATIONS:
        flipped = (np.arange(2**count)[:, None] >> np.arange(count)) & 1
        return float((np.abs((1 - 2 * flipped) @ differences) >= observed).mean())
    as_far, at_a_time = 0, max(CHUNK // count, 1)
    for begun in range(0, PERMUTATIONS, at_a_time):
        many = min(at_a_time, PERMUTATIONS - begun)
        flipped = rng.integers(2, size=(many, count), dtype=np.int8)
        as_far += int((np.abs((1 - 2 * flipped) @ differences) >= observed).sum())
    # The episodes as they were are one of the permutations.
    return (as_far + 1) / (PERMUTATIONS + 1)


def holm(p_values: Sequence[float]) -> list[float]:
    """P-values of several tests, so that the chance of any false alarm stays (Holm, 1979)."""
    order = np.argsort(p_values, kind="stable")
    adjusted, largest = [0.0] * len(p_values), 0.0
    for rank, index in enumerate(order):
        largest = max(largest, min(1.0, (len(p_values) - rank) * p_values[index]))
        adjusted[index] = largest
    return adjusted


def distinguishable_outcomes(
    diameter: float, position_error: float, normal_error: float, rays: int = 3
) -> int:
    """A bound on how many outcomes of one probe can be told apart for sure.

    Two things that a ray may meet are told apart for sure only if no reading is within the bounds
    of both. Of points on a ray, those are more than ``2 position_error`` apart; once the object has
    been touched it lies within a diameter of that contact, so on at most two diameters of a ray. Of
    normals, those have cones of half-angle ``normal_error`` that don't overlap; a normal that a ray
    meets is within a right angle of the way back, so all cones lie in a cap of the sphere whose
    area is ``2 pi (1 + sin normal_error)``, and each takes ``2 pi (1 - cos normal_error)`` of it.
    To this a ray adds one outcome: it misses.

    Args:
        diameter: of the largest object that it may be, metres.
        position_error: metres.
        normal_error: radians.
        rays: of a probe.
    """
    # A hair more than the quotient: rounding must not take an outcome from the bound.
    depths = math.floor(2.0 * diameter / (2.0 * position_error) * (1.0 + 1e-12)) + 1
    share = (1.0 + math.sin(normal_error)) / (1.0 - math.cos(normal_error))
    return (1 + depths * max(math.floor(share * (1.0 + 1e-12)), 1)) ** rays


def floor_of_probes(rivals: int, outcomes: int) -> int:
    """Probes that it takes, at best, to be sure to tell rivals apart: ``ceil(log_B K)``.

    Args:
        rivals: K, how many there are.
        outcomes: B, how many a probe can tell apart.
    """
    if rivals < 1 or outcomes < 2:
        raise ValueError(f"{rivals} rivals and {outcomes} outcomes: needs 1 and 2 at least")
    probes, told_apart = 0, 1
    while told_apart < rivals:  # whole numbers: a logarithm may round past one
        probes, told_apart = probes + 1, told_apart * outcomes
    return probes
