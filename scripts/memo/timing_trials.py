"""Trials of the memo's Section 7: what it takes to prune the tree and to test what it leaves."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from ...assets.memo import timing
from ...envs.sensors.grid import sense_grid
from ...recognizer import Recognizer
from ...recognizer.tree.tree import prune
from ..timed import timed
from .plan import Trials
from .trial import Spec, prepared

Floats = NDArray[np.float64]

WARM_UP = 3
"""Trials that a process does before its clock starts."""
COLUMNS = 5
COUNTED, PRUNED, TESTED, KEPT, RECOGNIZED = range(COLUMNS)
"""Of a trial: interpretations that the tree leaves; seconds to prune and to test; interpretations
that the tests leave; seconds of the recogniser, which does both at once."""


@dataclass(frozen=True, eq=False)
class Times:
    """What some trials took."""

    rows: Floats
    """(t, 5) see `COUNTED` and what follows it."""
    lost: int
    """Trials in which the tree or the model test dropped the right interpretation."""


def measure_times(piece: Trials[Spec]) -> Times:
    """Prune, test and recognise some trials, by the processor's clock."""
    _warm_up()
    measured = [_measure(piece.row, rng) for rng in piece.generators()]
    rows = np.array([row for row, _ in measured])
    return Times(rows, sum(not kept for _, kept in measured))


def _measure(spec: Spec, rng: np.random.Generator) -> tuple[Floats, bool]:
    """Times of a trial, see `Times`, and whether the right interpretation was kept."""
    thing = prepared(spec.object_name)
    truth = sense_grid(thing.model, rng)
    contacts = truth.noisy(spec.noise(), rng)
    pruned, prune_seconds = timed(prune, thing.tables, contacts)
    poses, test_seconds = timed(thing.test, pruned.faces, contacts)
    _, seconds = timed(_recognizer(spec.object_name).recognize, contacts)
    kept = bool((poses.faces == truth.faces).all(axis=1).any())
    counts = len(pruned.faces), len(poses)
    return np.array([counts[0], prune_seconds, test_seconds, counts[1], seconds]), kept


@cache
def _recognizer(object_name: str) -> Recognizer:
    return Recognizer([prepared(object_name).model])


@cache
def _warm_up() -> None:
    """Let what happens once a process happen outside the clock."""
    for number in range(WARM_UP):
        _measure(Spec.of(timing()), np.random.default_rng(number))
