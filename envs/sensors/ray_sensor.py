"""The memo's ideal probe: rays that report where they first meet the object (Section 4.4)."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ...recognizer import FACE, Contacts, FreeSpace
from ..scene.scene import NORMAL_ROUNDING, OBJECT, ProbeScene
from .noise import SensorNoise
from .touch import ProbeCommand, Touch, check_reach, triad

Floats = NDArray[np.float64]


class RaySensor:
    """Three mutually orthogonal rays that meet on the plane."""

    rays: int = 3
    features: Literal["faces", "all"] = "faces"

    def __init__(self, noise: SensorNoise, reach: float) -> None:
        """A sensor whose rays start ``reach`` metres before the point where they meet.

        Raises:
            ValueError: a reach that isn't above zero.
        """
        check_reach(reach)
        self.noise = noise
        self.reach = reach
        # What all touches share, by the number of contacts; read-only, as contacts hold them.
        self._position_errors = [np.full(n, noise.position_error) for n in range(4)]
        self._normal_errors = [np.full(n, noise.normal_error) for n in range(4)]
        self._kinds = [np.full(n, FACE, np.int8) for n in range(4)]
        self._no_radius = np.zeros(3)
        self._none = Contacts.none()
        self._checked: ProbeScene | None = None

    def touch(self, scene: ProbeScene, command: ProbeCommand, rng: np.random.Generator) -> Touch:
        """Send a triad; see `Sensor.touch`."""
        rounding = scene.position_rounding
        if scene is not self._checked:
            what = f"the simulation of an object of {scene.model.diameter:g} m"
            self.noise.check_room(rounding, NORMAL_ROUNDING, what)
            self._checked = scene
        starts, directions = triad(command.x, command.y, command.yaw, self.reach)
        readings = scene.cast(starts, directions)
        ends, normals = self.noise.blur(
            rng,
            readings.outcomes,
            readings.ends_world,
            readings.normals_world,
            rounding,
            NORMAL_ROUNDING,
        )
        met = readings.outcomes.tolist()
        count = met.count(OBJECT)
        contacts = self._none
        if count:
            # Neighbouring rows are a view; a list of rows would be copied, which takes longer.
            first = met.index(OBJECT)
            rows = [0, 2] if count == 2 and met[1] != OBJECT else slice(first, first + count)
            contacts = Contacts.trusted(
                ends[rows],
                normals[rows],
                position_error=self._position_errors[count],
                normal_error=self._normal_errors[count],
                approaches=directions[rows],
                kinds=self._kinds[count],
            )
        # A measured end is off by no more than its bound, so no place on the way there is either.
        error = self._position_errors[3]
        paths = FreeSpace.trusted(starts, ends, radius=self._no_radius, error=error)
        return Touch(contacts, paths, starts, ends, readings.outcomes)
