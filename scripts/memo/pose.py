"""The memo's own way from an interpretation to a pose (Section 3), a named alternative to `pose`.

A rotation from each pair of contacts, by their normals alone, and the rotations averaged; then a
translation from each triple of planes, and the translations averaged. `pose` fits normals and
planes together instead, which is far more accurate; this one is there to be compared with.

Where it departs from the text:

- **The sign.** With the memo's v_s = R v_m + v_0, its cosine and sine of the angle, put into its
  matrix, give the inverse of R: they turn the sensed normal into the model's. Here the sine has the
  other sign.
- **What the text leaves open.** How wide a cluster of directions is, and which one counts; which
  triples are independent enough. `CLUSTER`, `ALONG` and `INDEPENDENT` say what was chosen.
- (r, θ) and (-r, -θ) are one rotation: directions are averaged as axes, without a sign, and the
  angle is in [0, π].
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import RigidTransform, Rotation

from ...recognizer.contacts.contacts import Contacts
from ...recognizer.models.polyhedron import Polyhedron

Floats = NDArray[np.float64]

CLUSTER = np.radians(25.0)
"""Radius of a cluster of directions, radians. Of 10° to 40°, 20° to 30° come nearest to the memo's
Table V on the stand-ins; they hardly differ."""
ALONG = 0.1
"""A normal whose squared sine of the angle to the direction is below this tells no angle: it lies
nearly along the direction, and is turned hardly at all."""
INDEPENDENT = 0.4
"""Triples count whose triple product is this share of the largest one, or more. Normals that are
square to one another, or lean by 30°, 45° or 60°, give no share so near that rounding decides."""
PARALLEL = 1e-6
"""Vectors whose sine, or triple product once they have unit length, is below this are parallel."""
UNTURNED = 1e-12
"""Unit normals that differ by less are the same: what is left is rounding."""


@dataclass(frozen=True, eq=False)
class MemoRotation:
    """A rotation as the memo has it, model to world."""

    direction: Floats
    """(3,) unit vector about which it turns."""
    angle: float
    """Radians, in [0, π]."""

    def as_matrix(self) -> Floats:
        """(3, 3) the matrix that Section 3.1 prints."""
        r, cosine, sine = self.direction, np.cos(self.angle), np.sin(self.angle)
        across = np.array([[0.0, -r[2], r[1]], [r[2], 0.0, -r[0]], [-r[1], r[0], 0.0]])
        return cosine * np.eye(3) + (1.0 - cosine) * np.outer(r, r) + sine * across


def memo_pose(
    model: Polyhedron, faces: NDArray[np.integer], contacts: Contacts
) -> RigidTransform | None:
    """The pose of an interpretation, model to world (Section 3).

    Whether it meets any bound isn't looked at: that is the memo's model test.

    Args:
        model: the object.
        faces: (n,) a face for each contact.
        contacts: the n contacts; all their normals count alike.

    Returns:
        None where the faces have no three independent normals, or their normals are turned so that
        no two of them tell a direction.

    Raises:
        ValueError: another number of faces than contacts, or a face that the model hasn't.
    """
    faces = np.asarray(faces)
    if faces.shape != (len(contacts),):
        raise ValueError(f"{faces.shape} faces for {len(contacts)} contacts: give one for each")
    beyond = faces[(faces < 0) | (faces >= model.face_count)]
    if beyond.size:
        raise ValueError(f"face {beyond[0]}: {model.name} has faces 0 to {model.face_count - 1}")
    rotation = memo_rotation(model.normals[faces], contacts.normals)
    if rotation is None:
        return None
    matrix = rotation.as_matrix()
    translation = memo_translation(
        model.normals[faces] @ matrix.T, model.offsets[faces], contacts.positions
    )
    if translation is None:
        return None
    return RigidTransform.from_components(translation, Rotation.from_matrix(matrix))


def memo_rotation(normals_object: Floats, normals_world: Floats) -> MemoRotation | None:
    """The rotation that takes the model's normals to the sensed ones (Section 3.1).

    Every two contacts i and j tell a direction, along (m_i - n_i) x (m_j - n_j). Of these the
    cluster around the one with most others near it is averaged; about that direction every contact
    tells an angle, and the angles are averaged.

    Args:
        normals_object: (n, 3) m, unit normals of the faces assigned, object frame.
        normals_world: (n, 3) n, unit normals sensed, world frame.

    Returns:
        None where no two contacts tell a direction. If two independent normals and all others are
        not turned at all, a rotation by zero, about any direction.
    """
    differences = normals_object - normals_world
    lengths = np.linalg.norm(differences, axis=1)
    turned = lengths >= UNTURNED
    i, j = np.triu_indices(len(differences), 1)
    if not turned.any():
        leaning = np.linalg.norm(np.cross(normals_object[i], normals_object[j]), axis=1) > PARALLEL
        return MemoRotation(np.array([0.0, 0.0, 1.0]), 0.0) if leaning.any() else None
    crosses = np.cross(differences[i], differences[j])
    sines = np.linalg.norm(crosses, axis=1)
    told = turned[i] & turned[j] & (sines > PARALLEL * lengths[i] * lengths[j])
    if not told.any():
        return None
    direction = _mean_axis(_largest_cluster(crosses[told] / sines[told, None]))
    angle = _mean_angle(direction, normals_object, normals_world)
    return MemoRotation(direction, angle) if angle >= 0.0 else MemoRotation(-direction, -angle)


def memo_translation(normals_world: Floats, offsets: Floats, positions: Floats) -> Floats | None:
    """The translation that puts the contacts on their planes (Section 3.2).

    Every three planes with independent normals tell one; they are averaged.

    Args:
        normals_world: (n, 3) R m, unit normals of the faces assigned, turned by the rotation found.
        offsets: (n,) d, of their planes in the object frame, metres.
        positions: (n, 3) p, where they were touched, world frame, metres.

    Returns:
        (3,) metres; None where no three normals are independent.
    """
    triples = list(combinations(range(len(normals_world)), 3))
    i, j, k = np.array(triples, np.intp).reshape(-1, 3).T
    faces_jk = np.cross(normals_world[j], normals_world[k])
    products = (normals_world[i] * faces_jk).sum(axis=1)
    largest = np.abs(products).max(initial=0.0)
    if largest <= PARALLEL:
        return None
    heights = (normals_world * positions).sum(axis=1) - offsets
    sums = (
        heights[i, None] * faces_jk
        + heights[j, None] * np.cross(normals_world[k], normals_world[i])
        + heights[k, None] * np.cross(normals_world[i], normals_world[j])
    )
    independent = np.abs(products) >= INDEPENDENT * largest
    return (sums[independent] / products[independent, None]).mean(axis=0)


def _largest_cluster(directions: Floats) -> Floats:
    """(m, 3) of axes without sign, those near the one with most others near it."""
    near = np.abs(directions @ directions.T) >= np.cos(CLUSTER)
    return directions[near[near.sum(axis=1).argmax()]]


def _mean_axis(directions: Floats) -> Floats:
    """(3,) the axis nearest to others, whatever their signs."""
    return np.linalg.eigh(directions.T @ directions)[1][:, -1]


def _mean_angle(direction: Floats, normals_object: Floats, normals_world: Floats) -> float:
    """The angle about a direction that contacts tell on average, radians, in [-π, π].

    The memo's cosine is 1 - (1 - n·m) / (1 - (r·n)(r·m)), and its sine, but for the sign,
    (r x m)·n over the same.
    """
    spread = 1.0 - (normals_world @ direction) * (normals_object @ direction)
    telling = spread >= min(ALONG, spread.max())
    m, n, spread = normals_object[telling], normals_world[telling], spread[telling]
    cosines = 1.0 - (1.0 - (n * m).sum(axis=1)) / spread
    sines = (np.cross(direction, m) * n).sum(axis=1) / spread
    # Angles are averaged as points of a circle: -179° and 179° are two degrees apart.
    angles = np.arctan2(sines, cosines)
    return float(np.arctan2(np.sin(angles).mean(), np.cos(angles).mean()))
