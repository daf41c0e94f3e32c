"""Where an object truly is, read off what `info` tells for scoring."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from scipy.spatial.transform import RigidTransform

from ..recognizer import Polygon, Polyhedron

Model = TypeVar("Model", Polyhedron, Polygon)


@dataclass(frozen=True, eq=False)
class Truth(Generic[Model]):
    """What was touched, and how it truly lies."""

    model: Model
    T_world_object: RigidTransform
    """Model to world."""

    @classmethod
    def of(cls, library: Sequence[Model], info: Mapping[str, Any]) -> Truth[Model]:
        """As the ``info`` of a step or of a reset tells it.

        Args:
            library: the environment's.
            info: what the environment returned last.
        """
        told = info["truth"]
        model = next(model for model in library if model.name == told["object"])
        # Not made orthonormal again, which changes its last bits.
        return cls(model, RigidTransform(told["pose"], normalize=False))
