"""The rivals of a story: hypotheses followed from touch to touch until one rules them out.

A hypothesis goes on as long as some hypothesis of the next belief extends one of its
interpretations; of several that do, the heaviest is the same rival and the others are new ones.
Where contacts have changed, because the object moved, the likest pose goes on.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ...recognizer import Belief, Hypothesis, pose_difference

__all__ = ["MOST_SHOWN", "Rival", "rivals_of"]

MOST_SHOWN = 9
"""Rivals in one picture."""
MOST_FOLLOWED = 1000
"""Hypotheses of one belief that are looked at, the heaviest."""
WINNERS = 3
"""Rivals that are left at the end and are therefore shown from their first step on."""
LIKE = (0.2, 0.2)
"""How far a rival may move with its object and still be the same: radians, and diameters."""

Floats = NDArray[np.float64]


@dataclass(eq=False)
class Rival:
    """A hypothesis over the steps of its life."""

    object_name: str
    born: int
    """The step after which it is there."""
    died: int | None = None
    """The step that ruled it out; None if it is left."""
    poses: list[Floats] = field(default_factory=list)
    """(4, 4) model to world, one a step of its life."""
    weights: list[float] = field(default_factory=list)
    open: list[bool] = field(default_factory=list)
    """Whether the pose was one example of many."""

    def live(self, hypothesis: Hypothesis) -> None:
        """Go on for a step as this hypothesis."""
        self.poses.append(hypothesis.T_world_object)
        self.weights.append(hypothesis.weight)
        self.open.append(not hypothesis.determined)


def rivals_of(beliefs: Sequence[Belief | None]) -> tuple[Rival, ...]:
    """The rivals to show of a story's beliefs, one a step.

    At most `MOST_SHOWN` are there at any step: first those left at the end, then those shown
    before, then of each object in turns the heaviest.
    """
    lives = _lives(beliefs)
    chosen: list[Rival] = []
    if beliefs:
        last = [rival for rival in lives[-1] if rival is not None]
        chosen = last[:WINNERS]
    for step, there in enumerate(lives):
        shown = [rival for rival in there if rival in chosen]
        newcomers = [rival for rival in there if rival.born == step and rival not in chosen]
        others = [rival for rival in there if rival.born < step and rival not in chosen]
        free = max(MOST_SHOWN - len(shown), 0)
        for rival in _in_turns([*newcomers, *others])[:free]:
            # One that was there already, but hidden, appears now.
            late = step - rival.born
            rival.born = step
            del rival.poses[:late], rival.weights[:late], rival.open[:late]
            chosen.append(rival)
    return tuple(sorted(chosen, key=lambda rival: rival.born))


def _lives(beliefs: Sequence[Belief | None]) -> list[list[Rival]]:
    """Of each step all rivals alive after it, heaviest first."""
    lives: list[list[Rival]] = []
    before: Belief | None = None
    for step, belief in enumerate(beliefs):
        old = lives[-1] if lives else []
        if belief is None or belief is before:
            # Nothing new was learnt, or nobody worked it out: all go on as they were.
            lives.append(old)
            for rival in old:
                _repeat(rival)
            continue
        now: list[Rival] = []
        heirs = set()
        parents = _parents(before, belief) if before is not None else {}
        for index, hypothesis in enumerate(belief.hypotheses[:MOST_FOLLOWED]):
            parent = parents.get(index)
            if parent is None or parent in heirs or parent >= len(old):
                rival = Rival(hypothesis.object_name, step)
            else:
                rival = old[parent]
                heirs.add(parent)
            rival.live(hypothesis)
            now.append(rival)
        alive = set(map(id, now))
        for rival in old:
            if id(rival) not in alive:
                rival.died = step
        lives.append(now)
        before = belief
    return lives


def _repeat(rival: Rival) -> None:
    rival.poses.append(rival.poses[-1])
    rival.weights.append(rival.weights[-1])
    rival.open.append(rival.open[-1])


def _parents(before: Belief, after: Belief) -> dict[int, int]:
    """Of hypotheses of the later belief, by number, that of the earlier one it comes from."""
    first = len(before.contacts)
    same = first <= len(after.contacts) and np.array_equal(
        before.contacts.positions, after.contacts.positions[:first]
    )
    if not same:
        return _likest(before, after)
    owners = {
        (hypothesis.object_name, row.tobytes()): index
        for index, hypothesis in enumerate(before.hypotheses[:MOST_FOLLOWED])
        for row in hypothesis.interpretations
    }
    found = {}
    for index, hypothesis in enumerate(after.hypotheses[:MOST_FOLLOWED]):
        for row in hypothesis.interpretations:
            owner = owners.get((hypothesis.object_name, row[:first].tobytes()))
            if owner is not None:
                found[index] = owner
                break
    return found


def _likest(before: Belief, after: Belief) -> dict[int, int]:
    models = {model.name: model for model in after.library.models}
    found = {}
    for index, one in enumerate(after.hypotheses[:MOST_SHOWN]):
        model = models[one.object_name]
        least = 1.0
        for number, other in enumerate(before.hypotheses[:MOST_SHOWN]):
            if other.object_name == one.object_name:
                error = pose_difference(model, one.pose, other.pose)
                far = max(
                    float(error.rotation) / LIKE[0],
                    float(error.translation) / (LIKE[1] * model.diameter),
                )
                if far < least:
                    least, found[index] = far, number
    return found


def _in_turns(rivals: Sequence[Rival]) -> list[Rival]:
    """Of each object the first, then of each the second, and so on."""
    queues: dict[str, list[Rival]] = {}
    for rival in rivals:
        queues.setdefault(rival.object_name, []).append(rival)
    longest = max(map(len, queues.values()), default=0)
    return [
        queue[rank] for rank in range(longest) for queue in queues.values() if rank < len(queue)
    ]
