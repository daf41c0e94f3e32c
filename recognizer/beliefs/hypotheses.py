"""Hypotheses: interpretations that place the object alike are one (memo, end of Section 3).

The memo counts poses by the direction of their rotation axis, which is singular near angles 0 and
pi; here two poses are compared by the angle of the rotation between them and by the distance of
their centroids, up to the object's own symmetries.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import RigidTransform

from ..models.polyhedron import Polyhedron
from ..models.prism import Prism
from ..poses.fits.pose import Poses
from .hypothesis_kernels import weigh_poses

Floats = NDArray[np.float64]

ROUNDED = 4
"""Decimals that the order of hypotheses looks at: of a weight's logarithm and of a pose. A best fit
ends with its misfit's last digits, which leaves half as many of the pose, and a few to spare."""

ACROSS = (0, 1, 5)
"""Of small motions: the two turns and the shift that leave the plane."""
HELD = 1e-3
"""What is left of a motion that is held, as a share of what counts as fixed."""


@dataclass(frozen=True, kw_only=True)
class PoseTolerance:
    """When two poses count as the same."""

    rotation: float = np.radians(3.0)
    """Largest rotation between them, radians."""
    translation: float = 0.01
    """Largest distance between their centroids, as a share of the object's diameter, ..."""
    position_errors: float = 2.0
    """... or this many bounds on position, whichever is more."""

    def __post_init__(self) -> None:
        for name in ("rotation", "translation", "position_errors"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"{name} is {getattr(self, name)}; it must be above zero")

    def distance(self, diameter: float, position_error: float) -> float:
        """Largest distance between centroids, metres."""
        return max(self.translation * diameter, self.position_errors * position_error)


@dataclass(frozen=True, eq=False, repr=False)
class Hypothesis:
    """An object at a pose, as some interpretations of the contacts have it."""

    object_name: str
    T_world_object: Floats
    """(4, 4) `pose` as a matrix."""
    weight: float
    """Share of the belief, between 0 and 1."""
    interpretations: NDArray[np.int32]
    """(k, n) a face of the object for each contact, best fit first."""
    freedoms: Floats
    """(d, 6) motions that the contacts leave open beyond the pose tolerance, d = 0 if none:
    orthonormal rows of rotation about the centroid (times half the diameter) and shift, in the
    object's frame. Along them ``pose`` is one example of many. Beside other hypotheses this is
    what least squares say; of one that is left alone all poses are looked at, see `extent`."""
    covariance: Floats
    """(6, 6) of the pose, in the same motions, square metres: a local approximation by the least
    squares of its best interpretation, with half a turn and half a diameter known beforehand."""
    proven: bool = True
    """Whether ``pose`` meets every bound; if not, no such pose was found and none excluded."""
    farthest_turn: float = np.inf
    """No pose that it stands for is turned from ``pose`` by more, radians, but for the object's own
    symmetries."""
    farthest_shift: float = np.inf
    """Of none is the object's centroid farther away, metres."""

    def __getstate__(self) -> dict[str, Any]:
        # SciPy normalises a pickled pose anew, which changes its last bits; it is made again.
        return {name: value for name, value in self.__dict__.items() if name != "pose"}

    @cached_property
    def pose(self) -> RigidTransform:
        """Model to world; the best fit among its interpretations.

        Of a hypothesis left alone it may be the middle of its poses instead. It is within every
        bound if `proven`. Of poses that differ by a symmetry of the object only one is reported.
        """
        return RigidTransform.from_matrix(self.T_world_object)

    def ranked(self, weight: float, order: NDArray[np.intp]) -> Hypothesis:
        """The same with a weight, and with the contacts of its interpretations in an order."""
        hypothesis = object.__new__(Hypothesis)  # hundreds at a time: `replace` takes longer
        hypothesis.__dict__.update(self.__dict__)
        hypothesis.__dict__["weight"] = weight
        hypothesis.__dict__["interpretations"] = self.interpretations[:, order]
        return hypothesis

    def __repr__(self) -> str:
        x, y, z = self.T_world_object[:3, 3]
        state = "fixed" if self.determined else "open"
        return (
            f"<Hypothesis: {self.object_name} at ({x:.4g}, {y:.4g}, {z:.4g}) m, {state},"
            f" weight {self.weight:.3g}, {len(self.interpretations)} interpretations>"
        )

    @property
    def determined(self) -> bool:
        """Whether the contacts fix all six freedoms."""
        return len(self.freedoms) == 0


