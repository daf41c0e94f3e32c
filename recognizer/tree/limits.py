"""How far a search goes before it is cut short."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class SearchLimits:
    """When a search is cut short."""

    budget: int = 100_000
    """The most interpretations of one model; more, and the belief says that it is not complete."""
    nodes: int = 2_000_000
    """The most nodes of one model's tree, boxes of poses with the features that are left to
    contacts; likewise."""

    def __post_init__(self) -> None:
        for name in ("budget", "nodes"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} is {getattr(self, name)}; it must be at least 1")
