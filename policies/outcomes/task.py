"""What is public of an episode: the library, the probes that may be sent, the bounds, the goal."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ...recognizer import Polyhedron, PoseTolerance
from ...recognizer.predict.prediction import PoseSamples, samples_of
from ...recognizer.predict.probes import ProbeSpace

Observation = Mapping[str, NDArray[np.generic]]

Goal = Literal["object", "pose", "both"]
GOALS = ("object", "pose", "both")


@dataclass(frozen=True, kw_only=True)
class Task:
    """What a strategy knows before the first probe."""

    library: tuple[Polyhedron, ...]
    """The objects, in the order in which observations number them."""
    space: ProbeSpace
    """The probes that may be sent."""
    position_error: float
    """Bound on positions felt, metres."""
    normal_error: float
    """Bound on normals felt, radians."""
    radius: float = 0.0
    """Of what goes along the rays, metres; 0 of a point."""
    free_space: bool = False
    """Whether it is evidence too that a ray touched nothing on its way."""
    goal: Goal = "both"
    """What is to be found out: which object it is, how it lies, or both."""
    tolerance: PoseTolerance = field(default_factory=PoseTolerance)
    """Which poses count as the same."""

    def __post_init__(self) -> None:
        if self.goal not in GOALS:
            raise ValueError(f"goal is {self.goal!r}; it must be one of {', '.join(GOALS)}")

    def samples(self, observation: Observation) -> PoseSamples:
        """The poses that stand for the belief of an observation; none before the first contact."""
        count = int(observation["sample_count"][0])
        names = ("objects", "hypotheses", "positions", "quaternions", "weights")
        rows = [observation[f"sample_{name}"][:count] for name in names]
        spreads = [
            observation[f"sample_{name}_spread"][:count] for name in ("position", "rotation")
        ]
        return samples_of(self.library, *rows, *spreads)  # pyright: ignore[reportArgumentType]
