"""What a search did with one model: counts, and the time of each stage."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, eq=False)
class Search:
    """What the recogniser did with one model: counts and times of each stage."""

    object_name: str
    nodes: int
    """Nodes of the tree that were looked at: boxes of poses, with the features that are left to
    each contact."""
    tried: int
    """How often a pose was sought that meets every bound."""
    tested: int
    """Pose sets found: of each interpretation one, or as many as it has components."""
    hypotheses: int
    """Distinct poses among them."""
    complete: bool
    """False if a limit ended it, so that hypotheses may be missing."""
    search_seconds: float
    """Time for the search."""
    cluster_seconds: float
    """Time for grouping."""

    @classmethod
    def none(cls, object_name: str) -> Search:
        """Of a model that was ruled out at once."""
        return cls(object_name, 0, 0, 0, 0, True, 0.0, 0.0)
