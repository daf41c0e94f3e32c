"""What one would use instead: multi-start ICP on positions and normals, for one known object.

Sixty starts spread over all rotations, each refined by steps from points to planes, all at once;
the one with the least residual is the answer. It gives one pose and says nothing about rivals, nor
whether any pose fits within the bounds.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree
from scipy.spatial.transform import RigidTransform, Rotation

from ....recognizer import Contacts, Polyhedron

Floats = NDArray[np.float64]

STARTS = 60
COARSE, FINE = 2_000, 30_000
"""Samples of the surface: the search for a neighbour costs little more among many, but misses the
processor's cache, which matters while there are many starts."""
STAGES = ((6, STARTS, COARSE, 0.1), (6, 30, FINE, 0.04), (10, 15, FINE, 0.0))
"""Steps; how many of the best starts take them; samples; and how far off positions count as near,
as a share of half the diameter, if that is more than their own error. Tuned on the stand-ins and on
random solids: twice the steps or starts gain less than 3 % more right poses."""
NEIGHBOUR_SLACK = 0.3
"""A neighbour may be farther than the nearest by this share; it saves a third of the time."""
DAMPING = 1e-6


@dataclass(frozen=True)
class IcpFit:
    """The best of all starts."""

    pose: RigidTransform
    """Model to world."""
    residual: float
    """Sum over contacts of squared misfits, in standard deviations of positions and normals."""


@dataclass(frozen=True, eq=False)
class _Samples:
    points: Floats
    normals: Floats
    spacing: float
    stretch: float
    """What a normal is multiplied by, to be searched beside a position."""
    tree: KDTree


class MultiStartIcp:
    """Fits one object's pose to contacts whose errors are of a given size."""

    def __init__(self, model: Polyhedron, *, position_error: float, normal_error: float) -> None:
        """Sample the surface.

        Args:
            model: the object.
            position_error: bound on positions, metres.
            normal_error: bound on normals, radians.
        """
        self._centre, self._unit = model.centroid, model.diameter / 2.0
        self._rotations = Rotation.from_quat(super_fibonacci(STARTS)).as_matrix()
        # One axis of a vector uniform in a ball, and of a direction uniform in a small cone.
        self._position_sigma = position_error / np.sqrt(5.0) / self._unit
        self._normal_sigma = normal_error / 2.0
        self._stages = []
        for steps, starts, count, reach in STAGES:
            sigma = max(reach, self._position_sigma)
            samples = self._sample(model, count, sigma)
            self._stages.append((steps, starts, sigma, samples))

    def _sample(self, model: Polyhedron, count: int, sigma: float) -> _Samples:
        points, normals = surface_samples(model, count)
        points = (points - self._centre) / self._unit
        spacing = float(np.sqrt(model.areas.sum() / count)) / self._unit
        stretch = max(sigma, spacing) / self._normal_sigma
        tree = KDTree(np.column_stack([points, stretch * normals]))
        return _Samples(points, normals, spacing, stretch, tree)

    def fit(self, contacts: Contacts) -> IcpFit:
        """The pose that fits best.

        Args:
            contacts: at least one, all with normals.
        """
        middle = contacts.positions.mean(axis=0)
        points = (contacts.positions - middle) / self._unit
        rotations = self._rotations
        shifts = np.tile(self._stages[0][3].points.mean(axis=0), (STARTS, 1))
        residuals = np.zeros(STARTS)
        for steps, starts, sigma, samples in self._stages:
            best = np.argsort(residuals)[:starts]
            rotations, shifts = rotations[best], shifts[best]
            weights = sigma**-2.0, self._normal_sigma**-2.0
            for _ in range(steps):
                rotations, shifts, residuals = _step(
                    rotations, shifts, points, contacts.normals, samples, weights
                )
        best = int(residuals.argmin())
        R = rotations[best].T
        corner = middle - R @ (self._centre + self._unit * shifts[best])
        pose = RigidTransform.from_components(corner, Rotation.from_matrix(R))
        return IcpFit(pose, float(residuals[best]))


