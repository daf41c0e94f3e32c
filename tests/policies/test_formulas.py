"""What the strategies reckon a probe to be worth, against sums written out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from helpers.bar import (
    BAR,
    CUBE,
    observation_of,
    pose_at,
    random_outcomes,
    rivals_at_both_ends,
    task_for,
)
from helpers.pose_samples import samples_at

from palpate.policies import GOALS, Rate
from palpate.policies.decision_region import edges_cut
from palpate.policies.information import gain_of_answers, gain_of_hypotheses
from palpate.policies.lookahead import two_ahead
from palpate.policies.minimax import TIE, UNLIKELY, worst_case
from palpate.policies.outcomes.candidates import spread_actions
from palpate.policies.outcomes.outcomes import Outcomes
from palpate.policies.pairs import pairs_told_apart
from palpate.policies.pruning import weight_removed
from palpate.policies.safe_region import safest_cell
from palpate.policies.separation import separation


def test_formulas_are_what_they_say():
    rng = np.random.default_rng(4)
    outcomes = random_outcomes(rng, count=6, probes=4)
    w, left, apart = outcomes.weights, outcomes.left.astype(float), outcomes.distances
    p = outcomes.chances
    likely = np.flatnonzero(p >= UNLIKELY * p.max())
    n = range(len(w))
    for a in range(len(outcomes.actions)):
        removed = sum(p[i] * w[j] * (1.0 - left[a, i, j]) for i in n for j in n)
        assert weight_removed(outcomes)[a] == pytest.approx(removed, abs=1e-5)
        pairs = sum(p[i] * w[j] for i in n for j in n if apart[a, i, j] > 1.0)
        assert pairs_told_apart(outcomes)[a] == pytest.approx(pairs, abs=1e-5)
        bins = [sum(w[j] * left[a, i, j] for j in n) for i in n]
        told = -sum(p[i] * np.log(bins[i]) for i in n)
        assert gain_of_answers(outcomes.left, w, p)[a] == pytest.approx(told, abs=1e-5)
        worst = 1.0 - max(bins[i] for i in likely) + TIE * removed
        assert worst_case(outcomes)[a] == pytest.approx(worst, abs=1e-5)
        capped = np.minimum(apart[a], 1.0)
        rivals = [(i, j) for i in n for j in n if not outcomes.same[i, j]]
        least = min(max(capped[i, j], capped[j, i]) for i, j in rivals)
        mean = sum(p[i] * w[j] * capped[i, j] for i, j in rivals)
        assert separation(outcomes)[a] == pytest.approx(least + mean, abs=1e-5)


def test_edges_are_cut_between_decisions_alone():
    outcomes = random_outcomes(np.random.default_rng(5), count=6, probes=4)
    alike = np.eye(6, dtype=bool)
    alike[0, 1] = alike[1, 0] = True
    outcomes = Outcomes(
        outcomes.task,
        outcomes.samples,
        outcomes.actions,
        outcomes.rays,
        outcomes.predictions,
        alike,
        outcomes.chances,
    )
    w, p, left = outcomes.weights, outcomes.chances, outcomes.left.astype(float)
    edges = [(j, k) for j in range(6) for k in range(j) if not alike[j, k]]
    total = sum(w[j] * w[k] for j, k in edges)
    cuts = edges_cut(outcomes)
    assert cuts.shape == (4,)
    for a, cut in enumerate(cuts):
        kept = sum(
            p[i] * w[j] * w[k] * left[a, i, j] * left[a, i, k] for i in range(6) for j, k in edges
        )
        assert cut == pytest.approx(1.0 - kept / total, abs=1e-5)


def test_two_probes_ahead_see_what_neither_does_alone():
    # Probe 0 tells half of four rivals from the other half, probe 1 the halves of both;
    # probe 2 tells one rival alone, and nothing that goes with it tells the rest.
    bits = np.array([[0, 0, 1, 1], [0, 1, 0, 1], [0, 0, 0, 1]])
    left = (bits[:, :, None] == bits[:, None, :]).astype(np.float32)
    weights = np.full(4, 0.25)
    alone = gain_of_answers(left, weights, weights)
    worth = two_ahead(left, weights, weights, alone)
    np.testing.assert_allclose(alone[:2], np.log(2.0), rtol=1e-6)
    np.testing.assert_allclose(worth[:2] - 0.1 * alone[:2], np.log(4.0), rtol=1e-6)
    assert worth[2] < worth[0]


def test_the_middle_of_the_largest_safe_region_is_probed():
    told = np.zeros((2, 7, 7))
    told[0, 1:6, 1:6] = 0.92
    told[1, 0:2, 0:2] = 1.0
    assert safest_cell(told) == (0, 3, 3)
    told[0, 3, 3] = 0.5  # a hole: what is left of the large region is a ring, one or two cells wide
    assert safest_cell(told)[0] == 0


def test_the_name_alone_needs_no_pose():
    """A cube and a bar, each at two poses: only what tells the objects apart counts."""
    models = (BAR, CUBE)
    poses = [pose_at(0.0), pose_at(180.0), pose_at(0.0), pose_at(20.0)]
    samples = samples_at(models, poses, objects=[0, 0, 1, 1])
    actions = spread_actions(40, np.random.default_rng(0))
    both, name = (
        weight_removed(Outcomes.of(task_for(*models, goal=goal), samples, actions))
        for goal in ("both", "object")
    )
    assert (name <= both + 1e-6).all()
    assert (name < both - 0.05).any()
    assert set(GOALS) == {"object", "pose", "both"}


def test_the_rate_is_information_over_a_hand_made_time():
    samples = rivals_at_both_ends()
    task = task_for()
    policy = Rate(task, travel_speed=0.5, probe_speed=0.01, probe_length=0.02, thinking=0.3)
    outcomes = Outcomes.of(task, samples, np.array([[0.1, -0.2, 0.3]]))
    observation = observation_of(samples, sent=3)
    observation["ray_starts"][2] = (0.1, 0.0, 0.2)
    starts = outcomes.rays.starts_world[0]
    depths = outcomes.predictions.depths[:, 0].mean(axis=0)
    way = np.linalg.norm(starts[0] - (0.1, 0.0, 0.2))
    way += np.linalg.norm(starts[1] - starts[0]) + np.linalg.norm(starts[2] - starts[1])
    way += sum(2.0 * depth - 0.02 for depth in depths)
    expected = way / 0.5 + 3 * 0.02 / 0.01 + 0.3
    assert policy.seconds(observation, outcomes)[0] == pytest.approx(expected)


@pytest.mark.parametrize(
    ("name", "value"), [("travel_speed", 0.0), ("probe_speed", -1.0), ("probe_length", -0.1)]
)
def test_a_speed_that_is_none_is_refused(name, value):
    with pytest.raises(ValueError, match=name):
        Rate(task_for(), **{name: value})


def test_the_chain_rule_takes_the_family_out_of_what_is_told():
    """Three poses of one hypothesis and two of another: by hand, bin by bin."""
    outcomes = random_outcomes(np.random.default_rng(12), count=5, probes=6)
    families = np.array([0, 0, 0, 1, 1])
    samples = replace(outcomes.samples, hypotheses=families)
    outcomes = replace(outcomes, samples=samples)
    w, p, left = outcomes.weights, outcomes.chances, outcomes.left.astype(float)
    gains = gain_of_hypotheses(outcomes)
    assert gains.shape == (6,)
    for a, told in enumerate(gains):
        by_hand = 0.0
        for i in range(5):
            own = np.flatnonzero(families == families[i])
            within = sum(w[j] * left[a, i, j] for j in own) / w[own].sum()
            by_hand -= p[i] * np.log(sum(w[j] * left[a, i, j] for j in range(5)) / within)
        assert told == pytest.approx(by_hand, abs=1e-5)
