"""What is known of an object besides its contacts: free space, support, approaches."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..contacts.contacts import APPROACH_ERROR, Contacts
from ..contacts.free_space import FreeSpace
from ..contacts.support import StableFace, SupportPlane
from .entry import Entry, SolidEntry

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

GRAIN = 0.005
"""The strictness of the test of a path, as a share of its error: a pose is accepted if it leaves
the path so much more room than it must."""
NOWHERE = 1 << 30
"""More features than any solid has."""


@dataclass(frozen=True, eq=False)
class Surroundings:
    """What is known of an object besides its contacts."""

    free_space: FreeSpace
    support: SupportPlane | None

    @classmethod
    def of(cls, free_space: FreeSpace | None, support: SupportPlane | None) -> Surroundings:
        """Hold what is known, if anything."""
        return cls(free_space or FreeSpace.none(), support)

    def says_nothing(self, contacts: Contacts) -> bool:
        """Whether nothing is known, approaches of contacts included."""
        return not len(self.free_space) and self.support is None and not contacts.approaches.any()


class Known(NamedTuple):
    """The same as the kernels read it; world frame, metres; corners in the object's frame."""

    anything: bool
    fronts: Floats
    """(n, 3) the way back along each contact's approach, unit; zero where that is unknown."""
    leasts: Floats
    """(n,) the least cosine between it and a normal of what is touched; -1 where unknown."""
    up: Floats
    """(3,) of the support, unit."""
    corners: Floats
    """(v, 3) of the object's hull, ..."""
    signs: Floats
    """(v,) ... each of which is above (1) or below (-1) ..."""
    limits: Floats
    """(v,) ... a height along ``up``."""
    square: int
    """The first of the features that stand for planes of support: what the object stands on."""
    feet: Floats
    """(c, 3) corners of the faces that these belong to, ..."""
    foot_start: Ints
    """(k + 1,) ... the first of each, ..."""
    ceiling: float
    """... and the height that they are below, where the object stands on that face."""
    slack: float
    """Bound on heights."""
    starts: Floats
    """(m, 3) of free paths, ..."""
    ends: Floats
    """(m, 3) ..."""
    clearances: Floats
    """(m,) ... the least signed distance of each from the object, ..."""
    grains: Floats
    """(m,) ... how strict its test is, ..."""
    scales: Floats
    """(m,) ... and its bound."""
    solid_faces: int
    """How many of the features are faces of the solid."""
    bound: float
    """Radius about the centroid that holds the solid."""


def nothing_known(count: int) -> Known:
    """That nothing is known besides so many contacts."""
    none, rows = np.zeros(0), np.zeros((0, 3))
    return Known(
        *(False, np.zeros((count, 3)), np.full(count, -1.0), np.array([0.0, 0.0, 1.0])),
        *(rows, none, none, NOWHERE, rows, np.zeros(1, np.int64), 0.0, 1.0),
        *(rows, rows, none, none, none, 0, 0.0),
    )


def known_of(
    entry: Entry,
    contacts: Contacts,
    surroundings: Surroundings,
    upright: Floats,
    feet: Sequence[StableFace],
    square: int = NOWHERE,
) -> Known:
    """What is known, as the kernels read it.

    Args:
        entry: the model.
        contacts: what was felt, turned by ``upright``.
        surroundings: what is known besides, not turned.
        upright: (3, 3) a rotation of the world.
        feet: faces of its hull that it stands on: one of them, and it is known which by the first
            contact's feature; or the only one, if ``square`` is `NOWHERE`.
        square: the feature that stands for the plane of the first.
    """
    known, free, model = nothing_known(len(contacts)), surroundings.free_space, entry.body
    if surroundings.says_nothing(contacts):
        return known
    known = known._replace(
        anything=True,
        fronts=-contacts.approaches,
        leasts=np.where(contacts.approach_known, -np.sin(APPROACH_ERROR), -1.0),
        starts=np.ascontiguousarray(free.starts @ upright.T),
        ends=np.ascontiguousarray(free.ends @ upright.T),
        clearances=free.clearance,
        grains=GRAIN * free.error,
        scales=free.error.copy(),
        solid_faces=model.face_count,
        bound=float(np.linalg.norm(model.vertices - model.centroid, axis=1).max()),
    )
    support = surroundings.support
    if support is None or not isinstance(entry, SolidEntry):
        return known
    corners = entry.corners
    low, high = support.height - support.error, support.height + support.error
    known = known._replace(
        up=upright @ support.up,
        corners=corners,
        signs=np.ones(len(corners)),
        limits=np.full(len(corners), low),
        ceiling=high,
        slack=support.error,
    )
    if not feet:
        return known
    if square != NOWHERE:
        sizes = [len(face.corners) for face in feet]
        return known._replace(
            square=square,
            feet=np.concatenate([face.corners for face in feet]),
            foot_start=np.cumsum([0, *sizes]).astype(np.int64),
        )
    below = feet[0].corners
    return known._replace(
        corners=np.concatenate([corners, below]),
        signs=np.concatenate([known.signs, -np.ones(len(below))]),
        limits=np.concatenate([known.limits, np.full(len(below), high)]),
    )
