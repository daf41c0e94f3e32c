"""Beliefs, looked through."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from palpate.recognizer import Belief, Hypothesis


def holder(
    belief: Belief, faces: NDArray[np.integer], object_name: str | None = None
) -> Hypothesis | None:
    """The hypothesis, of an object or of any, that has an interpretation among its own."""
    for hypothesis in belief.hypotheses:
        own = object_name in (None, hypothesis.object_name)
        if own and (hypothesis.interpretations == faces).all(axis=1).any():
            return hypothesis
    return None


def interpretations_of(belief: Belief) -> set[tuple[int, ...]]:
    """The interpretations of all hypotheses, whatever object they are of."""
    return {
        tuple(row)
        for hypothesis in belief.hypotheses
        for row in hypothesis.interpretations.tolist()
    }
