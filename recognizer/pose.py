"""The model test: from an interpretation to a pose that meets its bounds, or to none.

A pose is fitted by joint least squares on normals and plane offsets, started from the rotation
that the normals ask for, with each contact held to its bounded face. If the fit breaks a bound, the
pose is moved to where all are met. If that fails, the poses are searched by branch and bound, and
the interpretation is rejected only if each part of that search is proved to hold none.

The memo (Section 3) averages rotations over pairs of normals and translations over triples of
planes. Two of its formulas mislead: its cosine and sine of the angle, put into its own matrix, give
the inverse rotation; and normals alone give a rotation to degrees, where offsets fitted jointly
give it to tenths of a degree.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import RigidTransform, Rotation

from . import branch_kernels, pose_kernels
from .contacts import Contacts
from .polyhedron import Polyhedron

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Poses:
    """Interpretations that some pose satisfies, each with such a pose."""

    faces: NDArray[np.int32]
    """(m, n) a face for each contact."""
    rotations: Floats
    """(m, 3, 3) object to world."""
    translations: Floats
    """(m, 3) object to world, metres."""
    costs: Floats
    """(m,) least-squares misfit, in variances of the readings."""
    informations: Floats
    """(m, 6, 6) information about small motions of the object in its own frame: rotation about
    its centroid times its radius, then shift; inverse square metres."""
    proven: NDArray[np.bool_]
    """(m,) whether the pose meets every bound; else none was found and none excluded."""

    def __len__(self) -> int:
        return len(self.faces)

    def take(self, rows: NDArray[np.intp] | NDArray[np.bool_]) -> Poses:
        """The poses of some rows."""
        return Poses(
            self.faces[rows],
            self.rotations[rows],
            self.translations[rows],
            self.costs[rows],
            self.informations[rows],
            self.proven[rows],
        )


class ModelTest:
    """The model test for one model; holds the model as the kernels read it."""

    def __init__(self, model: Polyhedron, *, boxes: int = 256, pool: int = 20_000) -> None:
        """Prepare a model.

        Args:
            model: the object.
            boxes: boxes of rotations to look at before an interpretation is left undecided.
            pool: the same for all interpretations of one call together; a thousand take about
                a tenth of a second.
        """
        self._boxes, self._pool = boxes, pool
        hulls, pieces = model.hulls, model.pieces
        self.radius = model.diameter / 2.0
        self._model = (
            model.normals,
            model.offsets,
            pieces.first + model.face_count,
            np.concatenate([hulls.start[:-1], pieces.start + len(hulls.corners)]),
            np.concatenate([hulls.corners, pieces.corners]),
            model.centroid,
            self.radius,
        )
        counts = np.diff(hulls.start)
        self._middles = np.add.reduceat(hulls.corners, hulls.start[:-1], axis=0) / counts[:, None]

    def run(self, interpretations: NDArray[np.int32], contacts: Contacts) -> Poses:
        """Drop the interpretations that no pose satisfies; give each of the rest a pose.

        Args:
            interpretations: (m, n) a face for each contact.
            contacts: the n contacts.
        """
        verdicts, *rest = self._verdicts(interpretations, contacts, pass_vague=False)
        rotations, translations, costs, informations = rest
        poses = Poses(
            interpretations,
            rotations,
            translations,
            costs,
            informations,
            verdicts == branch_kernels.FEASIBLE,
        )
        return poses.take(verdicts != branch_kernels.REJECTED)

    def prune(self, interpretations: NDArray[np.int32], contacts: Contacts) -> NDArray[np.int32]:
        """Drop partial interpretations that no pose satisfies, where that is quickly shown.

        Args:
            interpretations: (m, k) a face for each of the first k contacts.
            contacts: those k contacts.
        """
        verdicts = self._verdicts(interpretations, contacts, pass_vague=True)[0]
        return interpretations[verdicts != branch_kernels.REJECTED]

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
            faces: (n,) a face for each contact.
            contacts: the n contacts.
            pose: where to start.
            motions: (d, 6) unit small motions: rotation about the centroid times the radius, shift.
            step: distance between neighbours, metres.
            most: the most poses.

        Returns:
            A stack of poses, the first of them ``pose``.
        """
        rotations, translations = np.empty((most, 3, 3)), np.empty((most, 3))
        found = pose_kernels.span_family(
            faces.astype(np.int64),
            contacts.positions,
            contacts.normals,
            contacts.position_error,
            contacts.normal_error,
            self._model,
            pose.rotation.as_matrix(),
            np.array(pose.translation),
            np.ascontiguousarray(motions),
            step,
            rotations,
            translations,
        )
        return RigidTransform.from_components(
            translations[:found], Rotation.from_matrix(rotations[:found])
        )

    def _verdicts(
        self, interpretations: NDArray[np.int32], contacts: Contacts, *, pass_vague: bool
    ) -> tuple[NDArray[np.int8], Floats, Floats, Floats, Floats]:
        return pose_kernels.test_interpretations(
            interpretations,
            contacts.positions,
            contacts.normals,
            contacts.position_error,
            contacts.normal_error,
            self._model,
            self._middles,
            self._boxes,
            self._pool,
            pass_vague,
        )
