"""Which hypotheses a picture shows beside the truth, and what became of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import islice

import numpy as np
from scipy.spatial.transform import RigidTransform

from ...recognizer import Belief, Hypothesis, Polyhedron, PoseTolerance, pose_difference
from .picture_scene import Ghost

__all__ = ["Likeness", "ghost_of", "leading_rivals"]

ALIKE = 2.0
"""How many times the pose tolerance two poses may differ by and still look the same."""


@dataclass(frozen=True, eq=False)
class Likeness:
    """Tells which hypotheses look the same.

    Attributes:
        library: the models, by name.
        tolerance: which poses count as the same.
        position_error: the largest bound on positions, metres.
    """

    library: dict[str, Polyhedron]
    tolerance: PoseTolerance
    position_error: float

    def any_alike(self, name: str, pose: RigidTransform, others: Sequence[Hypothesis]) -> bool:
        """Whether one of ``others`` is the object of this name at about this pose."""
        matrices = [other.T_world_object for other in others if other.object_name == name]
        if not matrices:
            return False
        model = self.library[name]
        poses = RigidTransform.from_matrix(np.array(matrices))
        shifts = poses.apply(model.centroid) - pose.apply(model.centroid)
        far = ALIKE * self.tolerance.distance(model.diameter, self.position_error)
        near = np.flatnonzero(np.linalg.norm(shifts, axis=1) < far)
        return any(
            pose_difference(model, pose, poses[int(row)]).rotation < ALIKE * self.tolerance.rotation
            for row in near
        )


def leading_rivals(
    belief: Belief | None, likeness: Likeness, truth: tuple[str, RigidTransform], count: int
) -> list[Hypothesis]:
    """Up to ``count`` hypotheses that aren't the truth: of each object the heaviest first.

    Args:
        belief: what is left; None for nothing known.
        likeness: tells what is the truth.
        truth: the object's name, and its pose, model to world.
        count: at most so many.
    """
    return list(islice(_leading(belief, likeness, truth), count))


def ghost_of(
    rival: Hypothesis,
    library: dict[str, Polyhedron],
    label: str,
    colour: int | None = None,
    opacity: float = 1.0,
) -> Ghost:
    """A hypothesis as a picture shows it."""
    model = library[rival.object_name]
    return Ghost(rival.pose.apply(model.vertices), model.triangles, label, colour, opacity)


def _leading(
    belief: Belief | None, likeness: Likeness, truth: tuple[str, RigidTransform]
) -> Iterator[Hypothesis]:
    queues: dict[str, list[Hypothesis]] = {}
    for hypothesis in belief.hypotheses if belief else ():
        queues.setdefault(hypothesis.object_name, []).append(hypothesis)
    # In turns, so that no object crowds out the others.
    for rank in range(max(map(len, queues.values()), default=0)):
        for queue in queues.values():
            if rank < len(queue) and not likeness.any_alike(*truth, [queue[rank]]):
                yield queue[rank]


@dataclass(frozen=True, eq=False)
class Shown:
    """A rival in the picture."""

    rival: Hypothesis
    colour: int
    """The number of its colour, which no other in the picture has."""


@dataclass(frozen=True, eq=False)
class Cast:
    """The rivals in the picture after a probe, and how they came to be there.

    Attributes:
        gone: those that the probe ruled out.
        stayed: those that were there before and still are.
        new: those that took the places of others.
        more: how many rivals are left that aren't shown.
    """

    gone: tuple[Shown, ...] = ()
    stayed: tuple[Shown, ...] = ()
    new: tuple[Shown, ...] = ()
    more: int = 0

    def next(
        self,
        belief: Belief | None,
        likeness: Likeness,
        truth: tuple[str, RigidTransform],
        places: int = 3,
    ) -> Cast:
        """The cast after a probe that left ``belief``; arguments as of `leading_rivals`."""
        left = belief.hypotheses if belief else ()
        shown = self.stayed + self.new
        alive = [
            likeness.any_alike(one.rival.object_name, one.rival.pose, left)
            # A moved object takes its rivals along, and one of them may have become the truth.
            and not likeness.any_alike(*truth, [one.rival])
            for one in shown
        ]
        stayed = tuple(one for one, lives in zip(shown, alive, strict=True) if lives)
        gone = tuple(one for one, lives in zip(shown, alive, strict=True) if not lives)
        free = [n for n in range(places) if n not in {one.colour for one in stayed}]
        kept = [one.rival for one in stayed]
        candidates = [
            rival
            for rival in leading_rivals(belief, likeness, truth, 2 * places)
            if not likeness.any_alike(rival.object_name, rival.pose, kept)
        ]
        new = tuple(Shown(*pair) for pair in zip(candidates, free, strict=False))
        true = int(likeness.any_alike(*truth, left))
        return Cast(gone, stayed, new, max(len(left) - true - len(stayed) - len(new), 0))
