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

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import RigidTransform, Rotation

from ...contacts.contacts import Contacts
from ...models.features import Features, face_features
from ...models.polyhedron import Polyhedron
from . import family_kernels, pose_kernels
from .verdict_kernels import FEASIBLE, REJECTED

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
    reaches: Floats
    """(m, 2) how far any pose it stands for can be from it: the turn, radians, and the way of the
    object's centroid, metres; infinite where that isn't known."""

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
            self.reaches[rows],
        )

    @classmethod
    def join(cls, parts: Sequence[Poses]) -> Poses:
        """The poses of all parts, at least one, in order."""
        return cls(*(np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(cls)))


KernelContacts = tuple[Floats, Floats, Floats, Floats, Floats]


def kernel_contacts(contacts: Contacts) -> KernelContacts:
    """Contacts as the kernels read them.

    Returns:
        Positions (n, 3), metres, and unit normals (n, 3), world frame; bounds on distances (n,),
        metres, on chords between normals (n,; 2 if unknown) and on sines of the angle between them
        (n,; 1 if it may be a right angle).
    """
    errors = contacts.normal_error
    # Copies: the kernels would be compiled again for arrays that can't be written.
    return (
        contacts.positions.copy(),
        contacts.normals.copy(),
        contacts.position_error.copy(),
        2.0 * np.sin(0.5 * errors),
        np.sin(np.minimum(errors, np.pi / 2.0)),
    )


class ModelTest:
    """The model test for one model; holds the model as the kernels read it.

    That is `model`: normals (f, 3) and offsets (f,) of the features' planes; (f + 1,) the first
    convex piece of each feature; (p + 1,) the first corner of each polygon, of which the first f
    are the features' hulls and the rest their pieces; corners (c, 3); centroid (3,); radius,
    metres; (f + 1,) the first normal of each feature's cone; normals (k, 3).
    """

    def __init__(
        self,
        model: Polyhedron,
        features: Features | None = None,
        *,
        boxes: int = 2_000,
        pool: int = 300_000,
    ) -> None:
        """Prepare a model.

        Args:
            model: the object.
            features: what of it contacts may lie on; its faces by default.
            boxes: boxes of rotations to look at before an interpretation is left undecided.
            pool: the same for all interpretations of one call together; a thousand take about
                ten milliseconds.
        """
        self.boxes, self.pool = boxes, pool
        self.features = features = features or face_features(model)
        self.radius = model.diameter / 2.0
        self.model = (
            features.normals,
            features.offsets,
            features.first,
            features.start,
            features.corners,
            model.centroid,
            self.radius,
            features.cone_start,
            features.cone_normals,
        )
        self.middles = np.ascontiguousarray(features.middles)

    def run(self, interpretations: NDArray[np.int32], contacts: Contacts) -> Poses:
        """Drop the interpretations that no pose satisfies; give each of the rest a pose.

        Args:
            interpretations: (m, n) a feature for each contact, -1 for none.
            contacts: the n contacts.
        """
        verdicts, turns, shifts, costs, informations = pose_kernels.test_interpretations(
            np.ascontiguousarray(interpretations, np.int32),
            kernel_contacts(contacts),
            self.model,
            self.features.half_angles,
            self.middles,
            self.boxes,
            self.pool,
        )
        proven = verdicts == FEASIBLE
        unknown = np.full((len(turns), 2), np.inf)
        poses = Poses(interpretations, turns, shifts, costs, informations, proven, unknown)
        return poses.take(verdicts != REJECTED)

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
            faces: (n,) a feature for each contact, -1 for none.
            contacts: the n contacts.
            pose: where to start.
            motions: (d, 6) unit small motions: rotation about the centroid times the radius, shift.
            step: distance between neighbours, metres.
            most: the most poses.

        Returns:
            A stack of poses, the first of them ``pose``.
        """
        rotations, translations = np.empty((most, 3, 3)), np.empty((most, 3))
        found = family_kernels.span_family(
            faces.astype(np.int64),
            kernel_contacts(contacts),
            self.model,
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