def cluster(
    model: Polyhedron | Prism, poses: Poses, tolerance: PoseTolerance, position_error: float
) -> tuple[list[Hypothesis], Floats]:
    """Group one object's poses into hypotheses.

    The weight of a group is the volume of poses it stands for: every pose within the bounds is
    equally likely under noise uniform in them and a uniform prior. An interpretation's volume is
    approximated locally, by the error ellipsoid of its fit, cut to half a turn and half a diameter
    along what is open, times ``exp(-misfit / 2)``: what bounds leave shrinks as they are strained,
    and a normal law of the readings' variances says by how much. Those of a group add up, once a
    symmetry of the object.

    Args:
        model: the object.
        poses: its surviving interpretations.
        tolerance: which poses count as the same.
        position_error: the largest bound on a position, metres.

    Returns:
        Hypotheses, and (h,) the logarithms of their weights, not yet normalised.
    """
    if not len(poses):
        return [], np.zeros(0)
    radius = model.diameter / 2.0
    most_shift = tolerance.distance(model.diameter, position_error)
    # Three standard deviations of each motion, against what the tolerance allows it: with bounded
    # noise hardly any fit is off by more.
    allowed = min(tolerance.rotation * radius, most_shift)
    prior, held = _known_before(model, radius, allowed)
    members, starts, matrices, covariances, log_weights, motions, loose, far = weigh_poses(
        (
            *(poses.rotations, poses.translations, poses.costs, poses.informations),
            *(poses.proven, poses.reaches),
        ),
        model.centroid,
        model.symmetries,
        prior,
        tolerance.rotation,
        most_shift,
        allowed,
    )
    # What is held has no volume.
    log_weights += 0.5 * np.log(prior[held]).sum()
    covariances[:, held] = covariances[:, :, held] = 0.0
    motions[:, held] = 0.0
    hypotheses = []
    for group, (start, end) in enumerate(pairwise(starts.tolist())):
        rows = members[start:end]
        hypotheses.append(
            Hypothesis(
                object_name=model.name,
                T_world_object=matrices[group],
                weight=1.0,
                interpretations=_distinct(poses.faces[rows]),
                freedoms=_open_motions(rows, loose, motions, poses.rotations),
                covariance=covariances[group],
                proven=bool(poses.proven[rows[0]]),
                farthest_turn=float(far[group, 0]),
                farthest_shift=float(far[group, 1]),
            )
        )
    return hypotheses, log_weights


def _known_before(
    model: Polyhedron | Prism, radius: float, allowed: float
) -> tuple[Floats, NDArray[np.intp]]:
    """(6,) information about each motion before the first touch, and which motions there are none.

    Half a turn and half a diameter are known of any; an outline is only moved in its plane, to a
    thousandth of what counts as fixed.
    """
    prior = np.repeat([1.0 / (np.pi * radius) ** 2, 1.0 / radius**2], 3)
    held = np.array(ACROSS if isinstance(model, Prism) else (), np.intp)
    prior[held] = (HELD * allowed) ** -2
    return prior, held


def canonical(
    hypotheses: Sequence[Hypothesis], weights: Floats, outliers: NDArray[np.int64]
) -> NDArray[np.intp]:
    """(h,) the order in which a belief lists its hypotheses.

    Fewer outliers first, then heavier, then by the object's name and by pose. Numbers are rounded,
    so that hypotheses of like weight stand in the same order on every processor, whatever its last
    digits.
    """
    if len(hypotheses) < 2:
        return np.arange(len(hypotheses))
    with np.errstate(divide="ignore"):
        heaviest = -np.round(np.log(weights), ROUNDED)
    names = np.array([hypothesis.object_name for hypothesis in hypotheses], dtype=str)
    poses = np.array([hypothesis.T_world_object for hypothesis in hypotheses])
    places = poses[:, :-1, -1]
    places /= max(np.abs(places).max(), np.finfo(np.float64).tiny)
    by_pose = np.round(poses.reshape(len(poses), -1), ROUNDED)
    return np.lexsort((*by_pose.T, names, heaviest, outliers))


def _distinct(rows: NDArray[np.int32]) -> NDArray[np.int32]:
    """Rows without those that were there before: an interpretation may have several components."""
    if len(rows) < 2:
        return rows
    _, first = np.unique(rows, axis=0, return_index=True)
    return rows[np.sort(first)]


def _open_motions(
    members: NDArray[np.intp], loose: NDArray[np.bool_], motions: Floats, rotations: Floats
) -> Floats:
    """(d, 6) what the first of a group leaves open, or else what one of its other members does.

    Any of them may be the true one, so that a pose is fixed only if each fixes it.
    """
    opened = members[loose[members].any(axis=1)]
    if not len(opened):
        return np.zeros((0, 6))
    first, member = members[0], opened[0]
    motions_member = motions[member].T[loose[member]]
    # In the first one's frame: members may be turned by a symmetry of the object.
    turn = np.eye(3) if member == first else rotations[member].T @ rotations[first]
    return (motions_member.reshape(-1, 2, 3) @ turn).reshape(-1, 6)
