"""Grids of rays along three orthogonal directions (memo, Section 4.3)."""

from __future__ import annotations

from typing import Literal

import numpy as np

from ...recognizer import FACE, Contacts
from ...recognizer.contacts.free_space import FreeSpace
from ..scene.scene import NORMAL_ROUNDING, OBJECT, ProbeScene
from .grid import centred_ticks, rays_along
from .noise import SensorNoise
from .range_limits import check_count, check_lengths, check_start
from .touch import ProbeCommand, Touch, triad

GRID_SHARE = 1.0 / 7.0
"""Spacing of a grid, as a share of its width, unless told otherwise: 49 rays a direction."""


class RangeGrid:
    """Regular grids of rays along three orthogonal directions (memo, Section 4.3).

    The directions are a triad's, all slanting downwards, so that each ray ends on the object or on
    the support plane. The middle rays meet in (x, y, 0).
    """

    features: Literal["faces", "all"] = "faces"

    def __init__(
        self,
        noise: SensorNoise,
        *,
        width: float,
        reach: float,
        spacing: float | None = None,
    ) -> None:
        """Lay out the grids.

        Args:
            noise: bounds on positions and normals; the noise fills them.
            width: side of the square that each grid covers, metres.
            reach: how far before the plane's point the rays start, metres.
            spacing: between neighbouring rays, metres; None: a seventh of the width.

        Raises:
            ValueError: a width, spacing or reach that isn't above zero, a spacing wider than the
                grid, so many rays that no object needs them, or rays that start below the plane.
        """
        spacing = GRID_SHARE * width if spacing is None else spacing
        check_lengths(width=width, reach=reach, spacing=spacing)
        if spacing > width:
            raise ValueError(f"spacing is {spacing:g} m; a grid {width:g} m wide needs less")
        a_side = round(width / spacing)
        check_count(3 * a_side**2)
        ticks = centred_ticks(a_side, spacing)
        grids = [rays_along(axis, ticks, ticks, reach) for axis in range(3)]
        self.noise = noise
        self.rays = 3 * a_side**2
        self._reach = reach
        self._starts = np.concatenate([starts for starts, _ in grids])
        self._directions = np.concatenate([directions for _, directions in grids])
        lowest = float((self._starts @ -triad(0.0, 0.0, 0.0, reach)[1])[:, 2].min())
        check_start(lowest, reach, width)

    def touch(self, scene: ProbeScene, command: ProbeCommand, rng: np.random.Generator) -> Touch:
        """Cast the grids towards a point of the plane.

        Args:
            scene: the scene, its object in place.
            command: the point, and the turn of the triad of directions.
            rng: source of the noise.

        Raises:
            ValueError: the bounds are too tight for the simulation's own rounding.
        """
        rounding = scene.position_rounding
        what = f"the simulation of an object of {scene.model.diameter:g} m"
        self.noise.check_room(rounding, NORMAL_ROUNDING, what)
        # The rays run against the frame's axes, so these point to where they come from.
        axes = -triad(command.x, command.y, command.yaw, self._reach)[1]
        starts = self._starts @ axes + np.array([command.x, command.y, 0.0])
        directions = self._directions @ axes
        readings = scene.cast(starts, directions)
        ends, normals = self.noise.blur(
            rng,
            readings.outcomes,
            readings.ends_world,
            readings.normals_world,
            rounding,
            NORMAL_ROUNDING,
        )
        hit = readings.outcomes == OBJECT
        contacts = Contacts(
            ends[hit],
            normals[hit],
            position_error=np.full(int(hit.sum()), self.noise.position_error),
            normal_error=np.full(int(hit.sum()), self.noise.normal_error),
            approaches=directions[hit],
            kinds=FACE,
        )
        return Touch(
            contacts=contacts,
            # A path ends where the contact was reported, and that is this much off at most.
            free_space=FreeSpace(starts, ends, error=self.noise.position_error),
            starts_world=starts,
            ends_world=ends,
            outcomes=readings.outcomes,
        )
