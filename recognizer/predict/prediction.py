"""What poses that a belief holds say a probe would meet: the predictor of all strategies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ..models.polyhedron import Polyhedron
from .prediction_kernels import BLOCK, ROWS, predict_rays
from .probes import TriadRays
from .ray_targets import RayTargets

Floats = NDArray[np.float64]

MET_PLANE, MET_OBJECT = 0, 1
"""What a ray is predicted to meet; triads all go down, so there is always the plane. Of a ray with
an end of its own, MET_PLANE is that it got there."""


@dataclass(frozen=True, eq=False)
class PoseSamples:
    """Poses that stand for a belief: one of each hypothesis, more of those with open freedoms."""

    models: tuple[Polyhedron, ...]
    """The library."""
    objects: NDArray[np.int64]
    """(s,) which of the models."""
    hypotheses: NDArray[np.int64]
    """(s,) the hypothesis that each stands for."""
    positions: Floats
    """(s, 3) origin of the model in the world, metres."""
    rotations: Floats
    """(s, 4) model to world, quaternions (x, y, z, w)."""
    weights: Floats
    """(s,) shares of the belief; they sum to 1."""
    position_spread: Floats
    """(s,) standard deviation of the centroid along any direction around each, metres."""
    rotation_spread: Floats
    """(s,) standard deviation of the turn about any axis around each, radians."""

    def __len__(self) -> int:
        return len(self.objects)

    @classmethod
    def none(cls, models: Sequence[Polyhedron]) -> PoseSamples:
        """No samples, as before the first contact."""
        none, rows = np.zeros(0), np.zeros(0, np.int64)
        poses = (np.zeros((0, 3)), np.zeros((0, 4)))
        return cls(tuple(models), rows, rows, *poses, none, none, none)


@dataclass(frozen=True, eq=False)
class Predictions:
    """What each of ``s`` poses says the ``k`` rays of each of ``a`` probes would meet."""

    outcomes: NDArray[np.int8]
    """(s, a, k) MET_OBJECT or MET_PLANE."""
    depths: Floats
    """(s, a, k) metres from where the ray starts to what it meets."""
    normals_world: Floats
    """(s, a, k, 3) outward unit normals there; the plane's is up."""
    depth_spread: Floats
    """(s, a, k) standard deviation of the depth by that of the pose, metres; zero on the plane."""


def predict(
    samples: PoseSamples, rays: TriadRays, *, radius: float = 0.0, ends: Floats | None = None
) -> Predictions:
    """Cast probes against every pose.

    A pose that shifts by ``s`` and turns by ``w`` about the centroid ``c`` changes the depth at
    which a ray along ``d`` meets a face with normal ``n`` at ``x`` by
    ``n . (s + w x (x - c)) / n . d`` to first order; a sample's spreads are the standard deviations
    of ``s`` and ``w`` along any direction. That another face, or none, is met instead is not in it.

    Args:
        samples: the poses.
        rays: those of the probes; they start outside the objects.
        radius: of a ball that goes along the rays, metres. Depths are then of its centre where it
            meets the plane of the face that its centre's ray meets; on an edge, where it would
            touch both faces or a neighbour first, that is off by up to about the radius.
        ends: (a, k) the depth at which each ray ends if it meets no object, metres: MET_PLANE is
            then that it met nothing. Without it rays go down, and end on the plane z = 0.

    Raises:
        ValueError: a radius below zero.
    """
    if not radius >= 0.0:
        raise ValueError(f"radius is {radius:g}; it must be zero or more, in metres")
    starts = np.ascontiguousarray(rays.starts_world.reshape(-1, 3))
    directions = np.ascontiguousarray(rays.directions_world.reshape(-1, 3))
    count, many = len(samples), len(starts)
    if ends is None:
        plane = (radius - starts[:, 2]) / directions[:, 2]
    else:
        plane = np.ascontiguousarray(ends, np.float64).reshape(-1)
    # Neighbours in a block look the same way, so that whole blocks turn their back on a face.
    order = np.argsort(np.arctan2(directions[:, 1], directions[:, 0]))
    outcomes = np.full((count, many), MET_PLANE, np.int8)
    depths, spread = np.empty((count, many)), np.zeros((count, many))
    normals = np.zeros((count, many, 3))
    depths[:] = plane
    normals[:, :, 2] = 1.0
    matrices = Rotation.from_quat(samples.rotations).as_matrix() if count else np.zeros((0, 3, 3))
    poses = (samples.positions, matrices, samples.position_spread, samples.rotation_spread)
    space = (
        np.empty((ROWS, BLOCK), np.float32),
        np.empty(BLOCK, np.int64),
        np.empty(BLOCK, np.int64),
        np.empty(many, np.int64),
        np.empty(many),
        np.empty(3),
    )
    for number in np.unique(samples.objects):
        targets = RayTargets.of(samples.models[number])
        predict_rays(
            (starts, directions, order, plane),
            targets.exact,
            targets.faces,
            targets.boxes,
            targets.edges,
            targets.solid,
            float(radius),
            np.flatnonzero(samples.objects == number),
            poses,
            (outcomes, depths, normals, spread),
            space,
        )
    shape = (count, *rays.starts_world.shape[:-1])
    return Predictions(
        outcomes.reshape(shape),
        depths.reshape(shape),
        normals.reshape(*shape, 3),
        spread.reshape(shape),
    )


def samples_of(
    models: Sequence[Polyhedron],
    objects: NDArray[np.integer],
    hypotheses: NDArray[np.integer],
    positions: Floats,
    rotations: Floats,
    weights: Floats,
    position_spread: Floats,
    rotation_spread: Floats,
) -> PoseSamples:
    """Samples from arrays as an observation has them; weights are made to sum to 1."""
    total = float(weights.sum())
    return PoseSamples(
        tuple(models),
        np.asarray(objects, np.int64),
        np.asarray(hypotheses, np.int64),
        np.asarray(positions, np.float64),
        np.asarray(rotations, np.float64),
        weights / total if total > 0.0 else np.full(len(weights), 1.0 / max(len(weights), 1)),
        np.asarray(position_spread, np.float64),
        np.asarray(rotation_spread, np.float64),
    )
