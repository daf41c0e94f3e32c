"""A probe in the plane: one ray from outside the working area to the first contact."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import RigidTransform

from ...recognizer import Contacts, Polygon
from ..scene.scene import NOTHING, OBJECT
from ..sensors.noise import SensorNoise
from .rays import cast_planar_rays

Floats = NDArray[np.float64]

ROUNDING = 1e-9
"""Share of its bounds that the noise leaves to rounding: coordinates are sums of a few numbers that
are each exact to 1e-16 of the working area, which no bound is a millionth of."""
TIGHTEST = 1e-6
"""The tightest bound on positions, as a share of the reach."""


@dataclass(frozen=True, eq=False)
class PlanarTouch:
    """What one ray reported."""

    contacts: Contacts
    """The contact, in the plane; none if the ray passed by."""
    start_world: Floats
    """(2,) where the ray started, metres."""
    end_world: Floats
    """(2,) the measured position of the contact, or where the ray left the working area."""
    outcome: int
    """OBJECT or NOTHING."""


class PlanarProbe:
    """Rays that cross the working area, with noise uniform in its bounds."""

    def __init__(self, noise: SensorNoise, reach: float) -> None:
        """A probe whose rays start ``reach`` metres before they pass the origin, and end as far
        behind it.

        Raises:
            ValueError: a bound on positions so tight that rounding would break it, or noise that
                isn't uniform.
        """
        if noise.position_error < TIGHTEST * reach:
            raise ValueError(
                f"position error is {noise.position_error:g} m; with rays of {2 * reach:g} m it"
                f" must be at least {TIGHTEST * reach:.2g} m"
            )
        if noise.distribution != "uniform":
            raise ValueError(f"noise in the plane is uniform, not {noise.distribution!r}")
        self.noise = noise
        self.reach = reach

    def touch(
        self,
        outline: Polygon,
        T_world_object: RigidTransform,
        bearing: float,
        offset: float,
        rng: np.random.Generator,
    ) -> PlanarTouch:
        """Send a ray.

        Args:
            outline: the object.
            T_world_object: its pose, model to world, a motion within the plane ``z = 0``.
            bearing: the direction in which the ray runs, radians from the x axis.
            offset: how far to the left of the origin it passes, metres.
            rng: source of the noise.
        """
        direction = np.array([np.cos(bearing), np.sin(bearing)])
        left = np.array([-direction[1], direction[0]])
        start = offset * left - self.reach * direction
        hits = cast_planar_rays(outline, T_world_object, start[None], direction[None])
        # Drawn whether anything is met or not: the stream depends on the number of probes alone.
        shift, lean = _noise(self.noise, rng)
        if not hits.hit[0]:
            end = start + 2.0 * self.reach * direction
            return PlanarTouch(Contacts.none(2), start, end, NOTHING)
        position = hits.points_world[0] + shift
        contacts = Contacts(
            position[None],
            _turned(hits.normals_world[0], lean)[None],
            position_error=self.noise.position_error,
            normal_error=self.noise.normal_error,
            approaches=direction[None],
        )
        return PlanarTouch(contacts, start, position, OBJECT)


def _noise(noise: SensorNoise, rng: np.random.Generator) -> tuple[Floats, float]:
    """A shift uniform in its disc, metres, and a turn uniform in its bounds, radians."""
    far, around, lean = rng.random(3)
    # Of a disc's area, the share within a radius goes with the radius's square.
    radius = noise.position_error * (1.0 - ROUNDING) * np.sqrt(far)
    angle = 2.0 * np.pi * around
    shift = radius * np.array([np.cos(angle), np.sin(angle)])
    return shift, noise.normal_error * (1.0 - ROUNDING) * (2.0 * lean - 1.0)


def _turned(vector: Floats, angle: float) -> Floats:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([c * vector[0] - s * vector[1], s * vector[0] + c * vector[1]])
