"""Which poses of a belief need to be told apart, and which are as good as one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ...recognizer.predict.prediction import PoseSamples
from .task import Task

Floats = NDArray[np.float64]


def same_answer(task: Task, samples: PoseSamples) -> NDArray[np.bool_]:
    """Pairs of samples between which the goal makes no difference.

    If the goal is the object's name, those of one object; else those of one object whose poses are
    within the tolerance of each other, up to the object's symmetries, as the recogniser has it.

    Returns:
        (s, s), symmetric.
    """
    same = samples.objects[:, None] == samples.objects
    if task.goal == "object":
        return same
    for number in np.unique(samples.objects):
        rows = np.flatnonzero(samples.objects == number)
        model = samples.models[number]
        turns = Rotation.from_quat(samples.rotations[rows])
        centres = turns.apply(model.centroid.copy()) + samples.positions[rows]
        most_shift = task.tolerance.distance(model.diameter, task.position_error)
        apart = np.linalg.norm(centres[:, None] - centres, axis=2)
        # Quaternions of two rotations half an angle h apart have |q . p| = cos h.
        symmetries = Rotation.from_matrix(model.symmetries)
        images = np.array([(turns * symmetry).as_quat() for symmetry in symmetries])
        alike = np.abs(images @ turns.as_quat().T).max(axis=0)
        near = (alike >= np.cos(0.5 * task.tolerance.rotation)) & (apart <= most_shift)
        same[np.ix_(rows, rows)] = near | near.T
    return same


def answers(same: NDArray[np.bool_], weights: Floats) -> NDArray[np.int64]:
    """(s,) which answer each sample stands for: that of the heaviest that is the same as it.

    Args:
        same: (s, s) as of `same_answer`.
        weights: (s,) shares of the belief.
    """
    found = np.full(len(weights), -1)
    number = 0
    for row in np.argsort(-weights, kind="stable"):
        if found[row] < 0:
            found[same[row] & (found < 0)] = number
            number += 1
    return found


def leading_rows(samples: PoseSamples, most: int) -> NDArray[np.int64]:
    """The first sample of each of the heaviest hypotheses, heaviest hypothesis first."""
    numbers, first, own = np.unique(samples.hypotheses, return_index=True, return_inverse=True)
    total = np.bincount(own, samples.weights, len(numbers))
    return first[np.argsort(-total, kind="stable")[:most]]


def thinned(samples: PoseSamples, most: int) -> PoseSamples:
    """At most so many of the samples: the first of each hypothesis, heaviest first, then the rest.

    What is left of a hypothesis stands for all of it.
    """
    count = len(samples)
    if count <= most:
        return samples
    leads = leading_rows(samples, most)
    others = np.setdiff1d(np.arange(count), leads)
    # Evenly over what is left: a family's samples come in the order in which it was walked.
    places = np.linspace(0, len(others) - 1, most - len(leads)).round().astype(int)
    return taken(samples, np.sort(np.concatenate([leads, others[places]])))


def taken(samples: PoseSamples, rows: NDArray[np.int64]) -> PoseSamples:
    """Some of the samples; each hypothesis among them keeps its share of the belief."""
    numbers, own = np.unique(samples.hypotheses, return_inverse=True)
    total = np.bincount(own, samples.weights, len(numbers))
    left = np.bincount(own[rows], samples.weights[rows], len(numbers))
    weights = samples.weights[rows] * total[own[rows]] / left[own[rows]]
    return replace(
        samples,
        objects=samples.objects[rows],
        hypotheses=samples.hypotheses[rows],
        positions=samples.positions[rows],
        rotations=samples.rotations[rows],
        weights=weights / weights.sum(),
        position_spread=samples.position_spread[rows],
        rotation_spread=samples.rotation_spread[rows],
    )
