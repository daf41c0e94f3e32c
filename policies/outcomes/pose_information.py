"""What contacts tell about the pose of one hypothesis: its information matrix, as it grows.

Small motions of the object are six lengths, as in the recogniser: a rotation about its centroid,
times half its diameter, and a shift, both in the world's frame.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ...recognizer import Polyhedron
from ...recognizer.predict.prediction import MET_OBJECT, PoseSamples, Predictions
from ...recognizer.predict.probes import TriadRays
from .task import Observation, Task

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PlacedModel:
    """A model where a sample has it."""

    model: Polyhedron
    rotation: Rotation
    position: Floats
    """(3,) origin of the model in the world, metres."""

    @classmethod
    def of(cls, samples: PoseSamples, row: int) -> PlacedModel:
        """The model of one of the samples."""
        model = samples.models[samples.objects[row]]
        return cls(model, Rotation.from_quat(samples.rotations[row]), samples.positions[row])

    @property
    def centre(self) -> Floats:
        """(3,) centroid in the world, metres."""
        return self.rotation.apply(self.model.centroid.copy()) + self.position

    @property
    def radius(self) -> float:
        """Half the diameter, metres."""
        return 0.5 * self.model.diameter


def rows_of(placed: PlacedModel, points_world: Floats, normals_world: Floats) -> Floats:
    """Change of the height of points over their faces with the six small motions.

    ``n . [-[arm]x, I]`` with the arm from the centroid to the point: (..., 6).
    """
    arms = points_world - placed.centre
    return np.concatenate([np.cross(arms, normals_world) / placed.radius, normals_world], axis=-1)


def information_of(
    placed: PlacedModel, rows: Floats, normals_world: Floats, reach: Floats, cone: Floats
) -> Floats:
    """What contacts add to the information matrix, each alone: (..., 6, 6).

    A point uniform in a ball has variance ``bound^2 / 5`` along its normal; a normal uniform in a
    narrow cone has ``bound^2 / 4`` about either axis across it. These are the recogniser's own.

    Args:
        placed: the hypothesis.
        rows: (..., 6) as of `rows_of`.
        normals_world: (..., 3) of the faces.
        reach: bounds on positions, metres, that broadcast against what is before the axes above.
        cone: likewise, on normals, radians.
    """
    reach, chord = np.asarray(reach), 2.0 * np.sin(0.5 * np.asarray(cone))
    grown = 5.0 / reach[..., None, None] ** 2 * rows[..., :, None] * rows[..., None, :]
    across = np.eye(3) - normals_world[..., :, None] * normals_world[..., None, :]
    felt = np.asarray(cone)[..., None, None] < np.pi
    grown[..., :3, :3] += felt * 4.0 / (chord[..., None, None] * placed.radius) ** 2 * across
    return grown


def known(observation: Observation, placed: PlacedModel) -> Floats:
    """(6, 6) what the contacts so far tell about a hypothesis.

    Half a turn and half a diameter are known beforehand. Each contact counts on the face that is
    nearest to it among those that its normal allows.
    """
    count = int(observation["contact_count"][0])
    points = np.asarray(observation["contact_positions"][:count], np.float64)
    felt = np.asarray(observation["contact_normals"][:count], np.float64)
    reach = np.asarray(observation["contact_position_error"][:count], np.float64)
    cone = np.asarray(observation["contact_normal_error"][:count], np.float64)
    total = np.diag([1.0 / (np.pi * placed.radius)] * 3 + [1.0 / placed.radius] * 3) ** 2
    if count:
        model = placed.model
        inside = placed.rotation.inv()
        faces = _faces_of(model, inside.apply(points - placed.position), inside.apply(felt), cone)
        normals = placed.rotation.apply(model.normals[faces])
        rows = rows_of(placed, points, normals)
        total = total + information_of(placed, rows, normals, reach, cone).sum(axis=0)
    return total


def promised(
    task: Task, placed: PlacedModel, told: Predictions, row: int, rays: TriadRays
) -> Floats:
    """(a, 6, 6) what each probe would add, if a hypothesis is true.

    Args:
        task: the bounds.
        placed: the hypothesis.
        told: what is predicted for it, among others.
        row: which of the samples in ``told`` it is.
        rays: those of the probes.
    """
    points = rays.starts_world + told.depths[row][..., None] * rays.directions_world
    normals = told.normals_world[row]
    points = points - task.radius * normals  # depths are of a ball's centre
    reach, cone = np.asarray(task.position_error), np.asarray(task.normal_error)
    each = information_of(placed, rows_of(placed, points, normals), normals, reach, cone)
    return np.where((told.outcomes[row] == MET_OBJECT)[..., None, None], each, 0.0).sum(axis=1)


def gain(before: Floats, added: Floats) -> Floats:
    """(a,) ``log det(before + added) - log det(before)``, of (6, 6) and (a, 6, 6)."""
    return np.linalg.slogdet(before + added)[1] - np.linalg.slogdet(before)[1]


def gain_to_tolerance(before: Floats, added: Floats, tolerance: float) -> Floats:
    """Nats that contacts tell of a pose that is wanted no finer than to a tolerance, (a,).

    ``(log det(S + t^2 I) - log det(S' + t^2 I)) / 2`` with ``S`` and ``S'`` the covariances, the
    inverses of the information, before and after: what is known well enough already adds nothing.

    Args:
        before: (6, 6) information.
        added: (a, 6, 6) what each probe adds.
        tolerance: standard deviation at which a motion is known well enough, metres.
    """

    def blurred(information: Floats) -> Floats:
        finer = np.eye(6) + tolerance**2 * information
        return np.linalg.slogdet(finer)[1] - np.linalg.slogdet(information)[1]

    return 0.5 * (blurred(before) - blurred(before + added))


def _faces_of(
    model: Polyhedron, points: Floats, normals: Floats, cone: Floats
) -> NDArray[np.int64]:
    """(n,) the face that each contact, object frame, is likely on."""
    corners = model.vertices[model.triangles]
    facing = model.normals[model.triangle_faces]
    squared = _squared_distances(points, corners, facing)
    leaning = np.arccos(np.clip(normals @ facing.T, -1.0, 1.0))
    # What leans too much comes last, in the order of how much.
    squared += np.where(leaning > 1.1 * cone[:, None], model.diameter**2 * (1.0 + leaning), 0.0)
    return model.triangle_faces[squared.argmin(axis=1)]


def _squared_distances(points: Floats, corners: Floats, facing: Floats) -> Floats:
    """(n, t) squared distances of points from triangles with unit normals ``facing``."""
    offsets = points[:, None, None] - corners
    edges = np.roll(corners, -1, axis=1) - corners
    lengths = np.maximum((edges**2).sum(axis=2), 1e-300)
    along = np.clip(np.einsum("ntkx,tkx->ntk", offsets, edges) / lengths, 0.0, 1.0)
    to_edges = ((offsets - along[..., None] * edges) ** 2).sum(axis=3).min(axis=2)
    heights = np.einsum("ntx,tx->nt", offsets[:, :, 0], facing)
    outward = np.cross(edges, facing[:, None])
    inside = (np.einsum("ntkx,tkx->ntk", offsets, outward) <= 0.0).all(axis=2)
    return np.where(inside, heights**2, to_edges)
