"""`palpate/ProbePlanar-v0`: find out by touch which outline lies here, and how."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray
from scipy.spatial.transform import RigidTransform, Rotation

from ...recognizer import Belief, Contacts, Polygon, PoseTolerance, Recognizer, SearchLimits
from ..observation import Observation, check_sizes
from ..pictures.window import Window
from ..scene.scene import OBJECT
from ..sensors.noise import SensorNoise
from ..sensors.touch import finite_action
from .library import OutlineSource, load_outlines
from .observation import PlanarObservationLayout
from .picture import PlanarGhost, PlanarPicture, draw_planar
from .probe import PlanarProbe, PlanarTouch

INCH = 0.0254
HALF_WIDTH = 0.5
"""How far from the origin rays pass at most, in diameters of the largest outline."""
REACH = 2.0
"""Rays start this many diameters of the largest outline before they pass the origin."""
PLACED = 0.2
"""How far from the origin an outline's centroid lies at most, in half widths."""


class PlanarProbeEnv(gymnasium.Env[dict[str, Any], NDArray[np.floating]]):
    """An unknown outline of a known library is touched until one hypothesis is left.

    ## Description
    One outline of the library lies in the plane at an unknown position and angle: three degrees of
    freedom, as in the memo's first experiments. A probe is a ray that comes from outside; it
    reports where it first meets the outline, with the outward normal there, or that it passed by.
    After each probe the recogniser says which hypotheses (outline and pose) the contacts so far
    allow. It makes nothing of rays that passed by: in the plane it knows no free space.

    Rays and outlines are computed exactly, without a physics engine.

    ## Action Space
    `Box(-1, 1, (2,))`, float32:

    | number | meaning | -1 | 1 |
    |---|---|---|---|
    | 0 | direction in which the ray runs, from the x axis | -180 degrees | 180 degrees |
    | 1 | how far to the left of the origin it passes | -half width | half width |

    The half width is half the diameter of the library's largest outline (`env.half_width`).

    ## Observation Space
    A `Dict` of `Box`es. R is `max_probes`, H is `hypotheses_shown`; unused rows are zero. Names are
    those of `palpate/Probe-v0` where they mean the same.

    | key | shape | meaning |
    |---|---|---|
    | contact_count | (1,) | contacts on the outline so far, n |
    | contact_positions | (R, 2) | first n rows: positions, world, metres |
    | contact_normals | (R, 2) | first n rows: outward unit normals, world |
    | contact_position_error | (R,) | bounds on them, metres |
    | contact_normal_error | (R,) | bounds on them, radians |
    | ray_count | (1,) | rays sent so far |
    | ray_starts, ray_ends | (R, 2) | segments swept, metres |
    | ray_outcomes | (R,) | 1 outline, 3 nothing; 0 not sent |
    | hypothesis_count | (1,) | hypotheses left; 0 before the first contact too |
    | hypothesis_objects | (H,) | index into the library, heaviest first; -1 none |
    | hypothesis_positions | (H, 2) | origin of the outline in the world, metres |
    | hypothesis_angles | (H,) | rotation model to world, radians from -pi to pi |
    | hypothesis_weights | (H,) | shares of the belief |
    | hypothesis_determined | (H,) | 1 if the contacts fix all three freedoms |
    | interpretation_count | (1,) | interpretations left |

    ## Rewards
    -1 a probe.

    ## Starting State
    The outline is drawn from the library; its angle is uniform, and its centroid lies uniformly
    within a fifth of the half width of the origin.

    ## Episode End
    Terminated when one hypothesis is left, up to the outline's symmetry and with its pose fixed,
    or none. Truncated after `max_probes`.

    ## Info
    `truth`, for scoring alone: `object` (name) and `pose` (4, 4), model to world, a motion within
    the plane z = 0.

    ## Rendering
    `rgb_array` gives a picture, (600, 600, 3): the outline as it lies, rays, contacts with the
    normals felt, and the leading hypotheses as ghosts. `human` shows it in a window after each
    step, by matplotlib's interactive backend.

    ## Arguments
    | name | default | meaning |
    |---|---|---|
    | library | None | names of stand-ins or `Polygon`s; None: wrench, gator and hand |
    | object_name | None | always this outline; None: drawn at reset |
    | position_error | 0.00254 | bound on positions, metres (0.1 in, as in the memo's Table I) |
    | normal_error | pi / 8 | bound on normals, radians (likewise) |
    | max_probes | 40 | probes before truncation |
    | hypotheses_shown | 16 | hypotheses in the observation |
    | tolerance | None | which poses count as the same |
    | limits | None | how far the recogniser searches |
    | render_mode | None | None, "rgb_array" or "human" |

    ## References
    W. E. L. Grimson and T. Lozano-Perez, MIT AI Memo 738, 1983, Section 4.1; P. C. Gaston and
    T. Lozano-Perez, "Tactile recognition and localization using object models: the case of
    polyhedra on a plane", IEEE PAMI 6(3), 1984.

    ## Version History
    * v0: initial version.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012  Gymnasium's own declaration
        "render_modes": ["human", "rgb_array"],
        "render_fps": 2,
    }

    def __init__(
        self,
        library: OutlineSource = None,
        *,
        object_name: str | None = None,
        position_error: float = 0.1 * INCH,
        normal_error: float = np.pi / 8.0,
        max_probes: int = 40,
        hypotheses_shown: int = 16,
        tolerance: PoseTolerance | None = None,
        limits: SearchLimits | None = None,
        render_mode: str | None = None,
    ) -> None:
        """See the class for the arguments.

        Raises:
            ValueError: an unknown outline or render mode, an empty library, a bound that isn't
                positive or is too tight, or fewer than one probe or hypothesis.
            gymnasium.error.DependencyNotInstalled: render mode "human" where no window can open.
        """
        check_sizes(max_probes=max_probes, hypotheses_shown=hypotheses_shown)
        known_modes = (None, *self.metadata["render_modes"])
        if render_mode not in known_modes:
            raise ValueError(f"render_mode is {render_mode!r}; it must be one of {known_modes}")
        noise = SensorNoise(position_error=position_error, normal_error=normal_error)
        self.library = load_outlines(library)
        self._index = {outline.name: row for row, outline in enumerate(self.library)}
        if object_name is not None and object_name not in self._index:
            known = ", ".join(self._index)
            raise ValueError(f"no outline is called {object_name!r}; the library has: {known}")
        self._object_name = object_name
        self.recognizer = Recognizer(self.library, tolerance=tolerance, limits=limits)
        largest = max(outline.diameter for outline in self.library)
        self.half_width = HALF_WIDTH * largest
        self._probe = PlanarProbe(noise, REACH * largest)
        self._max_probes = max_probes
        self._layout = PlanarObservationLayout(
            rays=max_probes,
            hypotheses=hypotheses_shown,
            objects=len(self.library),
            extent=float(np.hypot(REACH * largest, self.half_width)) + position_error,
        )
        self.observation_space = self._layout.space()
        self.action_space = spaces.Box(-1.0, 1.0, (2,), np.float32)
        self.render_mode = render_mode
        self._window = Window("palpate/ProbePlanar-v0") if render_mode == "human" else None
        # The pose as a matrix: SciPy normalises a pickled one anew, which changes its last bits.
        self._truth: tuple[Polygon, NDArray[np.float64]] | None = None
        self._contacts = Contacts.none(2)
        self._touches: list[PlanarTouch] = []
        self._belief: Belief | None = None

    @property
    def belief(self) -> Belief | None:
        """What the recogniser makes of the contacts so far; None before the first contact."""
        return self._belief

    @property
    def contacts(self) -> Contacts:
        """All contacts so far."""
        return self._contacts

    @property
    def touches(self) -> tuple[PlanarTouch, ...]:
        """What each probe reported."""
        return tuple(self._touches)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Place a new outline; ``options`` are not used."""
        super().reset(seed=seed)
        drawn = self.library[int(self.np_random.integers(len(self.library)))]
        outline = self.library[self._index[self._object_name or drawn.name]]
        self._truth = outline, self._draw_pose(outline).as_matrix()
        self._contacts = Contacts.none(2)
        self._touches = []
        self._belief = None
        self._show()
        return self._observe(), self._info()

    def step(
        self, action: NDArray[np.floating]
    ) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Send one ray; actions beyond the box are clipped to it.

        Raises:
            ValueError: an action of the wrong shape or that isn't finite.
            gymnasium.error.ResetNeeded: before the first reset.
        """
        outline, pose = self._placed()
        bearing, offset = finite_action(action, 2) * (np.pi, self.half_width)
        touch = self._probe.touch(outline, pose, float(bearing), float(offset), self.np_random)
        self._touches.append(touch)
        if touch.outcome == OBJECT:
            self._contacts = Contacts.join([self._contacts, touch.contacts])
            self._belief = self.recognizer.recognize(self._contacts)
        ended = self._belief is not None and (self._belief.unique or self._belief.empty)
        truncated = len(self._touches) >= self._max_probes
        self._show()
        return self._observe(), -1.0, ended, truncated, self._info()

    def render(self) -> NDArray[np.uint8] | None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """The picture in mode "rgb_array"; in mode "human" it is in the window already.

        Raises:
            gymnasium.error.ResetNeeded: before the first reset.
        """
        return draw_planar(self._picture()) if self.render_mode == "rgb_array" else None

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._window is not None:
            self._window.close()

    def _placed(self) -> tuple[Polygon, RigidTransform]:
        if self._truth is None:
            raise gymnasium.error.ResetNeeded("call reset first")
        outline, matrix = self._truth
        return outline, RigidTransform(matrix, normalize=False)

    def _draw_pose(self, outline: Polygon) -> RigidTransform:
        """A pose, model to world, uniform in angle and offset."""
        angle, far, bearing = self.np_random.random(3) * (2.0 * np.pi, 1.0, 2.0 * np.pi)
        rotation = Rotation.from_rotvec([0.0, 0.0, angle])
        distance = PLACED * self.half_width * np.sqrt(far)
        centroid = distance * np.array([np.cos(bearing), np.sin(bearing), 0.0])
        shift = centroid - rotation.apply(np.append(outline.centroid, 0.0))
        return RigidTransform.from_components(shift, rotation)

    def _observe(self) -> Observation:
        # Past max_probes an episode may be stepped on; the observation keeps its last rows.
        touches = self._touches[-self._max_probes :]
        contacts = self._contacts[slice(-self._max_probes, None)]
        return self._layout.pack(contacts, touches, self._belief, self._index)

    def _info(self) -> dict[str, Any]:
        outline, pose = self._placed()
        return {"truth": {"object": outline.name, "pose": pose.as_matrix()}}

    def _show(self) -> None:
        if self._window is not None:
            self._window.show(draw_planar(self._picture()))

    def _picture(self) -> PlanarPicture:
        outline, pose = self._placed()
        hypotheses = self._belief.hypotheses if self._belief else ()
        ghosts = tuple(
            PlanarGhost(
                _outline_at(self.library[self._index[hypothesis.object_name]], hypothesis.pose),
                self._index[hypothesis.object_name],
                hypothesis.object_name,
                hypothesis.weight,
            )
            for hypothesis in hypotheses[: self._layout.hypotheses]
        )
        starts = [touch.start_world for touch in self._touches]
        ends = [touch.end_world for touch in self._touches]
        return PlanarPicture(
            outline_world=_outline_at(outline, pose),
            rays_world=np.array([*zip(starts, ends, strict=True)]).reshape(-1, 2, 2),
            ray_hits=np.array([touch.outcome == OBJECT for touch in self._touches], bool),
            contacts_world=self._contacts.positions,
            normals_world=self._contacts.normals,
            ghosts=ghosts,
            half_width=(1.0 + PLACED) * self.half_width,
            title=f"{len(self._touches)} probes, {len(hypotheses)} hypotheses",
        )


def _outline_at(outline: Polygon, pose: RigidTransform) -> NDArray[np.float64]:
    """(e, 2) corners of an outline at a pose, world frame, metres."""
    in_space = np.column_stack([outline.corners, np.zeros(len(outline.corners))])
    return pose.apply(in_space)[:, :2]