def _step(
    rotations: Floats,
    shifts: Floats,
    points_world: Floats,
    normals_world: Floats,
    samples: _Samples,
    weights: tuple[float, float],
) -> tuple[Floats, Floats, Floats]:
    """One Gauss-Newton step of every start, world to model, and the residuals before it.

    A contact is pulled along its neighbour's normal and, where it is farther off sideways than
    samples are apart, sideways too.
    """
    turned = rotations.transpose(0, 2, 1)
    points = points_world @ turned + shifts[:, None]
    normals = normals_world @ turned
    both = np.concatenate([points, samples.stretch * normals], axis=2)
    nearest = samples.tree.query(both, eps=NEIGHBOUR_SLACK)[1]
    planes = samples.normals[nearest]
    apart = samples.points[nearest] - points
    above = (apart * planes).sum(axis=2)
    sideways = apart - above[..., None] * planes
    length = np.sqrt((sideways**2).sum(axis=2))
    beyond = np.maximum(length - samples.spacing, 0.0)
    along = sideways * ((beyond > 0.0) / np.maximum(length, 1e-12))[..., None]
    pulls = np.concatenate([above, beyond], axis=1)
    axes = np.concatenate([planes, along], axis=1)
    arms = np.concatenate([points, points], axis=1)
    rows = np.concatenate([np.cross(arms, axes), axes], axis=2)
    position_weight, normal_weight = weights
    residuals = position_weight * (pulls**2).sum(axis=1)
    residuals += normal_weight * ((planes - normals) ** 2).sum(axis=(1, 2))
    matrix = position_weight * np.matmul(rows.transpose(0, 2, 1), rows)
    vector = position_weight * (rows * pulls[..., None]).sum(axis=1)
    spread = len(points_world) * np.eye(3) - np.matmul(normals.transpose(0, 2, 1), normals)
    matrix[:, :3, :3] += normal_weight * spread
    vector[:, :3] += normal_weight * np.cross(normals, planes).sum(axis=1)
    matrix += DAMPING * np.trace(matrix, axis1=1, axis2=2)[:, None, None] * np.eye(6)
    motion = np.linalg.solve(matrix, vector[..., None])[..., 0]
    turns = Rotation.from_rotvec(motion[:, :3]).as_matrix()
    shifts = (turns @ shifts[..., None])[..., 0] + motion[:, 3:]
    return turns @ rotations, shifts, residuals


def super_fibonacci(count: int) -> Floats:
    """(count, 4) unit quaternions spread evenly over all rotations.

    M. Alexa, "Super-Fibonacci Spirals: Fast, Low-Discrepancy Sampling of SO(3)", CVPR 2022,
    Algorithm 1.
    """
    phi, psi = np.sqrt(2.0), 1.533751168755204288118041  # psi^4 = psi + 4
    s = np.arange(count) + 0.5
    inner, outer = np.sqrt(s / count), np.sqrt(1.0 - s / count)
    a, b = 2.0 * np.pi * s / phi, 2.0 * np.pi * s / psi
    return np.column_stack(
        [inner * np.sin(a), inner * np.cos(a), outer * np.sin(b), outer * np.cos(b)]
    )


def surface_samples(model: Polyhedron, count: int) -> tuple[Floats, Floats]:
    """(count, 3) points spread evenly by area over a model, and their normals; object frame."""
    corners = model.vertices[model.triangles]
    sides = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    reached = np.cumsum(np.linalg.norm(sides, axis=1))
    index = np.arange(count) + 0.5
    triangles = np.searchsorted(reached, index / count * reached[-1])
    # Roberts's R2 sequence fills a square evenly; folding a half over fills a triangle.
    plastic = 1.32471795724474602596
    u, v = (index / plastic) % 1.0, (index / plastic**2) % 1.0
    fold = u + v > 1.0
    u, v = np.where(fold, 1.0 - u, u), np.where(fold, 1.0 - v, v)
    a, b, c = corners[triangles].transpose(1, 0, 2)
    points = a + u[:, None] * (b - a) + v[:, None] * (c - a)
    return points, model.normals[model.triangle_faces[triangles]]
