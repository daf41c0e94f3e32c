"""One trial of the memo's experiments in space: contacts in, counts at each stage out."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from itertools import chain
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from ...assets import memo
from .coarse import MemoPoses, memo_poses
from .groups import count_transforms
from .plan import Plan, Trials, run_rows

if TYPE_CHECKING:
    from ...envs.sensors.grid import TrueContacts
    from ...envs.sensors.noise import SensorNoise
    from ...recognizer import Contacts, PairTables, Polyhedron
    from ...recognizer.poses.entry import SolidEntry
    from ...recognizer.poses.fits.pose import Poses

Stage = Literal["tree", "test", "memo"]
"""How far to go: the tree alone, the model test and transforms too, the memo's own test besides."""


@dataclass(frozen=True)
class Spec:
    """An object, and bounds on what is measured of it."""

    object_name: str
    pi_over: int
    """The bound on normals is pi over this, radians."""
    position_error_in: float
    """The bound on positions, inches."""

    @classmethod
    def of(cls, row: memo.CountRow | memo.ClusterRow | memo.PoseErrorRow | memo.Timing) -> Spec:
        """What a row of the memo's is about."""
        return cls(row.object_name, row.pi_over, row.position_error_in)

    @property
    def key(self) -> tuple[str, str, str]:
        """As shown."""
        return self.object_name, f"π/{self.pi_over}", f"{self.position_error_in:.2f} in"

    @property
    def levels(self) -> tuple[float, float]:
        """Where it stands on the axes of noise."""
        return 1.0 / self.pi_over, self.position_error_in

    def noise(self) -> SensorNoise:
        """The bounds in metres and radians."""
        from .noise import noise_of

        return noise_of(self.pi_over, self.position_error_in)


Staged = Trials[tuple[Spec, Stage]]
"""Trials of a row, and how far to go."""


@dataclass(frozen=True)
class TrialCounts:
    """What one trial left at each stage."""

    contacts: int
    pruned: int
    """Interpretations that the tree left."""
    kept: bool
    """Whether the right one is among what the last stage left."""
    complete: bool
    """Whether the tree was searched to its end."""
    tested: int = 0
    """Interpretations that the model test left."""
    directions: int = 0
    """Distinct directions of rotation: the memo's transforms."""
    shifted: tuple[int, ...] = ()
    """Distinct directions of rotation and translations, for each of `SHIFT_TOLERANCES_IN`."""
    poses: tuple[int, ...] = ()
    """Distinct poses by the angle between rotations and the distance of centroids, likewise."""
    memo_poses: MemoPoses | None = None
    """The poses that the memo's own method gives what the tree left."""


@dataclass(frozen=True, eq=False)
class Prepared:
    """An object with what is built of it once."""

    entry: SolidEntry

    @property
    def model(self) -> Polyhedron:
        """The object."""
        return self.entry.model

    @property
    def tables(self) -> PairTables:
        """Its range tables."""
        return self.entry.tables

    def test(self, interpretations: NDArray[np.int32], contacts: Contacts) -> Poses:
        """The model test: those of some interpretations that a pose satisfies, with one each."""
        from ...recognizer import Constraints, PoseTolerance, SearchLimits
        from ...recognizer.poses.pose_search import Aim, test_interpretations

        tolerance, error = PoseTolerance(), float(contacts.position_error.max())
        shift = tolerance.distance(self.model.diameter, error)
        aim = Aim(Constraints(), SearchLimits(), tolerance.rotation, shift)
        return test_interpretations(self.entry, interpretations, contacts, aim)


@cache
def prepared(object_name: str) -> Prepared:
    """An object of the library, once a process."""
    from ...envs.library import load_library
    from ...recognizer.poses.entry import SolidEntry

    model = next(model for model in load_library() if model.name == object_name)
    return Prepared(SolidEntry.of(model, edges=False, folder=None))


def run_stages(
    plan: Plan,
    stages: Mapping[Spec, Stage],
    trials: int,
    run: Callable[[Staged], list[TrialCounts]],
    label: str,
) -> dict[Spec, list[TrialCounts]]:
    """The trials of each row, each as far as it is to go."""
    found = run_rows(plan, stages.items(), trials, run, label)
    return {spec: [*chain.from_iterable(pieces)] for (spec, _), pieces in found.items()}


def count_stages(
    object_name: str, truth: TrueContacts, contacts: Contacts, stage: Stage
) -> TrialCounts:
    """Prune the tree and, if asked for, test and group what is left of it."""
    from ...recognizer.tree.tree import prune

    thing = prepared(object_name)
    left = prune(thing.tables, contacts)
    kept = bool((left.faces == truth.faces).all(axis=1).any())
    if stage == "tree":
        return TrialCounts(len(contacts), len(left.faces), kept, left.complete)
    poses = thing.test(left.faces, contacts)
    kept = bool((poses.faces == truth.faces).all(axis=1).any())
    return TrialCounts(
        len(contacts),
        len(left.faces),
        kept,
        left.complete,
        len(poses),
        *count_transforms(poses, thing.model.centroid),
        memo_poses(thing.model, left.faces, truth.faces, contacts) if stage == "memo" else None,
    )
