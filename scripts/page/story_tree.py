"""Counted trees as a page draws them: numbers of each level, and a sample of the branches."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from .tree_count import CUTS, TreeCount

__all__ = ["MOST_DRAWN", "tree_document"]

MOST_DRAWN = 160
"""Branches drawn of one level of all trees together."""
FEWEST_DRAWN = 8
"""Of one model's tree."""
MOST_LEVELS = 30
"""Levels drawn; more contacts hardly change what is left."""

Ints = NDArray[np.int64]


def tree_document(trees: Sequence[TreeCount]) -> list[dict[str, object]]:
    """Trees as the page reads them, one a model.

    ``levels`` has a row a contact: its number, branches tried, each cut, and what is left. In
    ``drawn`` stand, a level, for the branches drawn: the place of its parent among those drawn
    above, and what ended most of its children (an index of `CUTS`; -1 where nothing did).
    """
    share = max(MOST_DRAWN // max(len(trees), 1), FEWEST_DRAWN)
    return [
        {
            "levels": [
                [level.contact, level.tried, *level.cut, level.left]
                for level in tree.levels[:MOST_LEVELS]
            ],
            "unseen": max(len(tree.levels) - MOST_LEVELS, 0),
            "whole": tree.whole,
            "left": tree.levels[-1].left if tree.levels else 0,
            "held": tree.held,
            "hypotheses": tree.hypotheses,
            "drawn": _drawn(tree, share),
        }
        for tree in trees
    ]


def _drawn(tree: TreeCount, most: int) -> list[list[list[int]]]:
    """A sample of each level's branches that has the ancestors of all it has."""
    levels = tree.levels[:MOST_LEVELS]
    kept: list[Ints] = []
    needed = np.zeros(0, np.int64)
    if tree.whole and len(levels) == len(tree.levels):
        needed = np.flatnonzero(tree.fits)[:most]
    for level in reversed(levels):
        room = max(most - len(needed), 0)
        spread = np.linspace(0, level.left - 1, min(room, level.left)).astype(np.int64)
        rows = np.union1d(needed, spread)
        kept.append(rows)
        needed = np.unique(level.parents[rows])
    kept.reverse()
    drawn = []
    above = np.zeros(1, np.int64)
    for number, (level, rows) in enumerate(zip(levels, kept, strict=True)):
        parents = np.searchsorted(above, level.parents[rows])
        drawn.append([parents.tolist(), _endings(tree, number, rows)])
        above = rows
    return drawn


def _endings(tree: TreeCount, number: int, rows: Ints) -> list[int]:
    """What ended the branches of a level: -1 where they go on, ``len(CUTS)`` where no pose fits."""
    if number + 1 < len(tree.levels):
        below = tree.levels[number + 1]
        childless = np.bincount(below.parents, minlength=tree.levels[number].left) == 0
        return np.where(childless, below.killers, -1)[rows].tolist()
    if tree.whole:
        return np.where(tree.fits, -1, len(CUTS))[rows].tolist()
    return [-1] * len(rows)
