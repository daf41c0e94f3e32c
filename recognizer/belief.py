"""The belief: every hypothesis the contacts allow, and how it was reached."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from .beliefs.hypotheses import Hypothesis
from .contacts.contacts import Contacts
from .contacts.free_space import FreeSpace
from .contacts.support import SupportPlane

if TYPE_CHECKING:
    from .recognize import Recognizer


@dataclass(frozen=True, eq=False)
class Search:
    """What the recogniser did with one model: counts and times of each stage."""

    object_name: str
    nodes: NDArray[np.int64]
    """(n,) branches seen at each level of the tree, in the order of the search."""
    pruned: int
    """Interpretations left by the tree, before the last model test."""
    tested: int
    """Interpretations left by the model test."""
    hypotheses: int
    """Distinct poses among them."""
    complete: bool
    """False if a budget ran out, so that hypotheses may be missing."""
    boxes: int
    """Boxes of rotations looked at for what one verdict left open."""
    search_seconds: float
    """Time for masks, tree and model tests."""
    cluster_seconds: float
    """Time for grouping."""

    @classmethod
    def none(cls, object_name: str, contacts: int) -> Search:
        """Of a model that was ruled out at once."""
        return cls(object_name, np.zeros(contacts, np.int64), 0, 0, 0, True, 0, 0.0, 0.0)


@dataclass(frozen=True, eq=False)
class Belief:
    """All (object, pose) hypotheses that the contacts allow, heaviest first.

    Empty means that the touched thing is not in the library, or that a bound is too tight.
    """

    hypotheses: tuple[Hypothesis, ...]
    searches: tuple[Search, ...]
    """One a model, in the library's order."""
    contacts: Contacts
    """What was felt."""
    recognizer: Recognizer
    """Who said so."""
    outliers: int = 0
    """How many contacts could have been on no object."""
    free_space: FreeSpace = field(default_factory=FreeSpace.none)
    """Where the object was known not to be."""
    support: SupportPlane | None = None
    """What it was known to lie on."""

    def update(self, contacts: Contacts, *, free_space: FreeSpace | None = None) -> Belief:
        """The belief after further contacts: the same as of all of them from the start.

        Args:
            contacts: the new ones; there may be none.
            free_space: further paths that the probe swept.

        Raises:
            ValueError: contacts of the plane for a library in space, or the other way round.
        """
        return self.recognizer.extend(self, contacts, free_space=free_space)

    @property
    def complete(self) -> bool:
        """Whether every search ran to its end; if not, hypotheses may be missing."""
        return all(search.complete for search in self.searches)

    @property
    def empty(self) -> bool:
        """Whether no object of the library fits."""
        return not self.hypotheses

    @property
    def unique(self) -> bool:
        """Whether one hypothesis is left, with its pose fixed, and nothing was cut short.

        Of a solid, then, no pose within the bounds that leads to the hypothesis's own without
        breaking one is farther from it than the pose tolerance (see `extent`).
        """
        return len(self.hypotheses) == 1 and self.hypotheses[0].determined and self.complete

    @property
    def interpretations(self) -> int:
        """How many interpretations there are in all."""
        return sum(len(hypothesis.interpretations) for hypothesis in self.hypotheses)
