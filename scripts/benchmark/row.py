"""One episode of a benchmark, as a row of its table."""

from __future__ import annotations

from dataclasses import dataclass, replace

SOLVED, NOTHING_FITS, GAVE_UP = "solved", "nothing fits", "gave up"
"""How an episode ends."""


@dataclass(frozen=True, kw_only=True)
class EpisodeRow:
    """How one episode went.

    Lists have an entry a probe; those of decision times one fewer, as nobody chose the first probe.
    """

    number: int
    """Its place in the benchmark, from 0 on."""
    policy: str
    objects: str
    """What the object was known to be one of: a name, `library`, or a folder."""
    noise: str
    """The bounds as they were asked for, as in ``pi/8,0.05in``."""
    position_error: float
    """Metres."""
    normal_error: float
    """Radians."""
    sensor: str
    placement: str
    goal: str
    max_probes: int
    diameter: float
    """Of the largest object that it might have been, metres."""
    episode: int
    """All strategies and settings have the same episodes."""
    seed: int
    """Of object, pose, first probe and noise."""
    true_object: str
    ended: str
    """SOLVED, NOTHING_FITS or GAVE_UP."""
    probes: int
    """How many were sent."""
    contacts: int
    """How many rays met the object."""
    right: bool | None
    """Whether the answer was the truth, the pose up to the pose tolerance and the object's
    symmetries; None where there was no answer."""
    rotation_error: float | None
    """Of the heaviest hypothesis, radians; None if it is of another object, or if there is none."""
    translation_error: float | None
    """Likewise, of the centroid, metres."""
    complete: bool
    """Whether no search was cut short."""
    first_probe: tuple[float, ...]
    """The action that the seed chose."""
    contacts_felt: tuple[int, ...]
    """Contacts after each probe."""
    hypotheses: tuple[int, ...]
    """Left after each probe; 0 before the first contact too."""
    interpretations: tuple[int, ...]
    """Likewise."""
    decision_seconds: tuple[float, ...]
    """By the clock, from the second probe on."""
    decision_processor_seconds: tuple[float, ...]
    """Likewise, that the processor was at work."""
    decision_median: float | None
    """Of the processor's seconds; None if there was no decision."""
    decision_p99: float | None
    """Likewise, the 99th percentile."""
    versions: str
    """Of what played it, as JSON."""

    @property
    def solved(self) -> bool:
        """Whether it ended with an answer."""
        return self.ended == SOLVED

    @property
    def probes_to_unique(self) -> int:
        """Probes until the answer; one more than may be sent if there was none."""
        return self.probes if self.solved else self.max_probes + 1

    def untimed(self) -> EpisodeRow:
        """The row without what a clock said: the same whenever and wherever it is played."""
        return replace(
            self,
            decision_seconds=(),
            decision_processor_seconds=(),
            decision_median=None,
            decision_p99=None,
        )
