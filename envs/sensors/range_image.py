"""Range images: what a scanner reads along a dense grid of parallel rays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri

from ..scene.scene import NOTHING, ProbeScene
from .noise import Distribution

Floats = NDArray[np.float64]

DEVIATIONS = 2.0
"""Standard deviations from the middle of Gaussian noise to the bound where it is cut off."""


@dataclass(frozen=True, eq=False)
class RangeView:
    """From where an image is taken: parallel rays, as of a laser carried along two slides."""

    origin_world: Floats
    """(3,) where the ray in the middle starts, metres."""
    direction_world: Floats
    """(3,) unit direction of the rays."""
    right_world: Floats
    """(3,) unit direction along the image's rows; it is level."""
    down_world: Floats
    """(3,) unit direction along its columns, square to the other two."""

    @classmethod
    def towards(
        cls, x: float, y: float, *, bearing: float, elevation: float, reach: float
    ) -> RangeView:
        """Look at a point of the plane ``z = 0``.

        Args:
            x: of the point in the middle, metres.
            y: likewise.
            bearing: the way to look, as an angle about the vertical, radians.
            elevation: how steeply to look downwards, radians.
            reach: how far before the point the rays start, metres.
        """
        level = np.array([np.cos(bearing), np.sin(bearing), 0.0])
        direction = np.cos(elevation) * level - np.array([0.0, 0.0, np.sin(elevation)])
        right = np.array([-level[1], level[0], 0.0])
        origin = np.array([x, y, 0.0]) - reach * direction
        return cls(origin, direction, right, np.cross(direction, right))

    def starts(self, columns: Floats, rows: Floats) -> Floats:
        """(m, n, 3) where the rays at (m,) columns and (n,) rows start, metres."""
        across = columns[:, None, None] * self.right_world
        return self.origin_world + across + rows[None, :, None] * self.down_world

    def normals(self, slopes: Floats) -> Floats:
        """Outward normals of planes from how depth grows along rows and columns.

        Args:
            slopes: (..., 2) metres of depth a metre.

        Returns:
            (..., 3) unit vectors, world frame, towards the scanner.
        """
        axes = np.stack([self.right_world, self.down_world])
        normals = slopes @ axes - self.direction_world
        return normals / np.linalg.norm(normals, axis=-1, keepdims=True)


@dataclass(frozen=True, eq=False)
class RangeImage:
    """Readings along a grid of rays."""

    view: RangeView
    starts_world: Floats
    """(m, n, 3) where the rays start, metres."""
    depths: Floats
    """(m, n) what was read, metres from the start; NaN where nothing was met."""
    outcomes: NDArray[np.int8]
    """(m, n) what each ray met: OBJECT, PLANE or NOTHING."""

    @property
    def points_world(self) -> Floats:
        """(m, n, 3) the points read, metres; NaN where nothing was met."""
        return self.starts_world + self.depths[..., None] * self.view.direction_world


def take_image(
    scene: ProbeScene,
    view: RangeView,
    columns: Floats,
    rows: Floats,
    *,
    noise: float,
    distribution: Distribution,
    rng: np.random.Generator,
) -> RangeImage:
    """Read ranges along a grid of rays.

    Args:
        scene: the scene, its object in place.
        view: from where.
        columns: (m,) places along the image's rows, metres from its middle.
        rows: (n,) places along its columns, likewise.
        noise: how far off a reading is at most, metres.
        distribution: how it lies within that.
        rng: source of the noise.
    """
    starts = view.starts(columns, rows)
    flat = starts.reshape(-1, 3)
    readings = scene.cast(flat, np.tile(view.direction_world, (len(flat), 1)))
    depths = (readings.ends_world - flat) @ view.direction_world
    depths += bounded_noise(rng, len(flat), noise, distribution)
    depths[readings.outcomes == NOTHING] = np.nan
    shape = starts.shape[:2]
    return RangeImage(view, starts, depths.reshape(shape), readings.outcomes.reshape(shape))


def bounded_noise(
    rng: np.random.Generator, count: int, bound: float, distribution: Distribution
) -> Floats:
    """(count,) numbers from ``-bound`` to ``bound``, in the bound's unit; one draw for each."""
    shares = rng.random(count)
    if distribution == "uniform":
        return bound * (2.0 * shares - 1.0)
    beyond = ndtr(-DEVIATIONS)
    within = ndtri(beyond + shares * (1.0 - 2.0 * beyond))
    # Rounding must not carry the outermost draws across the bound.
    return bound * np.clip(within / DEVIATIONS, -1.0, 1.0)
