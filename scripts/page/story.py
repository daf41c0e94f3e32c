"""What a page shows: a story of touches, step by step, as values that become one JSON document.

Lengths are metres, poses model to world, all in the frame of the contacts. The story knows neither
a simulator nor a browser: `story_episode` and `story_contacts` tell one, `page` shows it.
"""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ...recognizer import Belief, Contacts, Polyhedron
from ...recognizer.advice.verdict import verdict
from .story_rivals import Rival, rivals_of
from .story_tree import tree_document
from .tree_count import CUTS, TreeCount, count_branches

__all__ = ["HIT", "MISSED", "OTHER", "Moment", "Story", "Ways"]

Floats = NDArray[np.float64]

HIT, MISSED, OTHER = 0, 1, 2
"""What a way met: the object, nothing, or something else (the plane)."""
MOST_TRIANGLES = 60_000
"""Of all models together; of a larger one only the edges are drawn."""


@dataclass(frozen=True, eq=False)
class Ways:
    """What a probe swept."""

    starts: Floats
    """(r, 3) where each way is drawn from."""
    ends: Floats
    """(r, 3) where it ended."""
    met: NDArray[np.int8]
    """(r,) `HIT`, `MISSED` or `OTHER`."""

    @classmethod
    def none(cls) -> Ways:
        """No way at all."""
        return cls(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0, np.int8))


@dataclass(frozen=True, eq=False)
class Moment:
    """What was so after a touch; the first moment of a story is before any."""

    title: str
    told: str
    """A line on what it met."""
    ways: Ways
    contacts: Contacts
    """All that counted after it, oldest first."""
    new: int
    """How many of them, the last ones, it added."""
    belief: Belief | None
    """None before the first contact, and where it wasn't worked out."""
    T_world_truth: Floats | None = None
    """(4, 4) where the object truly lay then; None where nobody knows."""

    @cached_property
    def trees(self) -> tuple[TreeCount, ...] | None:
        """The trees of its belief, counted; None without one."""
        return None if self.belief is None else count_branches(self.belief)


@dataclass(frozen=True, eq=False)
class Story:
    """A story of touches."""

    title: str
    subtitle: str
    models: tuple[Polyhedron, ...]
    """The library."""
    moments: tuple[Moment, ...]
    ending: tuple[str, str] = ("", "")
    """What came of it, and a line below; empty while it goes on."""
    truth: str | None = None
    """The name of what was truly touched, in simulation."""
    plane: float | None = None
    """Height of the plane that is drawn."""
    unit: tuple[str, float] = ("mm", 1e-3)
    """The unit of length that is told, and how many metres it is."""

    def document(self) -> dict[str, object]:
        """The story as the page reads it."""
        rivals = rivals_of([moment.belief for moment in self.moments])
        names = [model.name for model in self.models]
        shown = {rival.object_name for rival in rivals} | {self.truth}
        # The largest go without surfaces first.
        by_size = sorted(self.models, key=lambda model: len(model.triangles))
        sizes = np.cumsum([len(model.triangles) for model in by_size])
        whole = {m.name for m, size in zip(by_size, sizes, strict=True) if size <= MOST_TRIANGLES}
        return {
            "title": self.title,
            "subtitle": self.subtitle,
            "ending": list(self.ending),
            "unit": list(self.unit),
            "plane": self.plane,
            "cuts": list(CUTS),
            "objects": [
                _model_document(model, model.name in whole)
                if model.name in shown
                # Counted in the tree, but never seen.
                else {"name": model.name}
                for model in self.models
            ],
            "truth": None if self.truth is None else names.index(self.truth),
            "rivals": [_rival_document(rival, names) for rival in rivals],
            "steps": [_moment_document(moment, names) for moment in self.moments],
        }


def _model_document(model: Polyhedron, whole: bool) -> dict[str, object]:
    triangles = model.triangles if whole else np.zeros((0, 3))
    return {
        "name": model.name,
        "vertices": _packed(model.vertices, "<f4"),
        "triangles": _packed(triangles, "<u4"),
        "edges": _packed(model.edges, "<f4"),
    }


def _rival_document(rival: Rival, names: Sequence[str]) -> dict[str, object]:
    return {
        "object": names.index(rival.object_name),
        "born": rival.born,
        "died": rival.died,
        "weights": [_short(weight) for weight in rival.weights],
        "poses": [_matrix(pose) for pose in rival.poses],
        "open": list(rival.open),
    }


def _moment_document(moment: Moment, names: Sequence[str]) -> dict[str, object]:
    contacts, belief, ways = moment.contacts, moment.belief, moment.ways
    known = contacts.normal_error < np.pi
    listed = np.hstack([contacts.positions, np.where(known[:, None], contacts.normals, 0.0)])
    left = belief.hypotheses if belief else ()
    shares = [[one for one in left if one.object_name == name] for name in names]
    return {
        "title": moment.title,
        "told": moment.told,
        "ways": [
            [*_list(start), *_list(end), int(met)]
            for start, end, met in zip(ways.starts, ways.ends, ways.met, strict=True)
        ],
        "contacts": [_list(row) for row in listed],
        "new": moment.new,
        "verdict": "" if belief is None else verdict(belief).value,
        "hypotheses": None if belief is None else len(left),
        "interpretations": None if belief is None else belief.interpretations,
        "shares": [
            [index, len(own), _short(sum(one.weight for one in own))]
            for index, own in enumerate(shares)
            if own
        ],
        "tree": None if moment.trees is None else tree_document(moment.trees),
        "truth": None if moment.T_world_truth is None else _matrix(moment.T_world_truth),
    }


def _packed(values: NDArray[np.generic], kind: str) -> str:
    """Numbers as the browser reads them at once: little-endian, base 64."""
    return b64encode(np.ascontiguousarray(values, kind).tobytes()).decode()


def _matrix(pose: Floats) -> list[float]:
    """The upper three rows, one after the other."""
    return _list(pose[:3].ravel())


def _list(values: Floats) -> list[float]:
    # A micrometre, and a millionth of a turn's matrix, is finer than any screen.
    return [round(float(value), 6) for value in values]


def _short(value: float) -> float:
    return float(f"{value:.4g}")
