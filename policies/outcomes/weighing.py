"""How the strategies come to a probe: candidates, what they would tell, the best by a formula."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...recognizer.predict.prediction import PoseSamples
from .candidates import aimed_actions, spread_actions
from .outcomes import Outcomes
from .paths import agreement
from .pose_information import PlacedModel, gain_to_tolerance, known, promised
from .rivals import leading_rows, taken, thinned
from .task import Observation, Task

Floats = NDArray[np.float64]

Formula = Callable[[Outcomes], Floats]
"""The worth of each of a number of probes; the largest is chosen."""

TELLS_NOTHING = 0.02
"""A probe that leaves all but this share of the belief, whatever is true, tells nothing apart."""

LEADING = 4
"""Of how many hypotheses, at most, the pose is thought through to a precision."""

EVEN = 0.25
"""Share of the weights that all hypotheses have alike."""
SETTLED = 5.0
"""Standard deviations in the pose tolerance at which episodes mostly end."""


@dataclass(frozen=True, kw_only=True)
class Budget:
    """How much a strategy thinks through for a probe."""

    samples: int = 64
    """The most poses held against each other."""
    comparisons: int = 600_000
    """About how many times a report is held against a pose, which sets the number of probes ..."""
    predictions: int = 16_000
    """About how many reports are predicted, which limits it as well; ..."""
    fewest: int = 96
    """... but it is no fewer than this, ..."""
    most: int = 600
    """... and no more."""
    explanations: int = 40_000
    """About how many times a pose is searched for a face that explains a report, which sets how
    many of the best probes are looked at thoroughly, ..."""
    fewest_thorough: int = 8
    """... no fewer than this."""

    def shortlist(self, samples: int) -> int:
        """How many of the best probes to look at thoroughly."""
        return max(self.explanations // samples**2, self.fewest_thorough)

    def probes(self, samples: int) -> int:
        """How many candidates to weigh against a number of poses."""
        return int(
            np.clip(
                min(self.comparisons // samples**2, self.predictions // samples),
                self.fewest,
                self.most,
            )
        )


def as_action(action: Floats) -> NDArray[np.float32]:
    """(3,) as environments take it."""
    return np.clip(action, -1.0, 1.0).astype(np.float32)


def random_action(rng: np.random.Generator) -> NDArray[np.float32]:
    """(3,) a triad anywhere in the workspace, at any yaw, uniformly (memo, Section 4.4)."""
    return rng.uniform(-1.0, 1.0, 3).astype(np.float32)


def candidates(task: Task, samples: PoseSamples, count: int, rng: np.random.Generator) -> Floats:
    """(count, 3) probes worth weighing: half spread evenly, half aimed at poses of the belief."""
    aimed = aimed_actions(task.space, samples, count // 2, rng)
    return np.concatenate([aimed, spread_actions(count - len(aimed), rng)])


def best_probe(
    task: Task,
    observation: Observation,
    rng: np.random.Generator,
    formula: Formula,
    *,
    least: float = TELLS_NOTHING,
    budget: Budget | None = None,
) -> NDArray[np.float32]:
    """The probe that a formula likes best.

    All candidates are weighed quickly, and the best of them again, thoroughly: what looks like
    telling much at first may be an edge that either of two faces explains (`Outcomes.thorough`).

    Before the first contact the probe is a random one. Where no candidate tells answers apart, it
    is the one that best fixes what the contacts leave open of the pose (`settling_probe`).

    Args:
        task: what is public of the episode.
        observation: what has been observed.
        rng: source of randomness.
        formula: the worth of probes.
        least: the least worth at which a probe tells answers apart.
        budget: how much to think through.
    """
    budget = budget or Budget()
    samples = weighed(task, observation, budget)
    if not len(samples):
        return random_action(rng)
    actions = candidates(task, samples, budget.probes(len(samples)), rng)
    chances = chances_of(task, observation, samples)
    outcomes = Outcomes.of(task, samples, actions, chances)
    worth = formula(outcomes)
    short = np.argsort(-worth, kind="stable")[: budget.shortlist(len(samples))]
    if worth[short[0]] < least:
        return settling_probe(task, observation, rng)
    worth = formula(outcomes.thoroughly(short))
    best = int(np.argmax(worth))
    if worth[best] < least:
        return settling_probe(task, observation, rng)
    return as_action(actions[short[best]])


def weighed(task: Task, observation: Observation, budget: Budget) -> PoseSamples:
    """The samples that strategies reckon with: not too many, and no rival too light to matter.

    A share of the weights is the same for every hypothesis, the rest is that of the belief: an
    episode ends when no rival is left, however unlikely.
    """
    return evened(thinned(task.samples(observation), budget.samples))


def evened(samples: PoseSamples) -> PoseSamples:
    """Samples of which no hypothesis weighs next to nothing: `EVEN` of the weights is shared."""
    if not len(samples):
        return samples
    numbers, own, count = np.unique(samples.hypotheses, return_inverse=True, return_counts=True)
    total = np.bincount(own, samples.weights, len(numbers))
    share = np.where(
        total[own] > 0.0, samples.weights / np.maximum(total[own], 1e-300), 1.0 / count[own]
    )
    return replace(samples, weights=(1.0 - EVEN) * samples.weights + EVEN * share / len(numbers))


def chances_of(task: Task, observation: Observation, samples: PoseSamples) -> Floats:
    """(s,) how likely each sample is the true one: its weight, and what the rays went through."""
    chances = samples.weights * agreement(task, observation, samples)
    return chances / chances.sum()


def settling_probe(
    task: Task,
    observation: Observation,
    rng: np.random.Generator,
    worth_of: Callable[[Observation, Outcomes], Floats] | None = None,
) -> NDArray[np.float32]:
    """The probe whose contacts tell most about the leading hypotheses' poses.

    Where no candidate touches the object by any of them, a random probe.

    Args:
        task: what is public of the episode.
        observation: what has been observed.
        rng: source of randomness.
        worth_of: the worth of probes; `precision` if not given.
    """
    samples = task.samples(observation)
    samples = taken(samples, leading_rows(samples, LEADING))
    if not len(samples):
        return random_action(rng)
    actions = candidates(task, samples, Budget().probes(len(samples)), rng)
    outcomes = Outcomes.of(task, samples, actions, chances_of(task, observation, samples))
    worth = (worth_of or precision)(observation, outcomes)
    best = int(np.argmax(worth))
    return as_action(actions[best]) if worth[best] > 0.0 else random_action(rng)


def precision(observation: Observation, outcomes: Outcomes) -> Floats:
    """(a,) expected nats about the pose within a hypothesis, down to the task's tolerance.

    The recogniser holds a motion for open if some pose within the bounds is beyond the tolerance:
    as long as that is about `SETTLED` standard deviations or less.
    """

    def told(placed: PlacedModel, before: Floats, added: Floats) -> Floats:
        task = outcomes.task
        shift = task.tolerance.distance(placed.model.diameter, task.position_error)
        fine = min(shift, task.tolerance.rotation * placed.radius) / SETTLED
        return gain_to_tolerance(before, added, fine)

    return expected_gain(observation, outcomes, told)


def expected_gain(
    observation: Observation,
    outcomes: Outcomes,
    measure: Callable[[PlacedModel, Floats, Floats], Floats],
) -> Floats:
    """(a,) a measure of what is known before and of what probes add, over the heaviest hypotheses.

    Args:
        observation: has the contacts so far.
        outcomes: what is predicted.
        measure: takes a placed model, (6, 6) and (a, 6, 6) information.
    """
    samples, worth = outcomes.samples, np.zeros(len(outcomes.actions))
    rows = leading_rows(samples, LEADING)
    shares = np.array(
        [outcomes.chances[samples.hypotheses == samples.hypotheses[row]].sum() for row in rows]
    )
    for row, share in zip(rows, shares / max(shares.sum(), 1e-300), strict=True):
        placed = PlacedModel.of(samples, row)
        before = known(observation, placed)
        added = promised(outcomes.task, placed, outcomes.predictions, row, outcomes.rays)
        worth += share * measure(placed, before, added)
    return worth
