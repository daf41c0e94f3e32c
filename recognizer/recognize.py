"""The recogniser: contacts in, belief out, over a library of models."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from time import perf_counter

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import RigidTransform

from .belief import Belief, Search
from .contacts import Contacts
from .hypotheses import Hypothesis, PoseTolerance, cluster
from .polyhedron import Polyhedron
from .pose import ModelTest
from .ranges import PairTables
from .tree import Constraints, InterpretationTree, root, spread_order


@dataclass(frozen=True, kw_only=True)
class SearchLimits:
    """How the tree is grown, and when it is cut short."""

    budget: int = 100_000
    """The most interpretations of one model held at a time; more, and the belief says that it is
    not complete."""
    first_stage: int = 4
    """Levels grown before the first model test."""
    stage: int = 4
    """Levels grown between two model tests after it, while interpretations are few."""
    crowd: int = 64
    """Interpretations from which the model test is worth its time within the tree."""
    flood: int = 2000
    """Interpretations at which a stage is broken off and grown a level at a time instead."""

    def __post_init__(self) -> None:
        for name in ("budget", "first_stage", "stage", "crowd", "flood"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} is {getattr(self, name)}; it must be at least 1")


@dataclass(frozen=True, eq=False)
class _Entry:
    model: Polyhedron
    tables: PairTables
    test: ModelTest


class Recognizer:
    """Says which objects of a library a list of contacts allows, and at which poses.

    Construction builds the range tables of every model; the object is immutable after it.
    """

    def __init__(
        self,
        models: Iterable[Polyhedron],
        *,
        constraints: Constraints | None = None,
        tolerance: PoseTolerance | None = None,
        limits: SearchLimits | None = None,
    ) -> None:
        """Prepare a library.

        Args:
            models: the library; names must differ.
            constraints: which constraints prune the tree.
            tolerance: which poses count as the same.
            limits: how far the search goes.

        Raises:
            ValueError: no model at all, or two of the same name.
        """
        self.models = tuple(models)
        if not self.models:
            raise ValueError("a recogniser needs at least one model; the library is empty")
        names = [model.name for model in self.models]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(f"two models are called {twice[0]!r}; names must differ")
        self.constraints = constraints or Constraints()
        self.tolerance = tolerance or PoseTolerance()
        self.limits = limits or SearchLimits()
        self._entries = tuple(
            _Entry(model, PairTables.of(model), ModelTest(model)) for model in self.models
        )

    def tables(self, name: str) -> PairTables:
        """The range tables of one model.

        Raises:
            ValueError: no model of that name.
        """
        return self._entry(name).tables

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
        entry = self._entry(hypothesis.object_name)
        if hypothesis.determined:
            return RigidTransform.from_matrix(hypothesis.pose.as_matrix()[None])
        largest = float(contacts.position_error.max())
        diameter = entry.model.diameter
        step = 0.5 * min(
            self.tolerance.distance(diameter, largest), self.tolerance.rotation * diameter / 2.0
        )
        faces = hypothesis.interpretations[0]
        return entry.test.span(faces, contacts, hypothesis.pose, hypothesis.freedoms, step, most)

    def _entry(self, name: str) -> _Entry:
        for entry in self._entries:
            if entry.model.name == name:
                return entry
        known = ", ".join(model.name for model in self.models)
        raise ValueError(f"no model is called {name!r}; there are: {known}")

    def recognize(self, contacts: Contacts) -> Belief:
        """Every (object, pose) that the contacts allow.

        Args:
            contacts: at least one contact on the object.

        Returns:
            The belief; empty if no object of the library fits.

        Raises:
            ValueError: no contacts.
        """
        if not len(contacts):
            raise ValueError("no contacts: before the first touch every object and pose fits")
        order = spread_order(contacts)
        back = np.argsort(order)
        found: list[Hypothesis] = []
        logs, searches = [], []
        for entry in self._entries:
            hypotheses, log_weights, search = self._search(entry, contacts[order])
            found += [replace(h, interpretations=h.interpretations[:, back]) for h in hypotheses]
            logs.append(log_weights)
            searches.append(search)
        weights = _normalised(np.concatenate(logs))
        ranked = [
            replace(found[index], weight=float(weights[index]))
            for index in np.argsort(-weights, kind="stable")
        ]
        return Belief(tuple(ranked), tuple(searches))

    def _search(
        self, entry: _Entry, contacts: Contacts
    ) -> tuple[list[Hypothesis], NDArray[np.float64], Search]:
        """Tree and model tests in turn, then clusters, for one model and sorted contacts."""
        limits, count = self.limits, len(contacts)
        tree = InterpretationTree(entry.tables, contacts, self.constraints)
        faces, complete = root(), True
        tree_seconds = pose_seconds = 0.0
        step = limits.first_stage
        while True:
            start = faces.shape[1]
            started = perf_counter()
            if len(faces):
                stop = min(count, start + step)
                cap = limits.flood if stop > start + 1 else limits.budget
                grown, whole = tree.extend(faces, stop, min(cap, limits.budget))
                if not whole and stop > start + 1:
                    stop = start + 1
                    grown, whole = tree.extend(faces, stop, limits.budget)
                faces = grown
                complete &= whole
            tree_seconds += perf_counter() - started
            if not len(faces) or faces.shape[1] == count:
                break
            if len(faces) > limits.crowd:
                # Rejecting part of an interpretation rejects every way to complete it.
                started = perf_counter()
                faces = entry.test.prune(faces, contacts[: faces.shape[1]])
                pose_seconds += perf_counter() - started
            step = limits.stage if len(faces) <= limits.crowd else 1
        pruned = len(faces)
        started = perf_counter()
        if not pruned:
            faces = np.zeros((0, count), np.int32)
        poses = entry.test.run(faces, contacts)
        pose_seconds += perf_counter() - started
        started = perf_counter()
        largest = float(contacts.position_error.max())
        hypotheses, log_weights = cluster(entry.model, poses, self.tolerance, largest)
        search = Search(
            object_name=entry.model.name,
            nodes=tree.nodes,
            pruned=pruned,
            tested=len(poses),
            hypotheses=len(hypotheses),
            complete=complete,
            tree_seconds=tree_seconds,
            pose_seconds=pose_seconds,
            cluster_seconds=perf_counter() - started,
        )
        return hypotheses, log_weights, search


def _normalised(log_weights: NDArray[np.float64]) -> NDArray[np.float64]:
    if not len(log_weights):
        return log_weights
    weights = np.exp(log_weights - log_weights.max())
    return weights / weights.sum()
