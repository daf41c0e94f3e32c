"""The interpretation tree of a belief, recounted: which constraint cut how many branches where.

The recogniser's own search counts nodes, but not which constraint ended a branch: it asks all of
them at once, looks ahead, and asks for poses early. Here the tree is grown again over the same
contacts in the same order, breadth-first and by pairs alone: each live branch is paired with every
feature of the model, and a branch that dies is counted under the first constraint that it breaks,
in the order of `CUTS`. What the pairs leave and the belief hasn't is what fits no pose.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from ...recognizer import Belief, Constraints, Contacts
from ...recognizer.poses.entry import SolidEntry
from ...recognizer.tree.tree import spread_order
from ...recognizer.tree.tree_kernels import pair_masks

__all__ = ["CUTS", "MOST_LIVE", "Level", "TreeCount", "count_branches"]

CUTS = ("kind", "distance", "angle", "component", "tilt")
"""What ends a branch: the contact is on another kind of feature; then the constraints on pairs."""
MOST_LIVE = 20_000
"""Live branches of one model beyond which its tree is not counted further."""
MOST_BYTES = 1 << 26
"""Of one constraint's masks; so many contacts are counted."""
CHUNK = 4096
"""Branches that are grown at a time."""

Bits = NDArray[np.uint64]


@dataclass(frozen=True, eq=False)
class Level:
    """One contact's level of a model's tree.

    Attributes:
        contact: the number of the contact, as it was given.
        tried: live branches of the level above, times the features (and the null face).
        cut: of `CUTS`, how many of them each ended.
        left: live branches.
        parents: (left,) the live branch above that each grew from.
        killers: what ended the most children of each branch above, as an index of `CUTS`.
    """

    contact: int
    tried: int
    cut: tuple[int, ...]
    left: int
    parents: NDArray[np.int64]
    killers: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class TreeCount:
    """A model's tree over a belief's contacts.

    Attributes:
        object_name: the model's.
        levels: in the order of the search; fewer than contacts if not ``whole``.
        whole: whether the levels go down to the last contact.
        fits: (left of the last level,) which of them the belief holds; empty if not ``whole``.
        held: interpretations of this model in the belief.
        hypotheses: of this model in the belief.
    """

    object_name: str
    levels: tuple[Level, ...]
    whole: bool
    fits: NDArray[np.bool_]
    held: int
    hypotheses: int


def count_branches(belief: Belief) -> tuple[TreeCount, ...]:
    """The trees of a belief, one a solid of its library, in that order.

    Args:
        belief: of solids, by a recogniser with the constraints that it has unless told otherwise.
    """
    order = spread_order(belief.contacts)
    return tuple(_count(entry, belief, order) for entry in belief.library.solids)


