"""A report's statistics against plain oracles, published figures and scipy."""

from __future__ import annotations

import math
from itertools import product

import numpy as np
import pytest

from palpate.scripts.report.statistics import (
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


@pytest.mark.parametrize(
    ("successes", "trials", "low", "high"),
    [
        # Newcombe, "Two-sided confidence intervals for the single proportion", 1998, table I.
        (81, 263, 0.2553, 0.3662),
        (15, 148, 0.0624, 0.1605),
        (0, 20, 0.0, 0.1611),
        (1, 29, 0.0061, 0.1718),
    ],
)
def test_wilson_intervals_are_those_in_print(successes, trials, low, high):
    found = wilson(successes, trials)
    assert found.value == successes / trials
    assert (found.low, found.high) == (pytest.approx(low, abs=5e-5), pytest.approx(high, abs=5e-5))


def test_a_share_of_nothing_is_refused():
    with pytest.raises(ValueError, match="0 of 0"):
        wilson(0, 0)


def test_bootstrap_intervals_hold_the_truth_about_as_often_as_they_say():
    rng = np.random.default_rng(0)
    held = []
    for _ in range(300):
        sample = rng.exponential(1.0, 60)
        found = bootstrap([sample], ["one"] * 60, means, rng, draws=300)
        assert found.value == pytest.approx(sample.mean())
        held.append(found.low <= 1.0 <= found.high)
    assert 0.88 < np.mean(held) < 0.98


def test_strata_keep_their_sizes():
    values = np.array([1.0] * 30 + [9.0] * 10)
    strata = ["easy"] * 30 + ["hard"] * 10
    rng = np.random.default_rng(0)
    found = bootstrap([values], strata, means, rng)
    assert (found.value, found.low, found.high) == (3.0, 3.0, 3.0)
    assert bootstrap([values], ["one"] * 40, means, rng).low < 2.5


def test_pairs_are_resampled_together():
    rng = np.random.default_rng(0)
    other = rng.integers(1, 40, 50).astype(float)
    found = bootstrap([0.5 * other, other], ["one"] * 50, ratios_of_means, rng)
    assert (found.low, found.high) == (pytest.approx(0.5), pytest.approx(0.5))
    found = bootstrap([other - 3.0, other], ["one"] * 50, mean_differences, rng)
    assert (found.low, found.high) == (pytest.approx(-3.0), pytest.approx(-3.0))


def test_the_interquartile_mean_is_that_of_the_middle_half():
    values = np.array([100.0, 2.0, 4.0, 6.0, 8.0, -50.0, 0.0, 10.0])
    assert interquartile_means(values[None, :, None]) == pytest.approx([5.0])


def test_a_permutation_test_counts_signs():
    differences = np.array([3.0, -1.0, 2.0, 5.0, 0.0, -0.5])
    moved = differences[differences != 0.0]
    observed = abs(moved.mean())
    signs = np.array(list(product((-1.0, 1.0), repeat=len(moved))))
    as_far = np.abs((signs * moved).mean(axis=1)) >= observed - 1e-12
    p = paired_p_value(differences, np.zeros(6), np.random.default_rng(0))
    assert p == pytest.approx(as_far.mean())
    assert paired_p_value(np.ones(4), np.ones(4), np.random.default_rng(0)) == 1.0


def test_a_permutation_test_of_many_pairs_agrees_with_scipys():
    from scipy.stats import permutation_test

    rng = np.random.default_rng(0)
    other = rng.integers(2, 30, 60).astype(float)
    one = other + rng.uniform(-4.0, 3.0, 60)
    theirs = permutation_test(
        (one - other,), np.mean, permutation_type="samples", n_resamples=9999, rng=rng
    )
    assert 0.001 < theirs.pvalue < 0.2
    assert paired_p_value(one, other, rng) == pytest.approx(theirs.pvalue, abs=0.012)


def test_holm_corrects_step_by_step():
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])
    assert holm([0.9, 0.8]) == [1.0, 1.0]


@pytest.mark.parametrize(
    ("rivals", "outcomes", "probes"),
    [(1, 2, 0), (2, 2, 1), (8, 2, 3), (9, 2, 4), (1000, 10, 3), (125, 5, 3), (126, 5, 4)],
)
def test_the_floor_is_the_logarithm_rounded_up(rivals, outcomes, probes):
    assert floor_of_probes(rivals, outcomes) == probes


@pytest.mark.parametrize("normal_error", [0.1, np.pi / 10, np.pi / 8, 0.7, np.pi / 2])
def test_no_more_normals_can_be_told_apart_than_the_floor_allows(normal_error):
    rng = np.random.default_rng(0)
    normals = rng.normal(size=(4000, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    apart: list[np.ndarray] = []
    for normal in normals[normals[:, 2] > 0.0]:
        if all(normal @ other < math.cos(2.0 * normal_error) for other in apart):
            apart.append(normal)
    # At one depth only: a missed ray, and these.
    assert 1 + len(apart) <= distinguishable_outcomes(1e-9, 1.0, normal_error, rays=1)


def test_depths_and_rays_multiply_what_can_be_told_apart():
    # Two diameters of 0.1 m hold 11 depths that are 20 mm apart; flat normals tell nothing.
    assert distinguishable_outcomes(0.1, 0.01, np.pi / 2, rays=1) == 1 + 11 * 2
    assert distinguishable_outcomes(0.1, 0.01, np.pi / 2) == 23**3
