"""The probe: triads of rays, and what they report (memo, Section 4.4)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..recognizer import Contacts
from .noise import uniform_in_ball, uniform_in_cone
from .scene import OBJECT, ProbeScene

Floats = NDArray[np.float64]

MESH_ROUNDING = 4e-7
"""Share of the object's diameter that MuJoCo's single-precision meshes may be off by; the noise
leaves this much of the bound to it, so that the bound stated with a contact holds."""
NORMAL_ROUNDING = 1e-5
"""The same for normals, radians; the shortest edges of a mesh are a few hundredths of its size."""


@dataclass(frozen=True, kw_only=True)
class SensorNoise:
    """Bounds on what the probe reports; the noise is uniform inside them."""

    position_error: float
    """Radius of the ball around a position, metres."""
    normal_error: float
    """Half-angle of the cone around a normal, radians."""

    def __post_init__(self) -> None:
        if not (np.isfinite(self.position_error) and self.position_error > 0.0):
            raise ValueError(f"position error is {self.position_error:g} m; it must be above zero")
        if not 0.0 < self.normal_error <= np.pi / 2.0:
            raise ValueError(
                f"normal error is {self.normal_error:g} rad; it must be above 0 and at most pi/2"
            )


@dataclass(frozen=True, eq=False)
class Touch:
    """What one triad reported."""

    contacts: Contacts
    """Where it touched the object, in the order of the rays that did."""
    starts_world: Floats
    """(3, 3) where the rays started, metres."""
    ends_world: Floats
    """(3, 3) where they ended as reported: a contact's measured position, else on the plane."""
    outcomes: NDArray[np.int8]
    """(3,) OBJECT, PLANE or NOTHING."""


def triad_directions(yaw: float) -> Floats:
    """(3, 3) mutually orthogonal unit directions, all equally steep downwards.

    Args:
        yaw: the triad's turn about the vertical, radians; it repeats every 2 pi / 3.
    """
    bearings = yaw + np.arange(3) * 2.0 * np.pi / 3.0
    level, down = np.sqrt(2.0 / 3.0), -np.sqrt(1.0 / 3.0)
    return np.column_stack([level * np.cos(bearings), level * np.sin(bearings), np.full(3, down)])


class RaySensor:
    """The memo's ideal probe: three mutually orthogonal rays that meet on the plane."""

    def __init__(self, noise: SensorNoise, reach: float) -> None:
        """A sensor whose rays start ``reach`` metres before the point where they meet."""
        self.noise = noise
        self.reach = reach

    def touch(
        self, scene: ProbeScene, x: float, y: float, yaw: float, rng: np.random.Generator
    ) -> Touch:
        """Send a triad towards (x, y, 0).

        Args:
            scene: the scene, its object in place.
            x: where the rays meet on the plane, metres.
            y: likewise.
            yaw: the triad's turn about the vertical, radians.
            rng: source of the noise.

        Raises:
            ValueError: the bounds are too tight for the simulation's own rounding.
        """
        rounding = MESH_ROUNDING * scene.model.diameter
        if self.noise.position_error <= 2.0 * rounding:
            raise ValueError(
                f"position error is {self.noise.position_error:g} m; the simulation of an object"
                f" of {scene.model.diameter:g} m is exact to {rounding:.2g} m, so ask for more"
                " than twice that"
            )
        directions = triad_directions(yaw)
        starts = np.array([x, y, 0.0]) - self.reach * directions
        readings = scene.cast(starts, directions)
        hit = readings.outcomes == OBJECT
        count = int(hit.sum())
        # All three are drawn whatever was hit: the stream then depends on the probes alone.
        shifts = uniform_in_ball(rng, 3, self.noise.position_error - rounding)
        leaning = uniform_in_cone(
            rng,
            np.where(hit[:, None], readings.normals_world, directions),
            max(self.noise.normal_error - NORMAL_ROUNDING, 0.0),
        )
        ends = readings.ends_world + np.where(hit[:, None], shifts, 0.0)
        contacts = Contacts(
            ends[hit],
            leaning[hit],
            position_error=np.full(count, self.noise.position_error),
            normal_error=np.full(count, self.noise.normal_error),
        )
        return Touch(contacts, starts, ends, readings.outcomes)
