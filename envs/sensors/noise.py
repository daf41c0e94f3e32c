"""Noise that keeps its word: inside a bound, never beyond it (memo, Section 4)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from .noise_kernels import blur_rows

Floats = NDArray[np.float64]
Distribution = Literal["uniform", "gaussian"]

BALL_SHARE = 0.7385358700508894
"""How much of a Gaussian in space lies within two of its standard deviations."""
CONE_SHARE = 1.0 - np.exp(-2.0)
"""Likewise in the plane."""


@dataclass(frozen=True, kw_only=True)
class SensorNoise:
    """Bounds on what a sensor reports, and how the noise lies inside them.

    The bounds hold for everything together: what a sensor's own physics is off by, and noise in
    what that leaves.
    """

    position_error: float
    """Radius of the ball around a position, metres."""
    normal_error: float
    """Half-angle of the cone around a normal, radians."""
    distribution: Distribution = "uniform"
    """Either "uniform", or "gaussian": cut off at two standard deviations, the bound."""

    def __post_init__(self) -> None:
        if not (np.isfinite(self.position_error) and self.position_error > 0.0):
            raise ValueError(f"position error is {self.position_error:g} m; it must be above zero")
        if not 0.0 < self.normal_error <= np.pi / 2.0:
            raise ValueError(
                f"normal error is {self.normal_error:g} rad; it must be above 0 and at most pi/2"
            )
        if self.distribution not in get_args(Distribution):
            known = " or ".join(repr(name) for name in get_args(Distribution))
            raise ValueError(f"distribution is {self.distribution!r}; it must be {known}")

    def check_room(self, own_position_error: float, own_normal_error: float, what: str) -> None:
        """Refuse bounds that leave no room for noise beside what the sensor itself is off by.

        Args:
            own_position_error: metres.
            own_normal_error: radians.
            what: what is off by them, as a message says it.

        Raises:
            ValueError: a bound of less than twice that.
        """
        if self.position_error <= 2.0 * own_position_error:
            raise ValueError(
                f"position error is {self.position_error:g} m; {what} is exact to"
                f" {own_position_error:.2g} m, so ask for more than twice that"
            )
        if self.normal_error <= 2.0 * own_normal_error:
            raise ValueError(
                f"normal error is {self.normal_error:g} rad; {what} is exact to"
                f" {own_normal_error:.2g} rad, so ask for more than twice that"
            )

    def blur(
        self,
        rng: np.random.Generator,
        touched: NDArray[np.int8],
        points: Floats,
        normals: Floats,
        own_position_error: float = 0.0,
        own_normal_error: float = 0.0,
    ) -> tuple[Floats, Floats]:
        """Points and normals as a sensor reports them.

        As much is drawn for a row that touched nothing: the stream depends on their number alone.

        Args:
            rng: source of the noise.
            touched: (n,) 1 in the rows to blur; the others stay as they are.
            points: (n, 3) metres.
            normals: (n, 3) unit vectors.
            own_position_error: what the sensor itself may be off by, metres; the noise leaves it
                that much of the bound.
            own_normal_error: the same for normals, radians.

        Returns:
            (n, 3) points and (n, 3) normals.
        """
        count = len(points)
        directions, draws = rng.standard_normal((count, 3)), rng.random((3, count))
        even = self.distribution == "uniform"
        if not even:
            _gaussian_shares(draws)
        moved, turned = np.empty((count, 3)), np.empty((count, 3))
        radius = self.position_error - own_position_error
        half_angle = self.normal_error - own_normal_error
        if half_angle < 0.0:
            half_angle = 0.0
        blur_rows(
            touched, points, normals, directions, draws, even, radius, half_angle, moved, turned
        )
        return moved, turned


def _gaussian_shares(draws: Floats) -> None:
    """Make shares of a bound that lies two standard deviations out of uniform draws."""
    from scipy.special import gammaincinv  # only this distribution pays for the import

    # Squared lengths of Gaussian vectors are of a gamma distribution, of two coordinates an
    # exponential one; rounding must not make a share larger than 1.
    draws[0] = np.minimum(np.sqrt(gammaincinv(1.5, BALL_SHARE * draws[0]) / 2.0), 1.0)
    draws[1] = np.minimum(np.sqrt(-np.log1p(-CONE_SHARE * draws[1]) / 2.0), 1.0)


def uniform_in_ball(rng: np.random.Generator, count: int, radius: float) -> Floats:
    """(count, 3) vectors uniform in the ball of ``radius``, in the radius's unit."""
    directions = rng.normal(size=(count, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return directions * radius * rng.random((count, 1)) ** (1.0 / 3.0)


def uniform_in_cone(rng: np.random.Generator, normals: Floats, half_angle: float) -> Floats:
    """Unit vectors uniform in the cones around others.

    Args:
        rng: source of randomness.
        normals: (n, 3) unit axes.
        half_angle: largest angle from the axis, radians.

    Returns:
        (n, 3) unit vectors, each within ``half_angle`` of its axis.
    """
    count = len(normals)
    # On a sphere, area is uniform in the cosine of the angle from the axis.
    cosines = 1.0 - rng.random(count) * (1.0 - np.cos(half_angle))
    sines = np.sqrt(1.0 - cosines**2)
    around = 2.0 * np.pi * rng.random(count)
    helper = np.eye(3)[np.abs(normals).argmin(axis=1)]
    u = np.cross(normals, helper)
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    v = np.cross(normals, u)
    tangents = np.cos(around)[:, None] * u + np.sin(around)[:, None] * v
    return cosines[:, None] * normals + sines[:, None] * tangents