def _count(entry: SolidEntry, belief: Belief, order: NDArray[np.intp]) -> TreeCount:
    own = [one for one in belief.hypotheses if one.object_name == entry.model.name]
    held = [row[order].tobytes() for one in own for row in one.interpretations]
    contacts = belief.contacts[order].facing_approach()
    words = -(-len(entry.features) // 64)
    most = int(np.sqrt(MOST_BYTES / (8 * words * (len(entry.features) + 1))))
    tree = _Tree(entry, contacts[: max(most, 2)], Constraints(), belief.outliers)
    levels = []
    while tree.depth < len(tree.contacts) and len(tree.live) <= MOST_LIVE:
        levels.append(tree.grow(int(order[tree.depth])))
    whole = tree.depth == len(contacts)
    known = set(held)
    fits = np.array([row.tobytes() in known for row in tree.live] if whole else [], bool)
    return TreeCount(entry.model.name, tuple(levels), whole, fits, len(held), len(own))


class _Tree:
    """One model's live branches, a level at a time."""

    def __init__(
        self, entry: SolidEntry, contacts: Contacts, constraints: Constraints, outliers: int
    ) -> None:
        self.contacts = contacts
        self.depth = 0
        self.live = np.zeros((1, 0), np.int32)
        self._size = len(entry.features)
        self._outliers = outliers
        domains = entry.by_kind[contacts.kinds]
        self._domains = domains
        self._masks = [
            _masks(entry, contacts, domains, bits) if constraints.bits & bits else None
            for bits in (1, 2, 4, 8)  # as `Constraints.bits` has them, in the order of `CUTS`
        ]

    def grow(self, contact: int) -> Level:
        """Pair the next contact with every feature."""
        parts = [
            self._grow(np.arange(first, min(first + CHUNK, len(self.live))))
            for first in range(0, len(self.live), CHUNK)
        ]
        none = (np.zeros((0, self.depth + 1), np.int32), np.zeros(0, np.int64))
        live = np.concatenate([none[0], *(part[0] for part in parts)])
        parents = np.concatenate([none[1], *(part[1] for part in parts)])
        cut = np.concatenate([np.zeros((0, len(CUTS)), np.int64), *(part[2] for part in parts)])
        nulls = int((self._nulls(self.live) < self._outliers).sum())
        tried = len(self.live) * self._size + nulls
        self.live = live
        self.depth += 1
        total = tuple(int(number) for number in cut.sum(axis=0))
        return Level(contact, tried, total, len(live), parents, cut.argmax(axis=1))

    def _grow(
        self, rows: NDArray[np.intp]
    ) -> tuple[NDArray[np.int32], NDArray[np.int64], NDArray[np.int64]]:
        """Children of some branches, their parents, and what each branch lost to each cut."""
        branches, level = self.live[rows], self.depth
        bits = np.tile(self._domains[level], (len(rows), 1))
        counts = [np.full(len(rows), self._size), np.bitwise_count(bits).sum(axis=1)]
        for masks in self._masks:
            if masks is not None:
                for before in range(level):
                    # The last row, that of -1, allows everything.
                    bits &= masks[before, level, branches[:, before]]
            counts.append(np.bitwise_count(bits).sum(axis=1))
        cut = -np.diff(np.array(counts, np.int64), axis=0).T
        flags = np.unpackbits(bits.view(np.uint8), axis=1, bitorder="little")[:, : self._size]
        parent, face = np.nonzero(flags)
        extra = np.flatnonzero(self._nulls(branches) < self._outliers)
        parent = np.concatenate([parent, extra])
        face = np.concatenate([face, np.full(len(extra), -1)]).astype(np.int32)
        by_parent = np.argsort(parent, kind="stable")
        parent, face = parent[by_parent], face[by_parent]
        return np.hstack([branches[parent], face[:, None]]), rows[parent], cut

    @staticmethod
    def _nulls(branches: NDArray[np.int32]) -> NDArray[np.int64]:
        return (branches < 0).sum(axis=1)


def _masks(entry: SolidEntry, contacts: Contacts, domains: Bits, constraint: int) -> Bits:
    """(n, n, f + 1, w) pair masks of one constraint; the last feature stands for none."""
    tables, count, words = entry.tables, len(contacts), domains.shape[1]
    masks = np.zeros((count, count, len(entry.features) + 1, words), np.uint64)
    masks[:, :, -1] = ~np.uint64(0)
    two = np.zeros((2, 2, len(entry.features), words), np.uint64)
    # Pair by pair: of more at a time the kernel leaves out what a third contact excludes, which
    # isn't excluded where that one may be on nothing.
    for first, second in combinations(range(count), 2):
        pair = [first, second]
        pair_masks(
            contacts.positions[pair],
            contacts.normals[pair],
            contacts.position_error[pair],
            contacts.normal_error[pair],
            tables.distance_min,
            tables.distance_max,
            tables.angle,
            tables.component_min,
            tables.component_max,
            tables.tilt_min,
            tables.tilt_max,
            domains[pair],
            0,
            constraint,
            two,
        )
        masks[first, second, :-1] = two[0, 1]
    return masks
