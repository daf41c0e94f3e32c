"""An object that is free to move: how far a push has moved it, and what that does to what was felt.

Contacts and free space say where the object was when they were made. If it has moved since by no
more than a known distance, they still hold with bounds that much wider.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import RigidTransform

from ...recognizer import Contacts, FreeSpace, Polyhedron
from ...recognizer.contacts.contacts import APPROACH_ERROR


@dataclass(frozen=True, kw_only=True)
class Displacement:
    """How far an object has moved, or may have: bounds on both."""

    distance: float
    """The largest distance by which any point of it moved, metres."""
    turn: float
    """The angle by which it turned, radians."""

    def __post_init__(self) -> None:
        if not (np.isfinite(self.distance) and self.distance >= 0.0):
            raise ValueError(f"distance is {self.distance:g} m; it must be zero or more")
        if not 0.0 <= self.turn <= np.pi:
            raise ValueError(f"turn is {self.turn:g} rad; it must be from 0 to pi")

    def __or__(self, other: Displacement) -> Displacement:
        """A bound on either."""
        return Displacement(
            distance=max(self.distance, other.distance), turn=max(self.turn, other.turn)
        )

    def __add__(self, other: Displacement) -> Displacement:
        """A bound on one after the other, by the triangle inequality, for points and for turns."""
        return Displacement(
            distance=self.distance + other.distance, turn=min(self.turn + other.turn, np.pi)
        )


STILL = Displacement(distance=0.0, turn=0.0)
"""Of what hasn't moved."""


def displacement(
    model: Polyhedron, reference: RigidTransform, current: RigidTransform
) -> Displacement:
    """How far an object has moved from one pose to another.

    Args:
        model: the object.
        reference: its pose before, model to world.
        current: its pose now.
    """
    # The distance that a point moves is convex in the point, so a corner moves farthest.
    moved = current.apply(model.vertices) - reference.apply(model.vertices)
    return Displacement(
        distance=float(np.linalg.norm(moved, axis=1).max()),
        turn=float((current.rotation * reference.rotation.inv()).magnitude()),
    )


def grown(
    contacts: Contacts,
    moved: Displacement,
    *,
    limit: float = np.inf,
    approach_error: float = 0.0,
) -> Contacts:
    """Contacts of an object that has moved since, with bounds that hold for where it is now.

    The point touched moved by no more than the farthest point of the object, and the normal there
    turned as the object did.

    Args:
        contacts: what was felt before the object moved.
        moved: how far it has moved since.
        limit: contacts whose position would be known to no better than this are dropped, metres.
        approach_error: how far off the directions of approaches are already, radians; they are
            kept while that and the turn are within `APPROACH_ERROR`, which is what contacts promise
            of them.

    Returns:
        The contacts that are still worth having, in order.

    Raises:
        ValueError: a limit that isn't above zero, or an approach error below zero.
    """
    if not limit > 0.0:
        raise ValueError(f"limit is {limit:g} m; it must be above zero")
    if not approach_error >= 0.0:
        raise ValueError(f"approach error is {approach_error:g} rad; it must be zero or more")
    error = contacts.position_error + moved.distance
    kept = error <= limit
    still_known = moved.turn + approach_error <= APPROACH_ERROR
    return Contacts(
        contacts.positions[kept],
        contacts.normals[kept],
        position_error=error[kept],
        normal_error=np.minimum(contacts.normal_error[kept] + moved.turn, np.pi),
        approaches=contacts.approaches[kept] if still_known else None,
        kinds=contacts.kinds[kept],
    )


def grown_free_space(
    free_space: FreeSpace, moved: Displacement, *, limit: float = np.inf
) -> FreeSpace:
    """Paths swept before the object moved, with an error that holds for where it is now.

    No point's distance from the object, nor its depth inside, has changed by more than the farthest
    point of the object moved.

    Args:
        free_space: what was swept before.
        moved: how far the object has moved since.
        limit: paths whose error would be larger are dropped, metres.

    Raises:
        ValueError: a limit that isn't above zero.
    """
    if not limit > 0.0:
        raise ValueError(f"limit is {limit:g} m; it must be above zero")
    error = free_space.error + moved.distance
    kept = error <= limit
    return FreeSpace(
        free_space.starts[kept],
        free_space.ends[kept],
        radius=free_space.radius[kept],
        error=error[kept],
    )
