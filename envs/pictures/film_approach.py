"""The part of a film in which a probe's tips go along their rays."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..scene.scene import OBJECT
from ..sensors.touch import Touch
from .episode_picture import last_stretch
from .picture_scene import Tip

__all__ = ["FEW_RAYS", "Moment", "Timing", "approach", "seconds_of"]

Floats = NDArray[np.float64]

FEW_RAYS = 3
"""Up to which rays are taken one after the other, and stay in the picture to the probe's end."""
ALONG, ALONG_MANY, FEEL = 0.5, 1.2, 0.16
"""Seconds along a ray, along very many at once, and until what was felt has appeared."""
RAY_LENGTH, BOLT_LENGTH, STUB_LENGTH = 0.9, 0.3, 0.05
"""How much of a ray is shown: of few; of many, under way and where they touched nothing. In units
of the view's radius."""

Timing = Callable[[float], int]
"""How many pictures so many seconds have."""


@dataclass(frozen=True, eq=False)
class Moment:
    """Where a probe's tips are, and what it has felt so far.

    Attributes:
        rays_world: ``(r, 2, 3)`` the rays that are done, as far as they are shown.
        ray_hits: ``(r,)`` whether each ended on the object.
        tips: those under way.
        growth: ``(n,)`` of each of the probe's contacts: 0 not felt yet, 1 plain to see.
    """

    rays_world: Floats
    ray_hits: NDArray[np.bool_]
    tips: tuple[Tip, ...]
    growth: Floats


def seconds_of(touch: Touch) -> float:
    """How long a probe's approach takes, if nothing is hurried."""
    return (_along(touch) + FEEL) * len(_groups(touch))


def approach(touch: Touch, unit: float, timing: Timing) -> Iterator[Moment]:
    """The moments of a probe's approach, in order.

    Args:
        touch: what the probe reported.
        unit: the view's radius, metres.
        timing: how many moments there are in a time.
    """
    shown = last_stretch(touch, RAY_LENGTH * unit)
    felt_by = _rays_of_contacts(touch)
    done = np.zeros(len(shown), bool)
    growth = np.zeros(len(touch.contacts))
    for rays in _groups(touch):
        tips: tuple[Tip, ...] = ()
        for share in _slowing(timing(_along(touch))):
            tips = tuple(_tip(touch, shown[ray], share, unit) for ray in rays)
            yield Moment(*_lines(touch, shown, done, unit), tips, growth)
        done = done | np.isin(np.arange(len(shown)), rays)
        felt = np.isin(felt_by, rays)
        for share in np.linspace(0.0, 1.0, timing(FEEL) + 1)[1:] if felt.any() else ():
            growth = np.where(felt, share, growth)
            yield Moment(*_lines(touch, shown, done, unit), tips, growth)
    yield Moment(*_lines(touch, shown, done, unit), (), np.ones(len(touch.contacts)))


def _along(touch: Touch) -> float:
    return ALONG if len(touch.outcomes) <= FEW_RAYS else ALONG_MANY


def _groups(touch: Touch) -> list[list[int]]:
    """Which rays are taken together: each by itself, or all of very many."""
    rays = list(range(len(touch.outcomes)))
    return [[ray] for ray in rays] if len(rays) <= FEW_RAYS else [rays]


def _slowing(count: int) -> Floats:
    """How far along the way a tip is in each of ``count`` moments; it gets slower at the end."""
    return 1.0 - (1.0 - np.linspace(0.0, 1.0, count + 1)[1:]) ** 1.5


def _tip(touch: Touch, path: Floats, share: float, unit: float) -> Tip:
    way = path[1] - path[0]
    place = path[0] + share * way
    behind = share
    if len(touch.outcomes) > FEW_RAYS:
        behind = min(share, BOLT_LENGTH * unit / max(float(np.linalg.norm(way)), 1e-12))
    radius = float(touch.free_space.radius.max(initial=0.0))
    return Tip(np.stack([place - behind * way, place]), radius)


def _lines(
    touch: Touch, shown: Floats, done: NDArray[np.bool_], unit: float
) -> tuple[Floats, NDArray[np.bool_]]:
    """The rays that are done, and whether they hit; of very many only where they hit nothing."""
    hits = touch.outcomes == OBJECT
    if len(shown) <= FEW_RAYS:
        return shown[done], hits[done]
    return last_stretch(touch, STUB_LENGTH * unit)[done & ~hits], np.zeros(
        (done & ~hits).sum(), bool
    )


def _rays_of_contacts(touch: Touch) -> NDArray[np.int64]:
    """(n,) the ray that felt each contact; the last one where that isn't told."""
    hits = np.flatnonzero(touch.outcomes == OBJECT)
    if len(hits) == len(touch.contacts):
        return hits
    return np.full(len(touch.contacts), len(touch.outcomes) - 1)
