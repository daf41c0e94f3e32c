"""How far a search goes before it is cut short."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class SearchLimits:
    """How the tree is grown, and when it is cut short."""

    budget: int = 100_000
    """The most interpretations of one model; more, and the belief says that it is not complete."""
    nodes: int = 2_000_000
    """The most nodes of one model's tree, boxes of poses with the features that are left to
    contacts; likewise."""
    crowd: int = 1
    """Ways to assign what is left to contacts up to which these are tried one by one, instead of
    asking first which of them the poses allow."""
    few: int = 16
    """In the plane: interpretations up to which no model test is made between stages."""
    first_stage: int = 4
    """In the plane: levels grown before the first model test."""
    stage: int = 4
    """In the plane: levels grown between two model tests, while interpretations are few."""
    flood: int = 2000
    """In the plane: interpretations at which a stage is grown a level at a time instead."""

    def __post_init__(self) -> None:
        for name in ("budget", "nodes", "crowd", "few", "first_stage", "stage", "flood"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} is {getattr(self, name)}; it must be at least 1")
