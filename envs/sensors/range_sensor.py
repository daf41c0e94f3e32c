"""Range sensing, the memo's other modality: grids of rays, and a scanner of dense images.

`RangeGrid` is Section 4.3: rays on regular grids along three orthogonal directions. `RangeScanner`
is Section 5: a dense image, planes through patches of it, and a small number of points where they
fit very well. Both look down on the support plane; what they see of it makes no contact.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation

from ...recognizer import Contacts
from ...recognizer.contacts.free_space import FreeSpace
from ..scene.scene import OBJECT, PLANE, ProbeScene
from .grid import centred_ticks
from .noise import SensorNoise
from .patch_bounds import normal_bound
from .patches import SIDE
from .range_grid import RangeGrid
from .range_image import RangeImage, RangeView, take_image
from .range_limits import check_count, check_lengths, check_start
from .range_points import measure_points
from .touch import ProbeCommand, Touch

__all__ = ["MEMO_SPACING", "RangeGrid", "RangeScanner"]

Floats = NDArray[np.float64]

MEMO_SPACING = (0.0004, 0.0008)
"""The spacing of columns and rows in the memo's own data, metres (Section 5)."""
IMAGE_SHARES = (1.0 / 400.0, 1.0 / 200.0)
"""The same as shares of the image's width, unless told otherwise."""
FINE = 1.0 / 40.0
"""The range error, in spacings of the finer kind, unless told otherwise: it leaves most normals
sure to one or two degrees."""
COARSEST = 0.1
"""The largest range error, likewise."""
SHORTEST_EDGE = 25.0
"""The least length of an object's edges, in range errors. Steps and grooves that are as low as the
error could hide in a flat patch, and their flanks have edges as short; see `patch_bounds`. Noise
made to hide them found none at this and `COARSEST`, but some at a quarter of a spacing."""
ROUNDINGS = 6.0
"""How many times the mesh's rounding, which is square to a face, makes along a ray that meets it
at `range_points.STEEPEST`: the reciprocal of the cosine is 5.8."""
SURVEY = 8
"""Every so many columns and rows are scanned first, to see where the object is."""
PATHS = 24
"""The most rays of an image that are reported as paths swept past the object."""


