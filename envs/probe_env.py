"""`palpate/Probe-v0`: find out by touch which object lies here, and how."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Literal

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from ..recognizer import (
    Belief,
    Contacts,
    PoseTolerance,
    Recognizer,
    SearchLimits,
    SupportPlane,
)
from .knowledge import KEPT_WITHIN, Knowing, Knowledge
from .library import LibrarySource, checked_name, load_library
from .observation import Observation, ObservationLayout, check_sizes
from .pictures.episode import Episode
from .pictures.view_mode import view_in
from .scene.free_body import STILL
from .scene.free_object import SINK, free_object
from .scene.placement import make_placement
from .scene.scene import ProbeScene, check_size
from .sensors.finger_sensor import FingerSensor
from .sensors.noise import Distribution, SensorNoise
from .sensors.sensors import make_sensors
from .sensors.touch import ProbeCommand, Sensor, Touch, finite_action

INCH = 0.0254
HALF_WIDTH = 0.375
"""Half the side of the square that triads meet in, in diameters of the largest object."""
REACH = 2.0
"""Rays start this many diameters of the largest object before the point where they meet."""


class ProbeEnv(gymnasium.Env[dict[str, Any], NDArray[np.floating]]):
    """An unknown object of a known library is touched until one hypothesis is left.

    ## Description
    One object of the library is held at an unknown pose, any orientation, across the support plane
    ``z = 0``. A probe sends a triad of mutually orthogonal rays, all pointing downwards, that meet
    at a point (x, y, 0) of the plane; each reports where it first meets the object, with the
    outward normal there, or that it reached the plane. After each probe the recogniser says which
    hypotheses (object and pose) the contacts so far allow.

    What goes along the rays is the sensor: points ("ray", the memo's ideal probe), balls that stop
    where they first touch ("ball"), or a finger with a ball tip, driven by dynamics ("finger").
    Balls and fingers touch edges and vertices too. With several sensors each probe says which.

    ## Action Space
    `Box(-1, 1, (3,))`, float32; with several sensors `(4,)`:

    | number | meaning | -1 | 1 |
    |---|---|---|---|
    | 0 | x of the meeting point | -half width | half width |
    | 1 | y of the meeting point | -half width | half width |
    | 2 | yaw of the triad | -60 degrees | 60 degrees |
    | 3 | sensor, the range cut into equal parts | the first | the last |

    The half width is three eighths of the diameter of the library's largest object
    (`env.half_width`); rays come in at a slant, so they also reach what lies somewhat outside.

    ## Observation Space
    A `Dict` of `Box`es. R is `max_probes` times the sensor's rays (three; of "range" 36, of
    "range-grid" 147), H is `hypotheses_shown`, S is `samples_shown`; unused rows are zero.

    | key | shape | meaning |
    |---|---|---|
    | contact_count | (1,) | contacts on the object so far, n |
    | contact_positions | (R, 3) | first n rows: positions, world, metres |
    | contact_normals | (R, 3) | first n rows: outward unit normals, world |
    | contact_position_error | (R,) | bounds on them, metres |
    | contact_normal_error | (R,) | bounds on them, radians |
    | contact_kinds | (R,) | 1 face, 2 edge, 3 vertex; 0 unused |
    | ray_count | (1,) | rays sent so far |
    | ray_starts, ray_ends | (R, 3) | segments swept, of a ball by its centre, metres |
    | ray_outcomes | (R,) | 1 object, 2 plane, 3 nothing; 0 not sent |
    | hypothesis_count | (1,) | hypotheses left; 0 before the first contact too |
    | hypothesis_objects | (H,) | index into the library, heaviest first; -1 none |
    | hypothesis_positions | (H, 3) | origin of the model in the world, metres |
    | hypothesis_quaternions | (H, 4) | rotation model to world (x, y, z, w) |
    | hypothesis_weights | (H,) | shares of the belief |
    | hypothesis_determined | (H,) | 1 if the contacts fix all six freedoms |
    | interpretation_count | (1,) | interpretations left |
    | sample_count | (1,) | poses that stand for the belief; 0 before the first contact |
    | sample_objects | (S,) | index into the library |
    | sample_hypotheses | (S,) | which hypothesis, counted from 0, heaviest first |
    | sample_positions, sample_quaternions | (S, 3), (S, 4) | as those of hypotheses |
    | sample_weights | (S,) | shares of the belief; they sum to 1 |
    | sample_position_spread | (S,) | standard deviation of the centroid around each, metres |
    | sample_rotation_spread | (S,) | the same of the rotation, radians |

    ## Rewards
    -1 a probe.

    ## Starting State
    The object is drawn from the library; its centroid lies within a fifth of the half width of the
    origin. By `placement`:

    - "across": held at any orientation, uniform, with 10 to 50 % of its height below the plane;
    - "resting": standing on the plane, on a face drawn by how often a slow tumble ends on it;
    - "dropped": as it comes to rest in a simulated drop.

    In the last two the recogniser knows that the object stands on the plane. There it may also be
    `free`: a finger then pushes it about. It comes to rest after each ray, what was felt before
    holds with bounds wider by how far it moved, and is dropped once it says too little.

    ## Episode End
    Terminated when one hypothesis is left, up to the object's symmetry and with its pose fixed, or
    none. Truncated after `max_probes`.

    ## Info
    `truth`, for scoring alone: `object` (name) and `pose` (4, 4), model to world. Of a free object
    also `displacement`, what a tracker would tell: the largest `distance` (metres) by which a point
    of it was moved by the last probe, and the `turn` (radians).

    ## Rendering
    `rgb_array` gives a picture, (600, 800, 3): the object as it truly lies, the last probe's rays,
    all contacts with the normals felt, and the leading rivals as ghosts. MuJoCo's renderer draws
    it, in a process of its own that lives until `close`; where no GL library works, NumPy
    does. `human` shows it in a window after each step, by matplotlib's interactive backend.

    ## Arguments
    | name | default | meaning |
    |---|---|---|
    | library | None | names of stand-ins, models, or a folder of meshes; None: all stand-ins |
    | object_name | None | always this object; None: drawn at reset |
    | placement | across | "across", "resting" or "dropped" |
    | free | False | whether a standing object moves when it is pushed |
    | mass | None | of a free object, kilograms; None: that of its volume in water |
    | friction | None | between a free object and the plane; None: 0.5 |
    | sensor | ray | "ray", "ball", "finger", "range", "range-grid", a `Sensor`, or several |
    | position_error | 0.000254 | bound on positions, metres (0.01 in) |
    | normal_error | pi / 10 | bound on normals, radians |
    | distribution | uniform | of the noise inside its bounds: "uniform" or "gaussian" |
    | radius | None | of a ball or a finger's tip, metres; None: 0.002 |
    | force_threshold | None | at which a finger stops, newtons; None: at first contact |
    | use_free_space | False | whether the recogniser is told of the paths that were free |
    | max_probes | 40 | probes before truncation |
    | hypotheses_shown | 16 | hypotheses in the observation |
    | samples_shown | 256 | the most poses in the observation that stand for the belief |
    | tolerance | None | which poses count as the same |
    | limits | None | how far the recogniser searches |
    | render_mode | None | None, "rgb_array" or "human" |

    ## References
    W. E. L. Grimson and T. Lozano-Perez, MIT AI Memo 738, 1983, Section 4.4.

    ## Version History
    * v0: initial version.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012  Gymnasium's own declaration
        "render_modes": ["human", "rgb_array"],
        "render_fps": 2,
    }

    def __init__(
        self,
        library: LibrarySource = None,
        *,
        object_name: str | None = None,
        placement: Literal["across", "resting", "dropped"] = "across",
        free: bool = False,
        mass: float | None = None,
        friction: float | None = None,
        sensor: str | Sensor | Sequence[str | Sensor] = "ray",
        position_error: float = 0.01 * INCH,
        normal_error: float = np.pi / 10.0,
        distribution: Distribution = "uniform",
        radius: float | None = None,
        force_threshold: float | None = None,
        use_free_space: bool = False,
        max_probes: int = 40,
        hypotheses_shown: int = 16,
        samples_shown: int = 256,
        tolerance: PoseTolerance | None = None,
        limits: SearchLimits | None = None,
        render_mode: str | None = None,
    ) -> None:
        """See the class for the arguments.

        Raises:
            ValueError: an unknown object, placement, sensor or render mode, a library that can't be
                loaded, an object of less than a millimetre or more than ten metres, a bound that
                isn't positive, a radius or a force that the sensor or the objects don't allow, an
                object that is free but doesn't stand, or a mass or friction of one that isn't free,
                or fewer than one probe, hypothesis or sample.
            gymnasium.error.DependencyNotInstalled: render mode "human" where no window can open.
        """
        check_sizes(
            max_probes=max_probes, hypotheses_shown=hypotheses_shown, samples_shown=samples_shown
        )
        self.render_mode = render_mode
        self._view = view_in(render_mode, self.metadata["render_modes"])
        noise = SensorNoise(
            position_error=position_error, normal_error=normal_error, distribution=distribution
        )
        self.library = load_library(library)
        for model in self.library:
            check_size(model)
        self._index = {model.name: row for row, model in enumerate(self.library)}
        self._object_name = checked_name(object_name, self.library)
        largest = max(model.diameter for model in self.library)
        self.half_width = HALF_WIDTH * largest
        self._placement = make_placement(placement, 0.2 * self.half_width)
        self._free = free_object(free, placement, mass, friction)
        # One plane for all: its error is that of the largest object.
        support = self._placement.support(max(self.library, key=lambda model: model.diameter))
        if support and self._free:
            support = replace(support, error=support.error + SINK)
        self._support: SupportPlane | None = support
        self.sensors = make_sensors(
            sensor, noise, REACH * largest, radius=radius, force_threshold=force_threshold
        )
        every = any(one.features == "all" for one in self.sensors)
        self.recognizer = Recognizer(
            self.library, features="all" if every else "faces", tolerance=tolerance, limits=limits
        )
        self.use_free_space = use_free_space
        self._knowing = Knowing(
            self.recognizer, KEPT_WITHIN * largest, use_free_space, samples_shown
        )
        self._scenes: dict[str, ProbeScene] = {}
        self._max_probes = max_probes
        self._layout = ObservationLayout(
            rays=max(one.rays for one in self.sensors) * max_probes,
            hypotheses=hypotheses_shown,
            samples=samples_shown,
            objects=len(self.library),
            extent=2.0 * REACH * largest + max(one.noise.position_error for one in self.sensors),
        )
        self.observation_space = self._layout.space()
        self._numbers = 3 if len(self.sensors) == 1 else 4
        self.action_space = spaces.Box(-1.0, 1.0, (self._numbers,), np.float32)
        self._scene: ProbeScene | None = None
        self._known = Knowledge.none(self.library)

    @property
    def belief(self) -> Belief | None:
        """What the recogniser makes of the contacts so far; None before the first contact."""
        return self._known.belief

    @property
    def contacts(self) -> Contacts:
        """All contacts so far that still hold."""
        return self._known.evidence.contacts

    @property
    def touches(self) -> tuple[Touch, ...]:
        """What each probe reported."""
        return self._known.evidence.touches

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Place a new object; ``options`` are not used."""
        super().reset(seed=seed)
        rng = self.np_random
        drawn = self.library[int(rng.integers(len(self.library)))].name
        name = self._object_name or drawn
        if name not in self._scenes:
            self._scenes[name] = ProbeScene(self.library[self._index[name]], free=self._free)
        self._scene = self._scenes[name]
        for sensor in self.sensors:
            if self._free and isinstance(sensor, FingerSensor):
                # What else is in the scene tells in the last bits of how an object comes to rest.
                self._scene.mount(sensor.design)
        self._scene.place(self._placement.draw(rng, self._scene.model))
        self._known = Knowledge.none(self.library)
        self._show()
        return self._observe(), self._info()

    def step(
        self, action: NDArray[np.floating]
    ) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Send one triad; actions beyond the box are clipped to it.

        Raises:
            ValueError: an action of the wrong shape or that isn't finite.
            gymnasium.error.ResetNeeded: before the first reset.
        """
        scene = self._placed()
        x, y, yaw, *choice = finite_action(action, self._numbers).tolist()
        command = ProbeCommand(x * self.half_width, y * self.half_width, yaw * np.pi / 3.0)
        touch = self._chosen(*choice).touch(scene, command, self.np_random)
        self._known = self._knowing.after(self._known, touch, self._standing)
        belief = self.belief
        ended = belief is not None and (belief.unique or belief.empty)
        truncated = len(self.touches) >= self._max_probes
        self._show()
        return self._observe(), -1.0, ended, truncated, self._info()

    def render(self) -> NDArray[np.uint8] | None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """The picture in mode "rgb_array"; in mode "human" it is in the window already.

        Raises:
            gymnasium.error.ResetNeeded: before the first reset.
        """
        if self._view is None or self.render_mode != "rgb_array":
            return None
        return self._view.picture(Episode.of(self, self._info()))

    def close(self) -> None:
        """End what draws, and close the window, if there is one."""
        if self._view is not None:
            self._view.close()

    def _placed(self) -> ProbeScene:
        if self._scene is None:
            raise gymnasium.error.ResetNeeded("call reset first")
        return self._scene

    def _chosen(self, choice: float = -1.0) -> Sensor:
        """The sensor that an action's last number, in [-1, 1], stands for."""
        count = len(self.sensors)
        return self.sensors[min(int(0.5 * (choice + 1.0) * count), count - 1)]

    def _standing(self) -> SupportPlane | None:
        """The plane that the object is known to stand on."""
        support = self._support
        if self._free and support and not self._placed().stands(support.error):
            return None  # it leans on something, or rolls: the promise doesn't hold
        return support

    def _show(self) -> None:
        if self._view is not None:
            self._view.show(Episode.of(self, self._info()))

    def _observe(self) -> Observation:
        # Past max_probes an episode may be stepped on; the observation keeps its last rows.
        touches = self.touches[-self._max_probes :]
        contacts = self.contacts[slice(-self._layout.rays, None)]
        return self._layout.pack(contacts, touches, self.belief, self._known.samples, self._index)

    def _info(self) -> dict[str, Any]:
        scene = self._placed()
        pose = scene.T_world_object.as_matrix()
        info: dict[str, Any] = {"truth": {"object": scene.model.name, "pose": pose}}
        if self._free:
            moved = self.touches[-1].displacement if self.touches else STILL
            info["displacement"] = {"distance": moved.distance, "turn": moved.turn}
        return info
