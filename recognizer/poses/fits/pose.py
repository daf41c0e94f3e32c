"""Poses of interpretations, and contacts and models as the kernels read them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from ...contacts.contacts import Contacts
from ...models.features import Features
from ...models.polyhedron import Polyhedron
from ...models.prism import Prism

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


class KernelModel:
    """A model as the kernels read it.

    That is `model`: normals (f, 3) and offsets (f,) of the features' planes; (f + 1,) the first
    convex piece of each feature; (p + 1,) the first corner of each polygon, of which the first f
    are the features' hulls and the rest their pieces; corners (c, 3); centroid (3,); radius,
    metres; (f + 1,) the first normal of each feature's cone; normals (k, 3).
    """

    def __init__(self, model: Polyhedron | Prism, features: Features) -> None:
        """Prepare a model.

        Args:
            model: the object.
            features: what of it contacts may lie on.
        """
        self.features = features
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
