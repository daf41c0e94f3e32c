"""What an episode's touches amount to: evidence, belief, and the poses that stand for it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from ..recognizer import (
    Belief,
    Polyhedron,
    PoseSamples,
    Recognizer,
    SupportPlane,
    sample_belief,
)
from .sensors.evidence import Evidence
from .sensors.touch import Touch

KEPT_WITHIN = 0.02
"""Contacts with an object that was pushed since are dropped once their places are known to no
better than this, in diameters of the largest object."""


@dataclass(frozen=True, eq=False)
class Knowledge:
    """What is known after some probes."""

    evidence: Evidence
    belief: Belief | None
    """None before the first contact."""
    samples: PoseSamples
    """Poses that stand for the belief."""

    @classmethod
    def none(cls, library: Sequence[Polyhedron]) -> Knowledge:
        """Before the first probe."""
        return cls(Evidence.none(), None, PoseSamples.none(library))


@dataclass(frozen=True, eq=False)
class Knowing:
    """How an environment makes knowledge of touches."""

    recognizer: Recognizer
    kept_within: float
    """`KEPT_WITHIN`, metres."""
    use_free_space: bool
    """Whether the recogniser is told of the paths that were free."""
    most_samples: int

    def after(
        self, before: Knowledge, touch: Touch, standing: Callable[[], SupportPlane | None]
    ) -> Knowledge:
        """What is known after one more probe.

        Args:
            before: what was known.
            touch: what the probe reported.
            standing: says what the object is known to stand on now.
        """
        evidence = before.evidence.after(touch, self.kept_within)
        if not (len(touch.contacts) or self.use_free_space or evidence.changed):
            return Knowledge(evidence, before.belief, before.samples)
        library = self.recognizer.models
        if not len(evidence.contacts):
            return Knowledge(evidence, None, PoseSamples.none(library))
        support, known = standing(), before.belief
        if known is None or evidence.changed or known.support is not support:
            belief = self.recognizer.recognize(
                evidence.contacts,
                free_space=evidence.free_space if self.use_free_space else None,
                support=support,
            )
        else:
            paths = touch.free_space if self.use_free_space else None
            belief = self.recognizer.update(known, touch.contacts, free_space=paths)
        return Knowledge(evidence, belief, sample_belief(belief, library, self.most_samples))
