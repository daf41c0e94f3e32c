"""The interpretation tree: a face for each contact, pruned by pairs (memo, Section 2).

Level k of the tree pairs contact k with every face of the model. A branch lives while every two of
its pairings are possible together, which four constraints on pairs decide, and every three, if one
of two constraints on triples is asked for; each is an outer bound on what contacts inside their
error bounds can show, so the true interpretation is never pruned.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..contacts.contacts import EDGE, Contacts
from ..tables.planar_ranges import PlanarTables
from ..tables.ranges import PairTables
from . import planar_mask_kernels, tree_kernels
from .triple_tree import grow_by_triples

WORD = 64


@dataclass(frozen=True, kw_only=True)
class Constraints:
    """Which constraints on pairs and on triples of contacts prune the tree."""

    distance: bool = True
    """Distance between the contacts (Section 2.1.1)."""
    angle: bool = True
    """Angle between the normals (Section 2.1.2)."""
    component: bool = True
    """Component of the separation along either normal (Section 2.1.3, extended direction)."""
    tilt: bool = False
    """Angle of the separation against either normal (Section 2.1.3, simple direction).

    Off by default: `component` and `distance` together leave it little to do.
    """
    triple: bool = False
    """Angles of the triangle of any three contacts (Section 2.1.3, the alternative form).

    Needs no normals. Beside `distance` it knows in which direction one face lies from another.
    Off by default: with normals, `component` leaves it little to do.
    """
    area: bool = False
    """Area of the triangle of any three contacts (Section 2.1, named in passing).

    Needs no normals. It prunes where three distances fit pair by pair, but not together. Off by
    default, as `triple` is.
    """

    @property
    def bits(self) -> int:
        """The switches as the kernels read them."""
        return (
            tree_kernels.DISTANCE * self.distance
            + tree_kernels.ANGLE * self.angle
            + tree_kernels.COMPONENT * self.component
            + tree_kernels.TILT * self.tilt
        )


@dataclass(frozen=True, eq=False)
class Pruned:
    """What a search of the tree left."""

    faces: NDArray[np.int32]
    """(m, n) interpretations: a face for each contact, contacts as they were given."""
    nodes: NDArray[np.int64]
    """(n,) interpretations alive at each level, in the order of the search."""
    complete: bool
    """False if the budget ran out: then interpretations are missing."""


@dataclass(eq=False)
class InterpretationTree:
    """One model's tree over contacts in a fixed order, grown a few levels at a time."""

    tables: PairTables | PlanarTables
    contacts: Contacts
    constraints: Constraints
    nodes: NDArray[np.int64] = field(init=False)
    """(n,) interpretations seen at each level so far."""

    def __post_init__(self) -> None:
        count, faces = len(self.contacts), self.tables.face_count
        words = -(-faces // WORD)
        self.nodes = np.zeros(count, np.int64)
        self._all_faces = np.zeros(words, np.uint64)
        for face in range(faces):
            self._all_faces[face // WORD] |= np.uint64(1) << np.uint64(face % WORD)
        self._domains = np.tile(self._all_faces, (count, 1))
        self._masks = np.empty((count, count, faces, words), np.uint64)
        self._by_triples = self.constraints.triple or self.constraints.area
        if self._by_triples and isinstance(self.tables, PlanarTables):
            raise ValueError("the constraints triple and area are for polyhedra, not for outlines")

    def extend(
        self, prefixes: NDArray[np.int32], stop: int, budget: int
    ) -> tuple[NDArray[np.int32], bool]:
        """Extend interpretations of the first contacts to the first ``stop`` contacts.

        Args:
            prefixes: (m, k) a face for each of the first k contacts; (1, 0) is the root.
            stop: how many contacts to reach, more than k.
            budget: the most interpretations to return.

        Returns:
            (m', stop) interpretations, and whether they are all there are.
        """
        start = prefixes.shape[1]
        for level in range(start):
            # Later pairs matter only for faces that some surviving interpretation uses.
            self._domains[level] = _as_bits(prefixes[:, level], len(self._all_faces))
        tables, contacts = self.tables, self.contacts
        planar = isinstance(tables, PlanarTables)
        pair_masks = planar_mask_kernels.pair_masks if planar else tree_kernels.pair_masks
        pair_masks(
            contacts.positions[:stop],
            contacts.normals[:stop],
            contacts.position_error[:stop],
            contacts.normal_error[:stop],
            tables.distance_min,
            tables.distance_max,
            tables.angle,
            tables.component_min,
            tables.component_max,
            tables.tilt_min,
            tables.tilt_max,
            self._domains,
            start,
            self.constraints.bits,
            self._masks,
        )
        if self._by_triples and isinstance(tables, PairTables):
            return grow_by_triples(
                tables.triples,
                contacts,
                prefixes,
                self._domains,
                self._masks,
                stop,
                budget,
                self.nodes,
                angles=self.constraints.triple,
                areas=self.constraints.area,
            )
        return tree_kernels.grow(prefixes, self._domains, self._masks, stop, budget, self.nodes)


def root() -> NDArray[np.int32]:
    """(1, 0) the interpretation of no contacts."""
    return np.zeros((1, 0), np.int32)


def far_apart_order(positions: NDArray[np.float64]) -> NDArray[np.intp]:
    """An order of contacts that puts far-apart ones first (memo, Section 4.3).

    The two farthest apart come first, then always the one whose nearest predecessor is farthest.

    Args:
        positions: (n, 3) points, metres; or other rows whose distances matter.

    Returns:
        (n,) row indices.
    """
    return tree_kernels.farthest_first(np.ascontiguousarray(positions))


def spread_order(contacts: Contacts) -> NDArray[np.intp]:
    """An order that puts contacts first that are far apart in position or in normal.

    Different normals early let a partial interpretation fix its pose early: where all contacts so
    far are on one plane, the tree has little to prune with and the model test less. Half a turn
    between normals counts as much as the largest extent of the contacts along an axis. Contacts
    known to be on edges or vertices, where the normal says little, come last.

    Returns:
        (n,) row indices.
    """
    order = tree_kernels.spread_first(contacts.positions, contacts.normals)
    sharp = contacts.kinds[order] >= EDGE
    return order[np.argsort(sharp, kind="stable")] if sharp.any() else order


def prune(
    tables: PairTables | PlanarTables,
    contacts: Contacts,
    *,
    constraints: Constraints | None = None,
    sort: bool = True,
    budget: int = 1_000_000,
) -> Pruned:
    """All interpretations that the constraints allow; no poses are computed.

    Args:
        tables: the model's range tables.
        contacts: what was felt.
        constraints: which constraints prune; by default distance, angle and component.
        sort: far-apart contacts first; otherwise in the given order.
        budget: the most interpretations to return.

    Raises:
        ValueError: constraints on triples for an outline.
    """
    order = far_apart_order(contacts.positions) if sort else np.arange(len(contacts))
    tree = InterpretationTree(tables, contacts[order], constraints or Constraints())
    if not len(contacts):
        return Pruned(root(), tree.nodes, True)
    leaves, complete = tree.extend(root(), len(contacts), budget)
    faces = np.empty_like(leaves)
    faces[:, order] = leaves
    return Pruned(faces, tree.nodes, complete)


def _as_bits(faces: NDArray[np.int32], words: int) -> NDArray[np.uint64]:
    bits = np.zeros(words, np.uint64)
    present = np.unique(faces).astype(np.uint64)
    np.bitwise_or.at(bits, present >> np.uint64(6), np.uint64(1) << (present & np.uint64(63)))
    return bits
