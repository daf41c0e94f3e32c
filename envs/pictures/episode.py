"""An episode as it stands: all that pictures read, so that they need no environment."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

from scipy.spatial.transform import RigidTransform

from ...recognizer import Belief, Contacts, Polyhedron, PoseTolerance, Recognizer
from ..sensors.touch import Touch
from ..truth import Truth

__all__ = ["Episode"]


class Probing(Protocol):
    """What is public of an environment."""

    library: tuple[Polyhedron, ...]
    recognizer: Recognizer

    @property
    def touches(self) -> tuple[Touch, ...]:
        """What each probe so far reported."""
        ...

    @property
    def contacts(self) -> Contacts:
        """All contacts that still hold."""
        ...

    @property
    def belief(self) -> Belief | None:
        """What they leave possible."""
        ...


@dataclass(frozen=True, eq=False, kw_only=True)
class Episode:
    """An episode at one instant, the truth included: nothing that a strategy may see."""

    library: tuple[Polyhedron, ...]
    """What the object may be."""
    true_object: Polyhedron
    T_world_object: RigidTransform
    """Where the object truly is."""
    touches: tuple[Touch, ...]
    """What each probe so far reported."""
    contacts: Contacts
    """All contacts that still hold."""
    belief: Belief | None
    """What they leave possible; None before the first."""
    tolerance: PoseTolerance
    """Which poses count as the same."""

    @classmethod
    def of(cls, env: Probing, info: Mapping[str, Any]) -> Episode:
        """An environment's episode.

        Args:
            env: the environment.
            info: what it returned last, which tells the truth.
        """
        truth = Truth.of(env.library, info)
        return cls(
            library=env.library,
            true_object=truth.model,
            T_world_object=truth.T_world_object,
            touches=env.touches,
            contacts=env.contacts,
            belief=env.belief,
            tolerance=env.recognizer.tolerance,
        )
