"""What a search did with one model: counts, and the time of each stage."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Search:
    """What the recogniser did with one model: counts and times of each stage."""

    object_name: str
    nodes: NDArray[np.int64]
    """(n,) branches seen at each level of the tree, in the order of the search."""
    pruned: int
    """Interpretations left by the tree, before the last model test."""
    tested: int
    """Interpretations left by the model test."""
    hypotheses: int
    """Distinct poses among them."""
    complete: bool
    """False if a budget ran out, so that hypotheses may be missing."""
    boxes: int
    """Boxes of rotations looked at for what one verdict left open."""
    search_seconds: float
    """Time for masks, tree and model tests."""
    cluster_seconds: float
    """Time for grouping."""

    @classmethod
    def none(cls, object_name: str, contacts: int) -> Search:
        """Of a model that was ruled out at once."""
        return cls(object_name, np.zeros(contacts, np.int64), 0, 0, 0, True, 0, 0.0, 0.0)
