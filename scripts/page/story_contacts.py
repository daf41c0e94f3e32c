"""The story of contacts that somebody else made, touch by touch, for a page to show."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ...recognizer import Belief, Contacts, FeltFile, FreeSpace, Recognizer, SearchLimits
from ...recognizer.advice.verdict import Verdict, verdict
from .episode_story import count
from .story import HIT, MISSED, Moment, Story, Ways

__all__ = ["Beliefs", "contacts_story"]

MOST_STEPS = 40
"""More touches are told several at a time."""
MOST_WITH_WAYS = 200
"""Interpretations of a belief of few touches beyond which the ways that were free don't count for
it, nor for those of fewer touches: each is held against every way, for up to 20 ms."""
MOST_INTERPRETATIONS, MOST_NODES, MOST_NODES_WITHOUT_NORMALS = 20_000, 400_000, 20_000
"""Of a belief of few touches, shared out evenly among the models of the library. One that needs
more is left out, and so are those of fewer touches; a node takes ten times as long where normals
are missing. Steps are counted and not timed, so that a page shows the same on every machine."""
WAY = 0.6
"""How much of a way is drawn, in diameters of the largest part."""

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Beliefs:
    """What the first touches of a file say, and what all do.

    Attributes:
        felt: the touches.
        final: the belief of all that was felt; None if nothing was touched.
        by_count: by how many contacts, what the first ones and the ways to them say, where it was
            worked out; without the ways that met nothing.
    """

    felt: FeltFile
    final: Belief | None
    by_count: dict[int, Belief]

    @classmethod
    def of(
        cls,
        felt: FeltFile,
        final: Belief | None,
        recognizer: Recognizer,
        earlier: Beliefs | None = None,
    ) -> Beliefs:
        """Work out what fewer contacts would have said, from the last one back.

        Few contacts allow much, which takes longer to find: what would take too long is left out.

        Args:
            felt: what was felt.
            final: the belief of it all.
            recognizer: that found it.
            earlier: of an earlier version of the file; what the contacts share is taken from it.
        """
        if final is None:
            return cls(felt, None, {})
        contacts, (ways, misses) = felt.contacts, _split_ways(felt)
        found = {} if len(misses) else {len(contacts): final}
        known = {}
        if earlier and earlier.final and earlier.final.support == final.support:
            known = _shared(earlier, contacts)
        limited, last = recognizer.limited(_limits(contacts, len(recognizer.models))), final
        for size in reversed(_halts(len(contacts))):
            if size in found or size <= final.outliers:
                continue
            if size in known:
                found[size] = known[size]
                continue
            if _nodes(last) > _most_nodes(contacts):
                break
            of_these = partial(
                limited.recognize,
                contacts[:size],
                outliers=final.outliers,
                support=final.support,
            )
            last = belief = of_these()
            if belief.complete and len(ways) and belief.interpretations <= MOST_WITH_WAYS:
                belief = of_these(free_space=_part(ways, slice(0, size)))
            else:
                ways = FreeSpace.none()
            if not belief.complete:
                break
            found[size] = belief
        return cls(felt, final, found)


def contacts_story(
    title: str,
    recognizer: Recognizer,
    beliefs: Beliefs,
    unit: tuple[str, float],
    *,
    ended: bool = True,
) -> Story:
    """Tell touches from a file.

    Args:
        title: above all.
        recognizer: of the library.
        beliefs: what was felt, and what it said.
        unit: its name, and how many metres it is.
        ended: whether no more will come.
    """
    felt, final = beliefs.felt, beliefs.final
    touches, misses = len(felt.contacts), _split_ways(felt)[1]
    length = WAY * max(model.diameter for model in recognizer.models)
    moments, last = [_untouched()], 0
    for size in _halts(touches):
        moments.append(_moment(beliefs, last, size, length))
        last = size
    if len(misses) and touches:
        starts, ends = _passing(misses, felt.contacts.positions.mean(axis=0), 2.0 * length)
        shown = Ways(starts, ends, np.full(len(misses), MISSED, np.int8))
        told = f"{count(len(misses), 'way')} on which nothing was touched"
        moments.append(Moment("What met nothing", told, shown, felt.contacts, 0, final))
    among = f"{count(touches, 'touch', 'touches')}, {len(recognizer.models)} parts in the library"
    support = final.support if final else None
    return Story(
        title=title,
        subtitle=among if ended else f"{among}; waiting for the next touch",
        models=recognizer.models,
        moments=tuple(moments),
        ending=_ending(final, among) if ended and final else ("", ""),
        plane=support.height if support else None,
        unit=unit,
    )


def _untouched() -> Moment:
    nothing = Contacts.none()
    told = "every part at every pose is possible"
    return Moment("Before the first touch", told, Ways.none(), nothing, 0, None)


def _ending(belief: Belief, among: str) -> tuple[str, str]:
    found = belief.hypotheses
    said = {
        Verdict.UNKNOWN: "Not in this library",
        Verdict.UNIQUE: f"It is {found[0].object_name}" if found else "",
        Verdict.AMBIGUOUS: f"Ambiguous: {len(found)} poses fit alike",
        Verdict.UNDERDETERMINED: (
            f"{found[0].object_name}, but its pose is still open"
            if len(found) == 1
            else f"Underdetermined: {len(found)} ways to lie"
        ),
        Verdict.CUT_SHORT: "Cut short: too much fits",
    }
    return said[verdict(belief)], among


def _moment(beliefs: Beliefs, first: int, stop: int, length: float) -> Moment:
    felt, belief = beliefs.felt, beliefs.by_count.get(stop)
    ways, shown = _split_ways(felt)[0], Ways.none()
    if len(ways):
        ends = ways.ends[first:stop]
        starts = _cut(ways.starts[first:stop], ends, length)
        shown = Ways(starts, ends, np.full(len(ends), HIT, np.int8))
    lines = felt.rows[first:stop]
    where = f"line {lines[0]}" + (f" to {lines[-1]}" if len(lines) > 1 else "")
    title = f"Touch {stop}" if stop - first == 1 else f"Touches {first + 1} to {stop}"
    told = f"{where} of the file"
    if belief is None:
        told += "; not worked out, so much fits"
    elif len(ways) and not len(belief.free_space):
        told += "; the way there doesn't count yet"
    return Moment(title, told, shown, felt.contacts[:stop], stop - first, belief)


def _halts(touches: int) -> list[int]:
    """After how many touches the story halts."""
    return sorted({-(-touches * step // MOST_STEPS) for step in range(1, MOST_STEPS + 1)} - {0})


def _limits(contacts: Contacts, models: int) -> SearchLimits:
    """Of beliefs of few of these touches, in a library of so many models."""
    budget, nodes = MOST_INTERPRETATIONS // models, _most_nodes(contacts) // models
    return SearchLimits(budget=max(budget, 1), nodes=max(nodes, 1))


def _most_nodes(contacts: Contacts) -> int:
    known = bool((contacts.normal_error < np.pi).all())
    return MOST_NODES if known else MOST_NODES_WITHOUT_NORMALS


def _nodes(belief: Belief) -> int:
    return sum(search.nodes for search in belief.searches)


def _shared(earlier: Beliefs, contacts: Contacts) -> dict[int, Belief]:
    """Earlier beliefs that are of the first of these contacts."""
    most = min(len(earlier.felt.contacts), len(contacts))
    old, new = earlier.felt.contacts[:most], contacts[:most]
    differs = np.zeros(most, bool)
    for name in ("positions", "normals", "position_error", "normal_error", "approaches", "kinds"):
        unlike = getattr(old, name) != getattr(new, name)
        differs |= unlike.reshape(most, -1).any(axis=1) if most else False
    alike = int(np.append(np.flatnonzero(differs), most)[0])
    return {size: belief for size, belief in earlier.by_count.items() if size <= alike}


def _split_ways(felt: FeltFile) -> tuple[FreeSpace, FreeSpace]:
    """The ways to the contacts, one each or none at all, and those that met nothing."""
    paths = felt.free_space
    reached = len(paths) - felt.misses
    to_contacts = slice(0, reached if reached == len(felt.contacts) else 0)
    return _part(paths, to_contacts), _part(paths, slice(reached, len(paths)))


def _part(paths: FreeSpace, rows: slice) -> FreeSpace:
    return FreeSpace(
        paths.starts[rows], paths.ends[rows], radius=paths.radius[rows], error=paths.error[rows]
    )


def _cut(starts: Floats, ends: Floats, length: float) -> Floats:
    """Where the last stretch of each way begins."""
    along = ends - starts
    whole = np.linalg.norm(along, axis=1, keepdims=True)
    return ends - along * np.minimum(1.0, length / np.maximum(whole, 1e-12))


def _passing(ways: FreeSpace, place: Floats, length: float) -> tuple[Floats, Floats]:
    """The stretch of each way that is near a place: at most ``length`` before and after it."""
    along = ways.ends - ways.starts
    whole = np.maximum(np.linalg.norm(along, axis=1), 1e-12)
    nearest = ((place - ways.starts) * along).sum(axis=1) / whole
    first, last = (
        np.clip(at, 0.0, whole)[:, None] / whole[:, None]
        for at in (nearest - length, nearest + length)
    )
    return ways.starts + first * along, ways.starts + last * along
