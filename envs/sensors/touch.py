"""What every sensor shares: the commanded probe, and what it reports (memo, Section 4.4)."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, isfinite, sin, sqrt
from typing import TYPE_CHECKING, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from ...recognizer import Contacts, FreeSpace
from ..scene.free_body import STILL, Displacement
from .noise import SensorNoise

if TYPE_CHECKING:
    from ..scene.scene import ProbeScene

Floats = NDArray[np.float64]

_LEVEL, _DOWN = sqrt(2.0 / 3.0), -sqrt(1.0 / 3.0)
_SINE = sqrt(3.0) / 2.0


@dataclass(frozen=True)
class ProbeCommand:
    """Where to send a probe: its rays meet at a point of the plane ``z = 0``."""

    x: float
    """Of the meeting point, world frame, metres."""
    y: float
    """Likewise."""
    yaw: float
    """The probe's turn about the vertical, radians; a triad repeats every 2 pi / 3."""

    def __post_init__(self) -> None:
        if not (isfinite(self.x) and isfinite(self.y) and isfinite(self.yaw)):
            raise ValueError(f"{self}: a command is three finite numbers")


def finite_action(action: NDArray[np.floating], numbers: int) -> Floats:
    """An action of a probing environment, clipped to its box.

    Raises:
        ValueError: another shape than ``(numbers,)``, or a number that isn't finite.
    """
    wanted = np.asarray(action, np.float64)
    if wanted.shape != (numbers,) or not np.isfinite(wanted).all():
        named = {2: "two", 3: "three", 4: "four"}[numbers]
        raise ValueError(f"an action is {named} finite numbers, not {action!r}")
    return np.clip(wanted, -1.0, 1.0)


@dataclass(frozen=True, eq=False)
class Touch:
    """What one probe reported."""

    contacts: Contacts
    """Where it touched the object, in the order of the rays that did."""
    free_space: FreeSpace
    """What it swept on the way: lines, or of a ball capsules."""
    starts_world: Floats
    """(r, 3) where the rays started, metres; of a ball its centre."""
    ends_world: Floats
    """(r, 3) where they ended, as reported: a point at its contact's measured position, a ball
    with its centre where position and normal, as measured, put it."""
    outcomes: NDArray[np.int8]
    """(r,) OBJECT, PLANE or NOTHING, see `scene`."""
    forces: tuple[Floats, ...] = ()
    """(k, 2) a ray: seconds, and the normal force on the tip in newtons; none but of a finger."""
    displacement: Displacement = STILL
    """How far the object has moved, by the end of the probe, since any instant that was felt of it.
    Contacts and free space have bounds that hold for where it lies then."""
    radius: float = 0.0
    """Of what was moved along the rays, metres; 0 of a point."""


class Sensor(Protocol):
    """A way to touch: a commanded probe in, contacts and free space out."""

    noise: SensorNoise
    """Bounds on what it reports."""

    @property
    def rays(self) -> int:
        """The most rays that one probe sends."""
        ...

    @property
    def features(self) -> Literal["faces", "all"]:
        """What of an object its contacts may lie on, as the recogniser has to be told."""
        ...

    def touch(self, scene: ProbeScene, command: ProbeCommand, rng: np.random.Generator) -> Touch:
        """Send one probe.

        Args:
            scene: the scene, its object in place.
            command: where to.
            rng: source of the noise.

        Raises:
            ValueError: the bounds are too tight for what the sensor itself may be off by.
        """
        ...


def triad(x: float, y: float, yaw: float, reach: float) -> tuple[Floats, Floats]:
    """Three mutually orthogonal rays, all equally steep downwards, that meet on the plane.

    Args:
        x: of the point where they meet, metres.
        y: likewise.
        yaw: the triad's turn about the vertical, radians; it repeats every 2 pi / 3.
        reach: how far before that point they start, metres.

    Returns:
        (3, 3) starts, metres, and (3, 3) unit directions, world frame.
    """
    c, s = _LEVEL * cos(yaw), _LEVEL * sin(yaw)
    # A third of a turn on, and back; few numbers, for which numpy takes longer than they do.
    c1, s1 = -0.5 * c - _SINE * s, _SINE * c - 0.5 * s
    c2, s2 = -0.5 * c + _SINE * s, -_SINE * c - 0.5 * s
    z = -reach * _DOWN
    starts = (
        *(x - reach * c, y - reach * s, z),
        *(x - reach * c1, y - reach * s1, z),
        *(x - reach * c2, y - reach * s2, z),
    )
    directions = (c, s, _DOWN, c1, s1, _DOWN, c2, s2, _DOWN)
    rays = np.array((starts, directions)).reshape(2, 3, 3)
    return rays[0], rays[1]


def check_reach(reach: float, radius: float = 0.0) -> None:
    """Refuse rays that start so near that a ball of ``radius`` metres is in the plane already.

    Raises:
        ValueError: a reach or a radius that won't do.
    """
    if not (isfinite(reach) and reach > 0.0):
        raise ValueError(f"reach is {reach:g} m; it must be above zero")
    # All rays are equally steep: their starts are so high over the plane.
    height = -_DOWN * reach
    if not radius < height:
        raise ValueError(
            f"the tip's radius is {radius:g} m, but rays of {reach:g} m start only {height:.3g} m"
            " over the plane: a smaller tip is needed for objects so small"
        )
