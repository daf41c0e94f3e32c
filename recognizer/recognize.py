"""The recogniser: contacts in, belief out, over a library of models."""

from __future__ import annotations

from collections.abc import Iterable
from copy import copy
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import RigidTransform

from .belief import Belief
from .beliefs.extent import pin_down
from .beliefs.hypotheses import ACROSS, Hypothesis, PoseTolerance, canonical
from .beliefs.library import Library
from .beliefs.model_search import search_model, span_hypothesis
from .beliefs.search import Search
from .contacts.contacts import EDGE, Contacts
from .contacts.free_space import FreeSpace
from .contacts.support import SupportPlane
from .models.features import Features
from .models.polygon import Polygon
from .models.polyhedron import Polyhedron
from .poses.entry import SolidEntry
from .poses.known import Surroundings
from .tables.ranges import PairTables
from .tree.limits import SearchLimits
from .tree.tree import Constraints, spread_order
from .tree.tree_kernels import least_span

Found = tuple[list[Hypothesis], NDArray[np.float64], Search]


class Recognizer:
    """Says which objects of a library a list of contacts allows, and at which poses.

    Construction builds the range tables of every model; the object is immutable after it.
    """

    def __init__(
        self,
        models: Iterable[Polyhedron | Polygon],
        *,
        features: Literal["faces", "all"] = "faces",
        constraints: Constraints | None = None,
        tolerance: PoseTolerance | None = None,
        limits: SearchLimits | None = None,
        cache: Path | None = None,
    ) -> None:
        """Prepare a library.

        Args:
            models: the library, solids or outlines; names must differ.
            features: what of a solid a contact may lie on: its faces, or "all" for its convex edges
                and vertices too, which a finger with a ball tip meets.
            constraints: which constraints on pairs prune the tree.
            tolerance: which poses count as the same.
            limits: how far the search goes.
            cache: a folder to keep range tables in between runs, by content.

        Raises:
            ValueError: no model at all, two of the same name, solids and outlines together, edges
                and vertices of outlines; constraints on triples, which are for `prune`.
        """
        if features not in ("faces", "all"):
            raise ValueError(f"features is {features!r}; it must be 'faces' or 'all'")
        self.constraints = constraints or Constraints()
        if self.constraints.triple or self.constraints.area:
            raise ValueError(
                "the constraints triple and area are for `prune`; a recogniser's own test of poses"
                " says more than they do"
            )
        self.library = Library.of(models, edges=features == "all", cache=cache)
        self.models = self.library.models
        self.outlines = tuple(entry.model for entry in self.library.outlines)
        self.dimension = self.library.dimension
        self.tolerance = tolerance or PoseTolerance()
        self.limits = limits or SearchLimits()

    def tables(self, name: str) -> PairTables:
        """The range tables of a solid.

        Raises:
            ValueError: no solid of that name.
        """
        return self.library.solid(name).tables

    def features(self, name: str) -> Features:
        """What of a solid contacts may lie on; interpretations are rows of its indices.

        Raises:
            ValueError: no solid of that name.
        """
        return self.library.solid(name).features

    def sample_poses(
        self, hypothesis: Hypothesis, contacts: Contacts, most: int = 256
    ) -> RigidTransform:
        """Poses that span a hypothesis: its own and, along the freedoms it leaves open, others.

        Neighbours are half a pose tolerance apart, over the family that the hypothesis's best
        interpretation allows, outwards from its own pose as far as ``most`` reach.

        Args:
            hypothesis: of a belief about these contacts.
            contacts: what was felt.
            most: the most poses.

        Returns:
            A stack of poses, model to world, the hypothesis's own first.
        """
        entry = self.library.entry(hypothesis.object_name)
        return span_hypothesis(entry, hypothesis, contacts, self.tolerance, most)

    def limited(self, limits: SearchLimits) -> Recognizer:
        """The same with other limits; nothing is built again."""
        other = copy(self)
        other.limits = limits
        return other

    def recognize(
        self,
        contacts: Contacts,
        *,
        outliers: int = 0,
        free_space: FreeSpace | None = None,
        support: SupportPlane | None = None,
    ) -> Belief:
        """Every (object, pose) that the contacts allow, and what else is known.

        Args:
            contacts: at least one contact on the object.
            outliers: how many of them, at most, may be on no face of it (the null face of Grimson
                and Lozano-Perez 1987); -1 stands for none in an interpretation.
            free_space: paths that the probe swept without meeting the object, or until it did.
            support: the plane that the object lies on.

        Returns:
            The belief; empty if no object of the library fits. Hypotheses with fewer outliers come
            first.

        Raises:
            ValueError: no contacts, contacts of the plane for a library of solids or the other way
                round, outliers below zero, free space or a support in the plane.
        """
        if not len(contacts):
            raise ValueError("no contacts: before the first touch every object and pose fits")
        self._check(contacts, outliers)
        self._check_known(free_space, support)
        known = Surroundings.of(free_space, support)
        return self._believe(contacts, spread_order(contacts), outliers, known, None)

    def update(
        self, belief: Belief, contacts: Contacts, *, free_space: FreeSpace | None = None
    ) -> Belief:
        """The belief after further contacts: the same as of all of them from the start.

        Args:
            belief: of a recogniser with the same library.
            contacts: the new ones; there may be none.
            free_space: further paths that the probe swept.

        Raises:
            ValueError: contacts of the plane for a library in space, or the other way round; a
                belief about another library.
        """
        self._check(contacts, belief.outliers)
        self._check_known(free_space, None)
        if not self.library.alike(belief.library):
            raise ValueError("this belief is about another library than the recogniser's")
        first = len(belief.contacts)
        everything = Contacts.join([belief.contacts, contacts])
        paths = FreeSpace.join([belief.free_space, free_space or FreeSpace.none()])
        known = Surroundings.of(paths, belief.support)
        # Without outliers an interpretation of all contacts is one of the first ones, extended.
        extends = belief.complete and not belief.outliers and len(contacts) > 0
        if not extends:
            order = spread_order(everything)
            return self._believe(everything, order, belief.outliers, known, None)
        order = np.concatenate([np.arange(first), first + spread_order(contacts)])
        return self._believe(everything, order, belief.outliers, known, belief)

    def _check(self, contacts: Contacts, outliers: int) -> None:
        if contacts.dimension != self.dimension:
            kind = "solids" if self.dimension == 3 else "outlines of the plane"
            raise ValueError(
                f"contacts have {contacts.dimension} coordinates, but the library is of"
                f" {kind}: give {self.dimension}"
            )
        if not self.library.edges and (contacts.kinds >= EDGE).any():
            sharp = int(np.argmax(contacts.kinds >= EDGE))
            raise ValueError(
                f"contact {sharp} is on an edge or a vertex, but this recogniser knows faces"
                ' alone: make it with features="all"'
            )
        if outliers < 0:
            raise ValueError(f"outliers is {outliers}; it must be zero or more")

    def _check_known(self, free_space: FreeSpace | None, support: SupportPlane | None) -> None:
        if self.dimension == 2 and (free_space is not None or support is not None):
            raise ValueError("free space and support are for solids, not for outlines of the plane")

    def _believe(
        self,
        contacts: Contacts,
        order: NDArray[np.intp],
        outliers: int,
        known: Surroundings,
        before: Belief | None,
    ) -> Belief:
        back = np.argsort(order)
        ordered = contacts[order].facing_approach()
        span = least_span(ordered.positions, ordered.position_error) if outliers == 0 else 0.0
        hypotheses: list[Hypothesis] = []
        logs, searches = [], []
        for entry in self.library.entries:
            # Memo, Section 7: no two contacts are farther apart than the object is wide.
            if span > entry.body.diameter * (1.0 + 1e-9):
                searches.append(Search.none(entry.model.name))
                continue
            found = search_model(
                entry,
                ordered,
                self.constraints,
                self.tolerance,
                self.limits,
                outliers=outliers,
                known=_interpretations(before, entry.model.name),
                surroundings=known,
            )
            _note(found, hypotheses, logs, searches)
        weights = _normalised(np.concatenate(logs) if logs else np.zeros(0))
        nulls = np.zeros(len(hypotheses), np.int64)
        if outliers:
            nulls[:] = [(h.interpretations < 0).sum(axis=1).min() for h in hypotheses]
        ranked = [
            hypotheses[index].ranked(float(weights[index]), back)
            for index in canonical(hypotheses, weights, nulls)
        ]
        if len(ranked) == 1 and ranked[0].determined:
            ranked = [self._pinned(ranked[0], contacts, known)]
        return Belief(
            tuple(ranked),
            tuple(searches),
            contacts,
            self.library,
            self.tolerance,
            outliers,
            known.free_space,
            known.support,
        )

    def _pinned(self, only: Hypothesis, contacts: Contacts, known: Surroundings) -> Hypothesis:
        """The only hypothesis left, determined only if all its poses are alike."""
        entry = self.library.entry(only.object_name)
        resting = known.support is not None and known.support.resting
        stable = entry.stable_faces if resting and isinstance(entry, SolidEntry) else None
        return pin_down(
            entry.kernel,
            only,
            entry.in_space(contacts),
            self.tolerance,
            movable=known.says_nothing(contacts),
            support=known.support,
            stable=stable,
            held=ACROSS if entry.flat else (),
        )


def _note(
    found: Found,
    hypotheses: list[Hypothesis],
    logs: list[NDArray[np.float64]],
    searches: list[Search],
) -> None:
    hypotheses += found[0]
    logs.append(found[1])
    searches.append(found[2])


def _interpretations(belief: Belief | None, name: str) -> NDArray[np.int32] | None:
    """(m, k) all of a model's in a belief; None without a belief."""
    if belief is None:
        return None
    rows = [h.interpretations for h in belief.hypotheses if h.object_name == name]
    none = np.zeros((0, len(belief.contacts)), np.int32)
    return np.ascontiguousarray(np.concatenate([none, *rows]), np.int32)


def _normalised(log_weights: NDArray[np.float64]) -> NDArray[np.float64]:
    if len(log_weights) < 2:
        return np.ones(len(log_weights))
    weights = np.exp(log_weights - log_weights.max())
    return weights / weights.sum()
