"""The model test of the plane: from an interpretation to the poses that meet its bounds, or none.

Three degrees of freedom: an angle and a shift. Rotations are searched over the whole arc that the
normals allow, with a proof for each that is excluded, so that the verdict is exact; and because the
search is exact, it also tells poses apart that one interpretation allows in separate arcs, as it
may where normals are missing. Each is then drawn to the least-squares fit of normals, lines and
ends of the edges, as far as the bounds allow.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import RigidTransform, Rotation

from ...contacts.contacts import Contacts
from ...models.polygon import Polygon
from . import pose_kernels as planar_pose_kernels

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PlanarPoses:
    """Poses that interpretations of contacts allow: one for each arc of rotations of each."""

    faces: NDArray[np.int32]
    """(m, n) an edge for each contact. An interpretation with two separate arcs stands here
    twice."""
    angles: Floats
    """(m,) rotation object to world, radians."""
    translations: Floats
    """(m, 2) object to world, metres."""
    costs: Floats
    """(m,) least-squares misfit, in variances of the readings."""
    informations: Floats
    """(m, 3, 3) information about small motions of the object in its own frame: rotation about
    its centroid times its radius, then shift; inverse square metres."""
    proven: NDArray[np.bool_]
    """(m,) whether the pose meets every bound; else none was found and none excluded."""
    arcs: Floats
    """(m, 2) first and last angle of its arc, radians: no rotation outside the arcs of an
    interpretation meets its bounds."""

    def __len__(self) -> int:
        return len(self.faces)

    @property
    def interpretations(self) -> int:
        """How many different interpretations there are."""
        return len(np.unique(self.faces, axis=0))

    def take(self, rows: NDArray[np.intp] | NDArray[np.bool_]) -> PlanarPoses:
        """The poses of some rows."""
        return PlanarPoses(
            self.faces[rows],
            self.angles[rows],
            self.translations[rows],
            self.costs[rows],
            self.informations[rows],
            self.proven[rows],
            self.arcs[rows],
        )

    def in_space(self) -> RigidTransform:
        """The poses as rigid transforms, object to world, in the plane z = 0."""
        return lift(self.angles, self.translations)


def lift(angles: Floats, translations: Floats) -> RigidTransform:
    """Poses of the plane, (m,) radians and (m, 2) metres, as rigid transforms that keep z."""
    return RigidTransform.from_components(
        np.column_stack([translations, np.zeros(len(translations))]),
        Rotation.from_rotvec(np.asarray(angles)[:, None] * [0.0, 0.0, 1.0]),
    )


class PlanarModelTest:
    """The model test for one outline; holds it as the kernels read it."""

    def __init__(
        self, polygon: Polygon, *, rotations: int = 256, resolution: float = np.radians(1.0)
    ) -> None:
        """Prepare an outline.

        Args:
            polygon: the outline.
            rotations: rotations to look at before an interpretation is left undecided.
            resolution: how closely to look for gaps between the rotations that one interpretation
                allows, radians.
        """
        self._most, self._resolution = rotations, resolution
        self._centroid = polygon.centroid
        self.radius = polygon.diameter / 2.0
        along = polygon.segments[:, 1] - polygon.segments[:, 0]
        self._outline = (
            polygon.segments[:, 0] - polygon.centroid,
            along / polygon.lengths[:, None],
            np.array(polygon.lengths),
            np.arctan2(polygon.normals[:, 1], polygon.normals[:, 0]),
            self.radius,
        )

    def run(self, interpretations: NDArray[np.int32], contacts: Contacts) -> PlanarPoses:
        """Drop the interpretations that no pose satisfies; give each of the rest its poses.

        Args:
            interpretations: (m, n) an edge for each contact.
            contacts: the n contacts.
        """
        sources, arcs, angles, places, costs, informations, proven = (
            planar_pose_kernels.test_interpretations(
                interpretations,
                _readings(contacts),
                self._outline,
                self._most,
                self._resolution,
            )
        )
        turns = np.round(angles / (2.0 * np.pi)) * 2.0 * np.pi
        return PlanarPoses(
            interpretations[sources],
            angles - turns,
            places - _turned(angles, self._centroid),
            costs,
            informations,
            proven,
            arcs - turns[:, None],
        )

    def prune(self, interpretations: NDArray[np.int32], contacts: Contacts) -> NDArray[np.int32]:
        """Drop partial interpretations that no pose satisfies.

        Args:
            interpretations: (m, k) an edge for each of the first k contacts.
            contacts: those k contacts.
        """
        verdicts = planar_pose_kernels.reject(
            interpretations, _readings(contacts), self._outline, self._most
        )
        return interpretations[verdicts != planar_pose_kernels.REJECTED]

    def span(
        self,
        faces: NDArray[np.int32],
        contacts: Contacts,
        pose: RigidTransform,
        motions: Floats,
        step: float,
        most: int,
    ) -> RigidTransform:
        """Poses that an interpretation allows, a step apart along the motions it leaves open.

        Args:
            faces: (n,) an edge for each contact.
            contacts: the n contacts.
            pose: where to start, in the plane.
            motions: (d, 3) unit small motions: rotation about the centroid times the radius, shift.
            step: distance between neighbours, metres.
            most: the most poses.

        Returns:
            A stack of poses, the first of them ``pose``.
        """
        angle = float(pose.rotation.as_rotvec()[2])
        start = np.array(pose.translation[:2]) + _turned(np.array([angle]), self._centroid)[0]
        angles, places = np.empty(most), np.empty((most, 2))
        found = planar_pose_kernels.span_family(
            faces.astype(np.int64),
            _readings(contacts),
            self._outline,
            angle,
            start,
            np.ascontiguousarray(motions),
            step,
            angles,
            places,
        )
        angles, places = angles[:found], places[:found]
        return lift(angles, places - _turned(angles, self._centroid))


def _readings(contacts: Contacts) -> tuple[Floats, Floats, Floats, Floats]:
    """Contacts of the plane as the kernels read them: normals as angles."""
    directions = np.arctan2(contacts.normals[:, 1], contacts.normals[:, 0])
    return contacts.positions, directions, contacts.position_error, contacts.normal_error


def _turned(angles: Floats, point: Floats) -> Floats:
    """(m, 2) a point turned by each angle."""
    cosines, sines = np.cos(angles), np.sin(angles)
    x, y = point
    return np.column_stack([cosines * x - sines * y, sines * x + cosines * y])
