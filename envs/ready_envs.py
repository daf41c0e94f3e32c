"""Ready-made environments: `ProbeEnv` with the arguments of a usual setting."""

from __future__ import annotations

from typing import Literal

import numpy as np

from ..recognizer import PoseTolerance, SearchLimits
from .library import LibrarySource
from .probe_env import INCH, ProbeEnv
from .sensors.noise import Distribution


class ProbeRestEnv(ProbeEnv):
    """An unknown object that stands on a known plane is touched until one hypothesis is left.

    ## Description
    One object of the library stands on the plane ``z = 0``, which the recogniser knows: no pose is
    kept that reaches below the plane or doesn't stand on it. A probe sends a triad of mutually
    orthogonal rays, all pointing downwards, that meet at a point (x, y, 0) of the plane; each
    reports where it first meets the object, with the outward normal there, or that it reached the
    plane. After each probe the recogniser says which hypotheses (object and pose) are left.

    ## Action Space
    `Box(-1, 1, (3,))`, float32:

    | number | meaning | -1 | 1 |
    |---|---|---|---|
    | 0 | x of the meeting point | -half width | half width |
    | 1 | y of the meeting point | -half width | half width |
    | 2 | yaw of the triad | -60 degrees | 60 degrees |

    The half width is three eighths of the diameter of the library's largest object
    (`env.half_width`); rays come in at a slant, so they also reach what lies somewhat outside.

    ## Observation Space
    A `Dict` of `Box`es. R is three times `max_probes`, H is `hypotheses_shown`, S is
    `samples_shown`; unused rows are zero.

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
    The object is drawn from the library and stands on a face that is drawn by how often a slow
    tumble ends on it, or, with `dropped`, on the one on which a simulated drop ends; its turn about
    the vertical is uniform, and its centroid lies within a fifth of the half width of the origin.

    ## Episode End
    Terminated when one hypothesis is left, up to the object's symmetry and with its pose fixed, or
    none. Truncated after `max_probes`.

    ## Info
    `truth`, for scoring alone: `object` (name) and `pose` (4, 4), model to world.

    ## Rendering
    As in `palpate/Probe-v0`: `rgb_array` gives a picture, (600, 800, 3), of the object, the last
    probe's rays, all contacts with the normals felt, and the leading rivals as ghosts; `human`
    shows it in a window after each step.

    ## Arguments
    | name | default | meaning |
    |---|---|---|
    | library | None | names of stand-ins, models, or a folder of meshes; None: all stand-ins |
    | object_name | None | always this object; None: drawn at reset |
    | dropped | False | whether the object is dropped in simulation, not placed |
    | position_error | 0.000254 | bound on positions, metres (0.01 in) |
    | normal_error | pi / 10 | bound on normals, radians |
    | distribution | uniform | of the noise inside its bounds: "uniform" or "gaussian" |
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

    def __init__(
        self,
        library: LibrarySource = None,
        *,
        object_name: str | None = None,
        dropped: bool = False,
        position_error: float = 0.01 * INCH,
        normal_error: float = np.pi / 10.0,
        distribution: Distribution = "uniform",
        max_probes: int = 40,
        hypotheses_shown: int = 16,
        samples_shown: int = 256,
        tolerance: PoseTolerance | None = None,
        limits: SearchLimits | None = None,
        render_mode: str | None = None,
    ) -> None:
        """See the class for the arguments.

        Raises:
            ValueError: as `ProbeEnv` does.
        """
        super().__init__(
            library,
            object_name=object_name,
            placement="dropped" if dropped else "resting",
            position_error=position_error,
            normal_error=normal_error,
            distribution=distribution,
            max_probes=max_probes,
            hypotheses_shown=hypotheses_shown,
            samples_shown=samples_shown,
            tolerance=tolerance,
            limits=limits,
            render_mode=render_mode,
        )


class ProbeFingerEnv(ProbeEnv):
    """An unknown object is touched by a finger, driven by dynamics, until one hypothesis is left.

    ## Description
    One object of the library is held at an unknown pose, any orientation, across the support plane
    ``z = 0``, or stands on it. A finger with a ball tip makes three guarded moves, all downwards at
    right angles to each other, that meet at a point (x, y, 0) of the plane: on each its tip is
    driven along the ray by force-limited actuators, stops where it first touches, or where it is
    pressed with a force, and goes back. It
    reports where it touched the object, the normal there, and whether that was on a face, a convex
    edge or a vertex, or that it reached the plane. After each probe the recogniser says which
    hypotheses (object and pose) the contacts so far allow.

    ## Action Space
    `Box(-1, 1, (3,))`, float32:

    | number | meaning | -1 | 1 |
    |---|---|---|---|
    | 0 | x of the meeting point | -half width | half width |
    | 1 | y of the meeting point | -half width | half width |
    | 2 | yaw of the triad | -60 degrees | 60 degrees |

    The half width is three eighths of the diameter of the library's largest object
    (`env.half_width`); rays come in at a slant, so they also reach what lies somewhat outside.

    ## Observation Space
    A `Dict` of `Box`es. R is three times `max_probes`, H is `hypotheses_shown`, S is
    `samples_shown`; unused rows are zero.

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
    origin. By `placement` it is held "across" the plane at any orientation, uniform, 10 to 50 % of
    its height below it, or stands on it, "resting" or "dropped"; then the recogniser knows so. One
    that stands may be `free`: the finger pushes it about. It comes to rest after each ray; what was
    felt before holds with bounds wider by how far it moved, and is dropped once it says too little.

    ## Episode End
    Terminated when one hypothesis is left, up to the object's symmetry and with its pose fixed, or
    none. Truncated after `max_probes`.

    ## Info
    `truth`, for scoring alone: `object` (name) and `pose` (4, 4), model to world. Of a free object
    also `displacement`, what a tracker would tell: the largest `distance` (metres) by which a point
    of it was moved by the last probe, and the `turn` (radians).

    ## Rendering
    As in `palpate/Probe-v0`: `rgb_array` gives a picture, (600, 800, 3), of the object, the last
    probe's rays, all contacts with the normals felt, and the leading rivals as ghosts; `human`
    shows it in a window after each step.

    ## Arguments
    | name | default | meaning |
    |---|---|---|
    | library | None | names of stand-ins, models, or a folder of meshes; None: all stand-ins |
    | object_name | None | always this object; None: drawn at reset |
    | placement | across | "across", "resting" or "dropped" |
    | free | False | whether a standing object moves when it is pushed |
    | mass | None | of a free object, kilograms; None: that of its volume in water |
    | friction | None | between a free object and the plane; None: 0.5 |
    | radius | 0.002 | of the tip, metres |
    | force_threshold | None | at which the finger stops, newtons; None: at first contact |
    | position_error | 0.000254 | bound on positions, metres (0.01 in) |
    | normal_error | pi / 10 | bound on normals, radians |
    | distribution | uniform | of the noise inside its bounds: "uniform" or "gaussian" |
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

    def __init__(
        self,
        library: LibrarySource = None,
        *,
        object_name: str | None = None,
        placement: Literal["across", "resting", "dropped"] = "across",
        free: bool = False,
        mass: float | None = None,
        friction: float | None = None,
        radius: float = 0.002,
        force_threshold: float | None = None,
        position_error: float = 0.01 * INCH,
        normal_error: float = np.pi / 10.0,
        distribution: Distribution = "uniform",
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
            ValueError: as `ProbeEnv` does.
        """
        super().__init__(
            library,
            object_name=object_name,
            placement=placement,
            free=free,
            mass=mass,
            friction=friction,
            sensor="finger",
            radius=radius,
            force_threshold=force_threshold,
            position_error=position_error,
            normal_error=normal_error,
            distribution=distribution,
            use_free_space=use_free_space,
            max_probes=max_probes,
            hypotheses_shown=hypotheses_shown,
            samples_shown=samples_shown,
            tolerance=tolerance,
            limits=limits,
            render_mode=render_mode,
        )
