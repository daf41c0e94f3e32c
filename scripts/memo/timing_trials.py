"""Trials of the memo's Section 7: what it takes to prune the tree and to test what it leaves."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from ...assets.memo import timing
from ...envs.library import load_library
from ...envs.sensors.grid import sense_grid
from ...recognizer import PairTables, Polyhedron, Recognizer
from ...recognizer.poses.fits.pose import ModelTest
from ...recognizer.tree.tree import prune
from ..timed import timed
from .noise import noise_of

Floats = NDArray[np.float64]

WARM_UP = 3
"""Trials that a process does before its clock starts."""
COLUMNS = 5
COUNTED, PRUNED, TESTED, KEPT, RECOGNIZED = range(COLUMNS)
"""Of a trial: interpretations that the tree leaves; seconds to prune and to test; interpretations
that the tests leave; seconds of the recogniser, which does both at once."""


@dataclass(frozen=True)
class Trials:
    """Some trials at one pair of bounds."""

    pi_over: int
    inches: float
    seed: int
    first: int
    count: int


@dataclass(frozen=True, eq=False)
class Times:
    """What some trials took."""

    rows: Floats
    """(t, 5) see `COUNTED` and what follows it."""
    lost: int
    """Trials in which the tree or the model test dropped the right interpretation."""


def measure_times(case: Trials) -> Times:
    """Prune, test and recognise some trials, by the processor's clock."""
    prepared = _prepared()
    rows = np.empty((case.count, COLUMNS))
    lost = 0
    for number in range(case.count):
        rng = np.random.default_rng([case.seed, case.first + number])
        rows[number], kept = prepared.measure(case.pi_over, case.inches, rng)
        lost += not kept
    return Times(rows, lost)


@dataclass(frozen=True, eq=False)
class Prepared:
    """The object with all that is built of it once."""

    model: Polyhedron
    tables: PairTables
    test: ModelTest
    recognizer: Recognizer

    def measure(self, pi_over: int, inches: float, rng: np.random.Generator) -> tuple[Floats, bool]:
        """Times of a trial, see `Times`, and whether the right interpretation was kept."""
        truth = sense_grid(self.model, rng)
        contacts = truth.noisy(noise_of(pi_over, inches), rng)
        pruned, prune_seconds = timed(prune, self.tables, contacts)
        poses, test_seconds = timed(self.test.run, pruned.faces, contacts)
        _, seconds = timed(self.recognizer.recognize, contacts)
        kept = bool((poses.faces == truth.faces).all(axis=1).any())
        counts = len(pruned.faces), len(poses)
        return np.array([counts[0], prune_seconds, test_seconds, counts[1], seconds]), kept


@cache
def _prepared() -> Prepared:
    memo = timing()
    (model,) = load_library([memo.object_name])
    prepared = Prepared(model, PairTables.of(model), ModelTest(model), Recognizer([model]))
    for number in range(WARM_UP):
        prepared.measure(memo.pi_over, memo.position_error_in, np.random.default_rng(number))
    return prepared
