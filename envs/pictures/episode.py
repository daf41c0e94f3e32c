"""An episode as it stands: all that pictures read, so that they need no environment."""

from __future__ import annotations

from dataclasses import dataclass

from scipy.spatial.transform import RigidTransform

from ...recognizer import Belief, Contacts, Polyhedron, PoseTolerance
from ..sensors.touch import Touch

__all__ = ["Episode"]


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
