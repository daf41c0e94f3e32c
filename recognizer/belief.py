"""The belief: every hypothesis the contacts allow, and how it was reached."""

from __future__ import annotations

from dataclasses import dataclass, field

from .beliefs.hypotheses import Hypothesis, PoseTolerance
from .beliefs.library import Library
from .beliefs.search import Search
from .contacts.contacts import Contacts
from .contacts.free_space import FreeSpace
from .contacts.support import SupportPlane


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
    library: Library
    """What was looked through."""
    tolerance: PoseTolerance
    """Which poses count as the same."""
    outliers: int = 0
    """How many contacts could have been on no object."""
    free_space: FreeSpace = field(default_factory=FreeSpace.none)
    """Where the object was known not to be."""
    support: SupportPlane | None = None
    """What it was known to lie on."""

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
