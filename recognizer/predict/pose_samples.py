"""Poses that stand for a belief: what strategies think through before they choose a probe."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ..belief import Belief
from ..beliefs.hypotheses import Hypothesis
from ..models.polyhedron import Polyhedron
from .families import spread_families
from .prediction import PoseSamples

MOST_OF_ONE = 64
"""The most samples of one hypothesis."""
EXPLORED = 4
"""The fewest poses of a family that are looked at to say how far it spreads."""

Floats = NDArray[np.float64]
Rows = NDArray[np.int64]


def sample_belief(belief: Belief, models: Sequence[Polyhedron], most: int) -> PoseSamples:
    """Poses that stand for a belief, in the order of its hypotheses; always the same.

    Each hypothesis has its own pose, the heaviest first while there is room. What room is left goes
    to those with open freedoms, by weight, `MOST_OF_ONE` each at most: poses drawn from all over
    their families, each allowed by the contacts (see `families`). So samples weigh about the same,
    and a sum over them is one over what the contacts allow. A hypothesis's samples share its weight
    equally.

    The spreads say how far the poses that a sample stands for lie around it. Along what the
    contacts fix, that is the hypothesis's covariance. Of a family it is how its poses scatter about
    the hypothesis's own, of which ``n`` samples along ``d`` freedoms leave ``n^(-1/d)``, a cell's
    width. So a sample that has to stand alone for a wide family predicts little with certainty, and
    says so: no strategy then takes two families for told apart by a probe that may not do so.

    Args:
        belief: what the contacts allow.
        models: the library, in the order that ``objects`` counts in.
        most: the most samples.

    Raises:
        ValueError: room for no sample at all.
    """
    if most < 1:
        raise ValueError(f"most is {most}; there must be room for a sample")
    kept = belief.hypotheses[:most]
    if not kept:
        return PoseSamples.none(models)
    weights = np.array([hypothesis.weight for hypothesis in kept])
    freedoms = np.array([len(hypothesis.freedoms) for hypothesis in kept])
    counts = _shares(weights, freedoms > 0, most)
    looked_at = np.where(freedoms > 0, np.maximum(counts, EXPLORED), 1)
    rotations, positions = _poses(belief, kept, looked_at)
    index = {model.name: row for row, model in enumerate(models)}
    objects = np.array([index[hypothesis.object_name] for hypothesis in kept])
    centroids = np.array([model.centroid for model in models])[objects]
    radii = np.array([0.5 * model.diameter for model in models])[objects]
    shifts, turns = _scatter(rotations, positions, centroids, looked_at)
    unresolved = counts ** (-2.0 / np.maximum(freedoms, 1))
    fixed_shifts, fixed_turns = _fixed(kept, radii)
    shown = np.arange(len(positions)) - np.repeat(_firsts(looked_at), looked_at) < np.repeat(
        counts, looked_at
    )
    each = np.repeat(np.arange(len(kept)), counts)
    return PoseSamples(
        tuple(models),
        objects[each],
        each,
        positions[shown],
        Rotation.from_matrix(rotations[shown]).as_quat(canonical=True),
        (weights / counts / weights.sum())[each],
        np.sqrt(fixed_shifts + unresolved * shifts)[each],
        np.sqrt(fixed_turns + unresolved * turns)[each],
    )


def _shares(weights: Floats, is_open: NDArray[np.bool_], most: int) -> Rows:
    """(h,) how many samples each hypothesis has: one, and by weight of what room is left."""
    counts = np.ones(len(weights), np.int64)
    wanted = np.where(is_open, weights, 0.0)
    if wanted.sum() > 0.0:
        extra = (most - len(weights)) * (wanted / wanted.sum())
        counts += np.minimum(extra.astype(np.int64), MOST_OF_ONE - 1)
    return counts


def _firsts(counts: Rows) -> Rows:
    """(h,) where the poses of each hypothesis start."""
    return np.cumsum(counts) - counts


def _poses(belief: Belief, hypotheses: Sequence[Hypothesis], counts: Rows) -> tuple[Floats, Floats]:
    """(k, 3, 3) rotations and (k, 3) positions, so many of each hypothesis, its own first."""
    own = np.array([hypothesis.T_world_object for hypothesis in hypotheses])
    each = np.repeat(np.arange(len(hypotheses)), counts)
    rotations, positions = own[each, :3, :3], own[each, :3, 3]
    families = np.flatnonzero(counts > 1)
    if len(families):
        of_family = counts[each] > 1
        rotations[of_family], positions[of_family] = spread_families(
            belief, families, counts[families]
        )
    return rotations, positions


def _scatter(
    rotations: Floats, positions: Floats, centroids: Floats, counts: Rows
) -> tuple[Floats, Floats]:
    """(h,) mean squares, along an axis, of shift and turn of each family about its first pose."""
    firsts = _firsts(counts)
    first = np.repeat(firsts, counts)
    centres = positions + (rotations @ np.repeat(centroids, counts, axis=0)[:, :, None])[:, :, 0]
    shifts = ((centres - centres[first]) ** 2).sum(axis=1)
    # The Frobenius norm of the difference of two rotations is sqrt(8) sin(angle / 2).
    chords = np.sqrt(((rotations - rotations[first]) ** 2).sum(axis=(1, 2)) / 8.0)
    turns = (2.0 * np.arcsin(np.minimum(chords, 1.0))) ** 2
    others = 3.0 * np.maximum(counts - 1, 1)
    return np.add.reduceat(shifts, firsts) / others, np.add.reduceat(turns, firsts) / others


def _fixed(hypotheses: Sequence[Hypothesis], radii: Floats) -> tuple[Floats, Floats]:
    """(h,) mean variances, along an axis, of shift and turn but for the open freedoms."""
    variances = np.empty((len(hypotheses), 6))
    for row, hypothesis in enumerate(hypotheses):
        open_ways, covariance = hypothesis.freedoms, hypothesis.covariance
        # Freedoms are principal axes of the covariance.
        along = (open_ways @ covariance * open_ways).sum(axis=1)
        variances[row] = np.maximum(covariance.diagonal() - along @ open_ways**2, 0.0)
    return variances[:, 3:].mean(axis=1), variances[:, :3].mean(axis=1) / radii**2
