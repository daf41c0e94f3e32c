"""The belief: every hypothesis the contacts allow, and how it was reached."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from math import isfinite, log2
from typing import Any

from .beliefs.hypotheses import Hypothesis, PoseTolerance
from .beliefs.library import Library
from .beliefs.search import Search
from .contacts.contacts import Contacts
from .contacts.free_space import FreeSpace
from .contacts.support import SupportPlane

NAMED = 3
"""Objects that are named where a belief is printed."""


@dataclass(frozen=True, eq=False, repr=False)
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

        Of a solid, then, no pose within the bounds is farther from the hypothesis's own than the
        pose tolerance, but for the solid's own symmetries (see `extent`).
        """
        return len(self.hypotheses) == 1 and self.hypotheses[0].determined and self.complete

    @property
    def interpretations(self) -> int:
        """How many interpretations there are in all hypotheses together."""
        return sum(len(hypothesis.interpretations) for hypothesis in self.hypotheses)

    def __len__(self) -> int:
        return len(self.hypotheses)

    def __iter__(self) -> Iterator[Hypothesis]:
        return iter(self.hypotheses)

    def objects(self) -> dict[str, float]:
        """The weight of each object that fits, the heaviest first; they add up to one."""
        weights: dict[str, float] = {}
        for hypothesis in self.hypotheses:
            name = hypothesis.object_name
            weights[name] = weights.get(name, 0.0) + hypothesis.weight
        return dict(sorted(weights.items(), key=lambda item: -item[1]))

    def entropy(self) -> float:
        """How far from one hypothesis the weights are, in bits; zero for one or none."""
        weights = [h.weight for h in self.hypotheses if h.weight > 0.0]
        return sum(-weight * log2(weight) for weight in weights)

    def to_dict(self) -> dict[str, Any]:
        """What it says, as numbers, texts and lists that `json` takes; metres and radians."""
        return {
            "complete": self.complete,
            "unique": self.unique,
            "contacts": len(self.contacts),
            "hypotheses": [
                {
                    "object": hypothesis.object_name,
                    "weight": hypothesis.weight,
                    "T_world_object": hypothesis.T_world_object.tolist(),
                    "farthest_turn": _finite(hypothesis.farthest_turn),
                    "farthest_shift": _finite(hypothesis.farthest_shift),
                    "determined": hypothesis.determined,
                    "proven": hypothesis.proven,
                    "interpretations": hypothesis.interpretations.tolist(),
                }
                for hypothesis in self.hypotheses
            ],
        }

    def __repr__(self) -> str:
        objects = list(self.objects().items())
        named = ", ".join(f"{name} {weight:.2f}" for name, weight in objects[:NAMED])
        more = ", ..." if len(objects) > NAMED else ""
        ended = "" if self.complete else ", cut short"
        return (
            f"<Belief of {len(self.contacts)} contacts: {len(self)} hypotheses"
            f"{' (' + named + more + ')' if objects else ''}{ended}>"
        )


def _finite(value: float) -> float | None:
    """A number that JSON has; none for what isn't known."""
    return value if isfinite(value) else None
