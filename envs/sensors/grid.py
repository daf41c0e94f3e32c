"""Grid sensing: rays on a regular grid along three orthogonal directions (memo, Section 4.3)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import RigidTransform, Rotation

from ...recognizer import Contacts, Polyhedron
from ...recognizer.models.rays import cast_rays
from .noise import SensorNoise

Floats = NDArray[np.float64]

FINEST, COARSEST = 0.15, 0.6
"""Grid spacings tried, as shares of the object's diameter; 12 to 20 hits need something between."""
MOST_DRAWS = 10_000


@dataclass(frozen=True, eq=False)
class TrueContacts:
    """Where an object was touched, and where it is: what a sensor would report without noise."""

    T_world_object: RigidTransform
    """The object's pose, model to world."""
    points_world: Floats
    """(n, 3) metres."""
    normals_world: Floats
    """(n, 3) outward unit normals."""
    faces: NDArray[np.int32]
    """(n,) the face under each: the true interpretation."""

    def __len__(self) -> int:
        return len(self.points_world)

    def noisy(self, noise: SensorNoise, rng: np.random.Generator) -> Contacts:
        """What a sensor reports, with noise inside its bounds."""
        points, normals = noise.blur(
            rng, np.ones(len(self), np.int8), self.points_world, self.normals_world
        )
        return Contacts(
            points,
            normals,
            position_error=noise.position_error,
            normal_error=noise.normal_error,
        )


def sense_grid(
    model: Polyhedron, rng: np.random.Generator, fewest: int = 12, most: int = 20
) -> TrueContacts:
    """Touch an object at a random orientation with a grid of rays along each axis.

    Orientation, spacing and offset of the grid are drawn anew until the number of contacts fits.

    Args:
        model: the object; its origin is put at the world's, as in the memo.
        rng: source of randomness.
        fewest: the least number of contacts.
        most: the greatest.

    Raises:
        ValueError: no grid gives that many contacts.
    """
    for _ in range(MOST_DRAWS):
        pose = RigidTransform.from_components(np.zeros(3), Rotation.random(rng=rng))
        spacing = rng.uniform(FINEST, COARSEST) * model.diameter
        starts, directions = _grids(pose.apply(model.vertices), spacing, rng)
        hits = cast_rays(model, pose, starts, directions)
        if fewest <= int(hits.hit.sum()) <= most:
            return TrueContacts(
                pose,
                hits.points_world[hits.hit],
                hits.normals_world[hits.hit],
                hits.faces[hits.hit].astype(np.int32),
            )
    raise ValueError(f"{model.name}: no grid of rays meets it {fewest} to {most} times")


def _grids(corners: Floats, spacing: float, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Starts and directions of three grids that cover the box around an object."""
    low, high = corners.min(axis=0), corners.max(axis=0)
    starts, directions = [], []
    for along in range(3):
        first, second = (
            np.arange(low[axis] + spacing * rng.random(), high[axis], spacing)
            for axis in range(3)
            if axis != along
        )
        grid = rays_along(along, first, second, high[along] + 0.1 * spacing)
        starts.append(grid[0])
        directions.append(grid[1])
    return np.concatenate(starts), np.concatenate(directions)


def rays_along(axis: int, first: Floats, second: Floats, height: float) -> tuple[Floats, Floats]:
    """A grid of rays against one axis of a frame.

    Args:
        axis: 0, 1 or 2; the rays run from the side where it is positive.
        first: (m,) coordinates of the grid along the first of the other two axes, metres.
        second: (n,) along the second.
        height: where on the axis the rays start, metres.

    Returns:
        (m n, 3) starts, metres, and (m n, 3) unit directions, in that frame.
    """
    u, v = np.meshgrid(first, second)
    starts = np.insert(np.column_stack([u.ravel(), v.ravel()]), axis, height, axis=1)
    return starts, np.tile(-np.eye(3)[axis], (u.size, 1))


def centred_ticks(count: int, spacing: float) -> Floats:
    """(count,) coordinates a spacing apart, metres, with zero in their middle."""
    return spacing * (np.arange(count, dtype=np.float64) - (count - 1) / 2.0)
