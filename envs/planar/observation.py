"""What a policy sees in the plane: as `observation`, with two coordinates and one angle."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from gymnasium import spaces
from scipy.spatial.transform import RigidTransform

from ...recognizer import Belief, Contacts
from ..observation import Observation
from .probe import PlanarTouch


@dataclass(frozen=True, kw_only=True)
class PlanarObservationLayout:
    """Sizes and limits of the observation arrays."""

    rays: int
    """Rays in an episode: one a probe."""
    hypotheses: int
    """Hypotheses shown, heaviest first."""
    objects: int
    """Outlines in the library."""
    extent: float
    """Largest coordinate that can occur, metres."""

    def space(self) -> spaces.Dict:
        """The observation space."""
        rays, shown, extent = self.rays, self.hypotheses, self.extent
        largest = np.iinfo(np.int64).max

        def box(low: float, high: float, *shape: int) -> spaces.Box:
            return spaces.Box(low, high, shape, np.float64)

        def integers(low: int, high: int, *shape: int) -> spaces.Box:
            return spaces.Box(low, high, shape, np.int64)

        return spaces.Dict(
            {
                "contact_count": integers(0, rays, 1),
                "contact_positions": box(-extent, extent, rays, 2),
                "contact_normals": box(-1.0, 1.0, rays, 2),
                "contact_position_error": box(0.0, extent, rays),
                "contact_normal_error": box(0.0, np.pi, rays),
                "ray_count": integers(0, rays, 1),
                "ray_starts": box(-extent, extent, rays, 2),
                "ray_ends": box(-extent, extent, rays, 2),
                "ray_outcomes": integers(0, 3, rays),
                "hypothesis_count": integers(0, largest, 1),
                "hypothesis_objects": integers(-1, self.objects - 1, shown),
                "hypothesis_positions": box(-extent, extent, shown, 2),
                "hypothesis_angles": box(-np.pi, np.pi, shown),
                "hypothesis_weights": box(0.0, 1.0, shown),
                "hypothesis_determined": integers(0, 1, shown),
                "interpretation_count": integers(0, largest, 1),
            }
        )

    def pack(
        self,
        contacts: Contacts,
        touches: list[PlanarTouch],
        belief: Belief | None,
        object_index: dict[str, int],
    ) -> Observation:
        """The observation of an episode so far; every array is fresh.

        Unused rows are zero, and ``hypothesis_objects`` is -1 there.
        """
        values = {
            key: np.zeros(space.shape or (1,), space.dtype) for key, space in self.space().items()
        }
        count = len(contacts)
        values["contact_count"][0] = count
        values["contact_positions"][:count] = contacts.positions
        values["contact_normals"][:count] = np.clip(contacts.normals, -1.0, 1.0)
        values["contact_position_error"][:count] = contacts.position_error
        values["contact_normal_error"][:count] = contacts.normal_error
        for row, touch in enumerate(touches):
            values["ray_starts"][row] = touch.start_world
            values["ray_ends"][row] = touch.end_world
            values["ray_outcomes"][row] = touch.outcome
        values["ray_count"][0] = len(touches)
        values["hypothesis_objects"][:] = -1
        hypotheses = belief.hypotheses if belief else ()
        values["hypothesis_count"][0] = len(hypotheses)
        values["interpretation_count"][0] = belief.interpretations if belief else 0
        for row, hypothesis in enumerate(hypotheses[: self.hypotheses]):
            pose = hypothesis.pose
            position = np.clip(pose.translation[:2], -self.extent, self.extent)
            values["hypothesis_objects"][row] = object_index[hypothesis.object_name]
            values["hypothesis_positions"][row] = position
            values["hypothesis_angles"][row] = planar_angle(pose)
            values["hypothesis_weights"][row] = hypothesis.weight
            values["hypothesis_determined"][row] = hypothesis.determined
        return values


def planar_angle(pose: RigidTransform) -> float:
    """How far a pose within the plane turns about the vertical, radians from -pi to pi."""
    matrix = pose.rotation.as_matrix()
    return float(np.arctan2(matrix[1, 0], matrix[0, 0]))
