"""The tree with constraints on triples too, grown in blocks (memo, Section 2.1)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..contacts.contacts import Contacts
from ..tables.triples import TripleTables
from . import tree_kernels, triple_tree_kernels

BLOCK = 1 << 15
"""Interpretations grown at a time: the search stays depth-first, and memory small."""

Ints = NDArray[np.int64]


def grow_by_triples(
    triples: TripleTables,
    contacts: Contacts,
    prefixes: NDArray[np.int32],
    domains: NDArray[np.uint64],
    masks: NDArray[np.uint64],
    stop: int,
    budget: int,
    nodes: Ints,
    *,
    angles: bool,
    areas: bool,
) -> tuple[NDArray[np.int32], bool]:
    """Extend interpretations as `tree_kernels.grow` does, but only by possible triangles.

    Blocks of interpretations are grown level by level, the first block to the end before the next,
    so the leaves come in the order in which `grow` finds them.

    Args:
        triples: the model's ranges.
        contacts: what was felt, in the order of the search.
        prefixes: (m, k) a face for each of the first k contacts, their own triangles checked.
        domains: as of `tree_kernels.grow`, as are `masks` and `stop`.
        masks: see there.
        stop: how many contacts to reach.
        budget: the most interpretations to return.
        nodes: (n,) interpretations alive at each level after the filter, added to in place.
        angles: whether to look at the angles of triangles.
        areas: whether to look at their areas.

    Returns:
        (m', stop) interpretations, and whether that is all of them.
    """
    faces = masks.shape[2]
    most = max(1, BLOCK // faces)
    leaves, found = [np.zeros((0, stop), np.int32)], 0
    waiting = _blocks(_with_future(prefixes, domains, masks, stop), most)
    ignored = np.zeros_like(nodes)
    while waiting:
        block = waiting.pop()
        level = block.shape[1]
        rows, _ = tree_kernels.grow(
            block, domains, masks, level + 1, len(block) * faces + 1, ignored
        )
        rows = rows[triples.possible(rows, contacts, angles=angles, areas=areas)]
        nodes[level] += len(rows)
        if level + 1 < stop:
            waiting += _blocks(_with_future(rows, domains, masks, stop), most)
            continue
        leaves.append(rows[: budget - found])
        if found + len(rows) > budget:
            return np.concatenate(leaves), False
        found += len(rows)
    return np.concatenate(leaves), True


def _with_future(
    rows: NDArray[np.int32], domains: NDArray[np.uint64], masks: NDArray[np.uint64], stop: int
) -> NDArray[np.int32]:
    """Rows that leave a face to each contact below ``stop``; `grow` looks ahead one level here."""
    keep = np.ones(len(rows), np.bool_)
    triple_tree_kernels.look_ahead(rows, domains, masks, stop, keep)
    return rows[keep]


def _blocks(rows: NDArray[np.int32], most: int) -> list[NDArray[np.int32]]:
    """Blocks of at most ``most`` rows, the last rows first."""
    return [rows[first : first + most] for first in range(0, len(rows), most)][::-1]
