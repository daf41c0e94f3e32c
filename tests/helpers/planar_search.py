"""The search of an outline that tests name."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from oracles.outlines import entry

from palpate.recognizer import (
    Constraints,
    Contacts,
    Hypothesis,
    PoseTolerance,
    Search,
    SearchLimits,
)
from palpate.recognizer.beliefs.outline import search_polygon


def search(
    name: str, contacts: Contacts, **limits: int
) -> tuple[list[Hypothesis], NDArray[np.float64], Search]:
    """What is found of an outline with the usual constraints, see `search_polygon`."""
    return search_polygon(
        entry(name), contacts, Constraints(), PoseTolerance(), SearchLimits(**limits)
    )
