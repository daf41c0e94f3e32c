"""The belief: every hypothesis the contacts allow, and how it was reached."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .hypotheses import Hypothesis


@dataclass(frozen=True, eq=False)
class Search:
    """What the recogniser did with one model: counts and times of each stage."""

    object_name: str
    nodes: NDArray[np.int64]
    """(n,) interpretations seen at each level of the tree, in the order of the search."""
    pruned: int
    """Interpretations left by the tree, before the last model test."""
    tested: int
    """Interpretations left by the model test."""
    hypotheses: int
    """Distinct poses among them."""
    complete: bool
    """False if the budget ran out, so that hypotheses may be missing."""
    tree_seconds: float
    """Time for masks and tree."""
    pose_seconds: float
    """Time for model tests."""
    cluster_seconds: float
    """Time for grouping."""


@dataclass(frozen=True, eq=False)
class Belief:
    """All (object, pose) hypotheses that the contacts allow, heaviest first.

    Empty means that the touched thing is not in the library, or that a bound is too tight.
    """

    hypotheses: tuple[Hypothesis, ...]
    searches: tuple[Search, ...]
    """One a model, in the library's order."""

    @property
    def complete(self) -> bool:
        """Whether every search ran to its end; if not, hypotheses may be missing."""
        return all(search.complete for search in self.searches)

    @property
    def empty(self) -> bool:
        """Whether no object of the library fits."""
        return not self.hypotheses

    @property
    def unique(self) -> bool:
        """Whether one hypothesis is left, with its pose fixed, and nothing was cut short."""
        return len(self.hypotheses) == 1 and self.hypotheses[0].determined and self.complete

    @property
    def interpretations(self) -> int:
        """How many interpretations there are in all."""
        return sum(len(hypothesis.interpretations) for hypothesis in self.hypotheses)