class RangeScanner:
    """A dense range image, and points of it where a plane fits very well (memo, Section 5).

    Parallel rays on a rectangular grid, slanting downwards; each reading of depth is off by at
    most ``range_error``. First every eighth column and row are read, then the part of the image
    around what stands out of the plane. Of the planes through 5 x 5 readings those stay that leave
    low residuals, as do their eight neighbours; of these, points far apart with normals as
    different as the view has them become contacts.

    What holds for a contact: its position is the reading in the middle of its patch, so the face
    under it is within ``range_error`` along the ray. How far its normal may be off is derived from
    the patch's own readings, patches across edges included: see `patch_bounds`, which also says
    what is assumed of the object. A reading no higher above the plane than ``range_error`` may be
    the plane's and makes no contact. Of the thousands of rays a touch reports those of its
    contacts, in their order, and a few that passed the object by.
    """

    features: Literal["faces", "all"] = "faces"

    def __init__(
        self,
        noise: SensorNoise,
        *,
        width: float,
        reach: float,
        spacing: tuple[float, float] | None = None,
        range_error: float | None = None,
        elevation: float = np.pi / 4.0,
        points: int = 12,
    ) -> None:
        """Set up a scanner.

        Args:
            noise: no bound of a contact is wider than these; how readings are distributed.
            width: side of the square that an image covers, metres.
            reach: how far before the plane's point the rays start, metres.
            spacing: of columns and of rows, metres, such as `MEMO_SPACING`; None: shares of the
                width, `IMAGE_SHARES`.
            range_error: how far off a reading of depth is at most, metres; None: a fortieth of the
                finer spacing, or less where the noise's bounds ask for it.
            elevation: how steeply the scanner looks downwards, radians.
            points: the most contacts of one image.

        Raises:
            ValueError: a length that isn't above zero, fewer than one point, an image with too few
                or too many rays, an elevation beyond its range, rays that start below the plane,
                or a range error that is too large for the spacing or for the bound on normals.
        """
        if spacing is None:
            spacing = (IMAGE_SHARES[0] * width, IMAGE_SHARES[1] * width)
        check_lengths(width=width, reach=reach, spacing=min(spacing))
        if points < 1:
            raise ValueError(f"points is {points}; it must be at least 1")
        if not 0.0 < elevation <= np.pi / 2.0:
            raise ValueError(f"elevation is {elevation:g} rad; it must be above 0, at most pi/2")
        columns, rows = (int(width / step) + 1 for step in spacing)
        if min(columns, rows) < SIDE + 2:
            raise ValueError(
                f"an image of {columns} x {rows} readings is too coarse; it must have"
                f" {SIDE + 2} a side, so the spacing is at most {width / (SIDE + 1):g} m"
            )
        check_count(columns * rows)
        range_error = _range_error(range_error, noise, spacing)
        self.noise = noise
        self.rays = points + PATHS
        self.range_error = range_error
        self._spacing = spacing
        self._columns = centred_ticks(columns, spacing[0])
        self._rows = centred_ticks(rows, spacing[1])
        self._reach, self._elevation, self._points = reach, elevation, points
        lowest = reach * np.sin(elevation) + float(self._rows.min()) * np.cos(elevation)
        check_start(lowest, reach, width)

    def touch(self, scene: ProbeScene, command: ProbeCommand, rng: np.random.Generator) -> Touch:
        """Scan what is around a point of the plane.

        Args:
            scene: the scene, its object in place.
            command: the point in the middle of the image, and the way to look: three times the
                yaw, since a triad repeats every third of a turn and a view does not.
            rng: source of the noise.

        Raises:
            ValueError: the range error is too small for the simulation's own rounding, or the
                object has edges too short for it.
        """
        self._check_scene(scene)
        view = RangeView.towards(
            command.x,
            command.y,
            bearing=3.0 * command.yaw,
            elevation=self._elevation,
            reach=self._reach,
        )
        image = self._image(scene, view, self._columns[::SURVEY], self._rows[::SURVEY], rng)
        region = self._region(image)
        contacts, starts = Contacts.none(), np.zeros((0, 3))
        if region is not None:
            image = self._image(scene, view, self._columns[region[0]], self._rows[region[1]], rng)
            points = measure_points(
                image,
                self._above_plane(image),
                spacing=self._spacing,
                range_error=self.range_error,
                normal_error=self.noise.normal_error,
                most=self._points,
            )
            contacts, starts = points.contacts, points.starts_world
        past = self._past_object(image)
        starts = np.concatenate([starts, image.starts_world[past]])
        ends = np.concatenate([contacts.positions, image.points_world[past]])
        met = np.repeat([OBJECT, PLANE], [len(contacts), len(past[0])])
        return Touch(
            contacts=contacts,
            # A path ends where it was read to end, and that is this much off at most.
            free_space=FreeSpace(starts, ends, error=self.range_error),
            starts_world=starts,
            ends_world=ends,
            outcomes=met.astype(np.int8),
        )

    def _image(
        self,
        scene: ProbeScene,
        view: RangeView,
        columns: Floats,
        rows: Floats,
        rng: np.random.Generator,
    ) -> RangeImage:
        return take_image(
            scene,
            view,
            columns,
            rows,
            noise=self.range_error - ROUNDINGS * scene.position_rounding,
            distribution=self.noise.distribution,
            rng=rng,
        )

    def _above_plane(self, image: RangeImage) -> NDArray[np.bool_]:
        """(m, n) readings that can't be of the support plane."""
        with np.errstate(invalid="ignore"):
            return image.points_world[..., 2] > self.range_error

    def _region(self, survey: RangeImage) -> tuple[slice, slice] | None:
        """The columns and rows around what stands out of the plane; None if nothing does."""
        seen = np.argwhere(self._above_plane(survey))
        if not len(seen):
            return None
        first = np.maximum(SURVEY * (seen.min(axis=0) - 1), 0)
        last = SURVEY * (seen.max(axis=0) + 1) + 1
        # Patches and their neighbours have to fit into what is scanned, at its rim too.
        last = np.maximum(last, first + SIDE + 2)
        count = np.array([len(self._columns), len(self._rows)])
        first = np.minimum(first, np.maximum(count - SIDE - 2, 0))
        return slice(int(first[0]), int(last[0])), slice(int(first[1]), int(last[1]))

    def _past_object(self, image: RangeImage) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Indices of some rays that reached the plane: next to the outline, if there is one."""
        plane = image.outcomes == PLANE
        beside = plane & binary_dilation(self._above_plane(image), np.ones((3, 3)))
        rays = np.argwhere(beside if beside.any() else plane)
        thinned = rays[np.linspace(0, len(rays) - 1, min(PATHS, len(rays))).astype(int)]
        return thinned[:, 0], thinned[:, 1]

    def _check_scene(self, scene: ProbeScene) -> None:
        """Refuse an object that can't be measured within the bounds."""
        least = 2.0 * ROUNDINGS * scene.position_rounding
        if self.range_error <= least:
            raise ValueError(
                f"range_error is {self.range_error:g} m; the simulation of an object of"
                f" {scene.model.diameter:g} m is exact to {scene.position_rounding:.2g} m,"
                f" so ask for more than {least:.2g} m"
            )
        edges = scene.model.edges
        shortest = float(np.linalg.norm(edges[:, 1] - edges[:, 0], axis=1).min())
        if shortest < SHORTEST_EDGE * self.range_error:
            raise ValueError(
                f"{scene.model.name} has an edge of {shortest:g} m, which a range error of"
                f" {self.range_error:g} m may hide; ask for at most {shortest / SHORTEST_EDGE:g} m"
            )


def _range_error(wanted: float | None, noise: SensorNoise, spacing: tuple[float, float]) -> float:
    """The range error asked for, or the default, if normals and positions can be so sure."""
    finest = min(spacing)
    # With such an error a patch that fits perfectly, square to the rays, is as sure as it must be.
    a_tenth = normal_bound(np.zeros(2), np.zeros((SIDE, SIDE)), spacing, COARSEST * finest)
    for_normals = COARSEST * finest * float(np.tan(noise.normal_error) / np.tan(a_tenth))
    if wanted is None:
        return min(noise.position_error, FINE * finest, for_normals / 2.0)
    check_lengths(range_error=wanted)
    most = min(noise.position_error, COARSEST * finest, for_normals)
    if wanted > most:
        raise ValueError(
            f"range_error is {wanted:g} m; it is at most {most:.3g} m, because of the spacing"
            f" ({finest:g} m) and of the bounds on positions ({noise.position_error:g} m) and"
            f" normals ({noise.normal_error:.3g} rad)"
        )
    return wanted
