"""What a policy sees: contacts, rays and the leading hypotheses, in arrays of fixed size."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from gymnasium import spaces
from scipy.spatial.transform import Rotation

from ..recognizer import Belief, Contacts
from ..recognizer.predict.prediction import PoseSamples
from .sensors.touch import Touch

Observation = dict[str, Any]
"""Arrays by name, as `ObservationLayout.space` has them."""


@dataclass(frozen=True, kw_only=True)
class ObservationLayout:
    """Sizes and limits of the observation arrays."""

    rays: int
    """The most rays in an episode."""
    hypotheses: int
    """Hypotheses shown, heaviest first."""
    samples: int
    """Poses shown that stand for the belief."""
    objects: int
    """Objects in the library."""
    extent: float
    """Largest coordinate that can occur, metres."""

    def space(self) -> spaces.Dict:
        """The observation space."""
        rays, shown, extent = self.rays, self.hypotheses, self.extent
        samples = self.samples
        largest = np.iinfo(np.int64).max

        def box(low: float, high: float, *shape: int) -> spaces.Box:
            return spaces.Box(low, high, shape, np.float64)

        def integers(low: int, high: int, *shape: int) -> spaces.Box:
            return spaces.Box(low, high, shape, np.int64)

        return spaces.Dict(
            {
                "contact_count": integers(0, rays, 1),
                "contact_positions": box(-extent, extent, rays, 3),
                "contact_normals": box(-1.0, 1.0, rays, 3),
                "contact_position_error": box(0.0, extent, rays),
                "contact_normal_error": box(0.0, np.pi, rays),
                "contact_kinds": integers(0, 3, rays),
                "ray_count": integers(0, rays, 1),
                "ray_starts": box(-extent, extent, rays, 3),
                "ray_ends": box(-extent, extent, rays, 3),
                "ray_outcomes": integers(0, 3, rays),
                "hypothesis_count": integers(0, largest, 1),
                "hypothesis_objects": integers(-1, self.objects - 1, shown),
                "hypothesis_positions": box(-extent, extent, shown, 3),
                "hypothesis_quaternions": box(-1.0, 1.0, shown, 4),
                "hypothesis_weights": box(0.0, 1.0, shown),
                "hypothesis_determined": integers(0, 1, shown),
                "interpretation_count": integers(0, largest, 1),
                "sample_count": integers(0, samples, 1),
                "sample_objects": integers(-1, self.objects - 1, samples),
                "sample_hypotheses": integers(0, largest, samples),
                "sample_positions": box(-extent, extent, samples, 3),
                "sample_quaternions": box(-1.0, 1.0, samples, 4),
                "sample_weights": box(0.0, 1.0, samples),
                "sample_position_spread": box(0.0, extent, samples),
                "sample_rotation_spread": box(0.0, np.pi, samples),
            }
        )

    @cached_property
    def _kinds(self) -> dict[str, tuple[tuple[int, ...], np.dtype[Any]]]:
        """Shape and type of each array; the space itself takes longer to build than a touch."""
        spaces = self.space().items()
        return {key: (space.shape or (1,), np.dtype(space.dtype)) for key, space in spaces}

    def pack(
        self,
        contacts: Contacts,
        touches: Sequence[Touch],
        belief: Belief | None,
        samples: PoseSamples,
        object_index: dict[str, int],
    ) -> Observation:
        """The observation of an episode so far; every array is fresh.

        Unused rows are zero, and ``hypothesis_objects`` is -1 there.
        """
        values: Observation = {key: np.zeros(*kind) for key, kind in self._kinds.items()}
        count = len(contacts)
        values["contact_count"][0] = count
        values["contact_positions"][:count] = contacts.positions
        values["contact_normals"][:count] = np.clip(contacts.normals, -1.0, 1.0)
        values["contact_position_error"][:count] = contacts.position_error
        values["contact_normal_error"][:count] = contacts.normal_error
        values["contact_kinds"][:count] = contacts.kinds
        sent = 0
        for touch in touches:
            rows = slice(sent, sent + len(touch.outcomes))
            values["ray_starts"][rows] = touch.starts_world
            values["ray_ends"][rows] = touch.ends_world
            values["ray_outcomes"][rows] = touch.outcomes
            sent = rows.stop
        values["ray_count"][0] = sent
        values["hypothesis_objects"][:] = -1
        hypotheses = belief.hypotheses if belief else ()
        values["hypothesis_count"][0] = len(hypotheses)
        values["interpretation_count"][0] = belief.interpretations if belief else 0
        leading = hypotheses[: self.hypotheses]
        if leading:
            rows = slice(len(leading))
            poses = np.array([hypothesis.T_world_object for hypothesis in leading])
            quaternions = Rotation.from_matrix(poses[:, :3, :3]).as_quat(canonical=True)
            values["hypothesis_objects"][rows] = [object_index[h.object_name] for h in leading]
            values["hypothesis_positions"][rows] = poses[:, :3, 3].clip(-self.extent, self.extent)
            values["hypothesis_quaternions"][rows] = quaternions.clip(-1.0, 1.0)
            values["hypothesis_weights"][rows] = [hypothesis.weight for hypothesis in leading]
            values["hypothesis_determined"][rows] = [h.determined for h in leading]
        shown = len(samples)
        values["sample_count"][0] = shown
        values["sample_objects"][:shown] = samples.objects
        values["sample_hypotheses"][:shown] = samples.hypotheses
        values["sample_positions"][:shown] = samples.positions.clip(-self.extent, self.extent)
        values["sample_quaternions"][:shown] = samples.rotations.clip(-1.0, 1.0)
        values["sample_weights"][:shown] = samples.weights.clip(0.0, 1.0)
        values["sample_position_spread"][:shown] = samples.position_spread.clip(0.0, self.extent)
        values["sample_rotation_spread"][:shown] = samples.rotation_spread.clip(0.0, np.pi)
        return values


def check_sizes(**sizes: int) -> None:
    """Check the arguments that say how much an observation holds.

    Raises:
        ValueError: one is below 1.
    """
    for name, value in sizes.items():
        if value < 1:
            raise ValueError(f"{name} is {value}; it must be at least 1")
