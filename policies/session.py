"""A session with a real probe: contacts in, the belief and the next touches worth making out."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from ..recognizer import (
    Belief,
    Contacts,
    FreeSpace,
    Polyhedron,
    PoseTolerance,
    Recognizer,
    SearchLimits,
    SupportPlane,
)
from .first_touch import first_touches
from .outcomes.reports import Suggestion
from .ranking import FORMULAS, ranked_touches
from .straight import Reach, Region

CLEARANCE = 0.02
"""How far above the plane touches along it stay, as a share of the smallest object's diameter."""


class Session:
    """Recognises an object as it is touched, and says where to touch next.

    >>> session = Session(load_folder("parts", scale=1e-3))  # millimetres
    >>> session.add(contacts)
    >>> session.belief.hypotheses
    >>> session.suggest()
    """

    def __init__(
        self,
        library: Iterable[Polyhedron],
        *,
        features: Literal["faces", "all"] = "faces",
        support: SupportPlane | None = None,
        outliers: int = 0,
        tolerance: PoseTolerance | None = None,
        limits: SearchLimits | None = None,
        cache: Path | None = None,
    ) -> None:
        """Prepare a library; nothing has been touched yet.

        Args:
            library: the objects, with names that differ.
            features: "all" if contacts may lie on edges and vertices, as a ball tip's do.
            support: the plane that the object lies on, if it is known.
            outliers: how many contacts, at most, may be of something else.
            tolerance: which poses count as the same.
            limits: how far a search goes.
            cache: a folder to keep range tables in between runs.

        Raises:
            ValueError: as of `Recognizer`; an outline of the plane; outliers below zero.
        """
        self.recognizer = Recognizer(
            library, features=features, tolerance=tolerance, limits=limits, cache=cache
        )
        if self.recognizer.dimension != 3:
            name = self.recognizer.outlines[0].name
            raise ValueError(f"{name!r} is an outline of the plane; a session is about solids")
        if outliers < 0:
            raise ValueError(f"outliers is {outliers}; it must be zero or more")
        self.support = support
        self.outliers = outliers
        self._belief: Belief | None = None
        self._misses = FreeSpace.none()

    @property
    def belief(self) -> Belief | None:
        """What the contacts so far allow; None before the first."""
        return self._belief

    def add(
        self, contacts: Contacts | None = None, *, free_space: FreeSpace | None = None
    ) -> Belief | None:
        """Take in what a touch felt, and the way it went.

        Args:
            contacts: the new ones, with their bounds; there may be none.
            free_space: ways that met nothing, or nothing until a contact.

        Returns:
            The belief of all that was added so far; None as long as nothing was touched.

        Raises:
            ValueError: contacts that the recogniser doesn't take; the session is as it was.
        """
        contacts = Contacts.none() if contacts is None else contacts
        ways = FreeSpace.none() if free_space is None else free_space
        if self._belief is not None:
            self._belief = self.recognizer.update(self._belief, contacts, free_space=ways)
        elif len(contacts):
            self._belief = self.recognizer.recognize(
                contacts,
                outliers=self.outliers,
                free_space=FreeSpace.join([self._misses, ways]),
                support=self.support,
            )
        else:
            self._misses = FreeSpace.join([self._misses, ways])
        return self._belief

    def suggest(
        self,
        count: int = 5,
        *,
        policy: str = "information",
        region: Region | None = None,
        directions: ArrayLike | None = None,
        seed: int = 0,
    ) -> tuple[Suggestion, ...]:
        """The next straight touches worth making, the best first.

        As long as rivals are left that a touch tells apart, these are the touches that do it best
        by the policy's formula; then those that fix the pose best. Before the first contact they go
        across the region, from its middle outwards. Thought of are the heaviest hypotheses, 256 at
        most, and touches a little beside each: its worth is what the worst of these would tell.

        Args:
            count: how many, at most; fewer if fewer tell anything.
            policy: one of `ranking.FORMULAS`: a strategy that weighs any probe by a formula.
            region: what the probe's tip can reach; by default a box around all that is left of the
                belief.
            directions: (d, 3) the directions of motion there are; by default any that doesn't come
                from below the support (without one, that doesn't come from below).
            seed: of the touches that are thought of; same seed, same suggestions.

        Returns:
            Nothing if nothing fits the contacts, or if nothing in reach tells anything.

        Raises:
            ValueError: an unknown policy, a count below one, directions that aren't; no region
                before the first contact.
        """
        if policy not in FORMULAS:
            raise ValueError(f"policy is {policy!r}; it must be one of {', '.join(FORMULAS)}")
        if count < 1:
            raise ValueError(f"count is {count}; it must be at least 1")
        room = CLEARANCE * min(model.diameter for model in self.recognizer.models)
        if self._belief is None:
            if region is None:
                raise ValueError(
                    "before the first contact nobody knows where the object is: give the region"
                )
            reach = Reach.of(region, directions, self.support, room)
            return first_touches(reach, self._misses, count)

        def reach_of(around: Region) -> Reach:
            return Reach.of(region or around, directions, self.support, room)

        return ranked_touches(self._belief, reach_of, policy, count, np.random.default_rng(seed))
