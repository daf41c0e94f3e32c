"""A case of the soundness campaign: an object touched at a known pose, and who is asked."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import RigidTransform

from ....assets import mesh_path
from ....assets.planar import PLANAR_NAMES, planar_corners
from ....recognizer import (
    Belief,
    Contacts,
    FreeSpace,
    Hypothesis,
    Polygon,
    Polyhedron,
    Recognizer,
    Search,
    SearchLimits,
    SupportPlane,
)


@dataclass(frozen=True, eq=False)
class Case:
    """One object, touched, and what is known of it."""

    name: str
    """``KIND:INDEX``."""
    model: Polyhedron | Polygon
    recognizer: Recognizer
    truth: RigidTransform
    interpretation: NDArray[np.int32]
    """(n,) the feature that each contact is really on; -1 for an outlier."""
    contacts: Contacts
    outliers: int = 0
    free_space: FreeSpace | None = None
    support: SupportPlane | None = None
    told: int = 0
    """Of how many contacts, the first, the interpretation is told, so that the search goes on from
    there; where it can't be told, it may take minutes."""

    def recognize(self) -> Belief:
        """What the recogniser makes of it."""
        if self.told:
            return self.recognizer.update(self._told(), self.contacts[self.told :])
        return self.recognizer.recognize(
            self.contacts,
            outliers=self.outliers,
            free_space=self.free_space,
            support=self.support,
        )

    def _told(self) -> Belief:
        """A belief in the true interpretation of the first contacts and in nothing else."""
        truth = Hypothesis(
            object_name=self.model.name,
            T_world_object=self.truth.as_matrix(),
            weight=1.0,
            interpretations=self.interpretation[None, : self.told],
            freedoms=np.eye(6),
            covariance=np.eye(6),
        )
        search = Search.none(self.model.name)
        return Belief(
            (truth,),
            (search,),
            self.contacts[: self.told],
            self.recognizer.library,
            self.recognizer.tolerance,
        )


@cache
def load(name: str) -> Polyhedron | Polygon:
    """A stand-in, in space or in the plane."""
    if name in PLANAR_NAMES:
        return Polygon.from_corners(planar_corners(name), name=name)
    return Polyhedron.from_mesh(mesh_path(name), name=name)


@cache
def recognizer(
    names: tuple[str, ...], features: Literal["faces", "all"], limits: SearchLimits
) -> Recognizer:
    """One a process and library: its tables take up to half a second to build."""
    return Recognizer([load(name) for name in names], features=features, limits=limits)
