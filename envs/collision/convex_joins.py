"""Putting convex parts together where they are convex together."""

from __future__ import annotations

from collections import deque
from itertools import combinations, count

import numpy as np
from numpy.typing import NDArray

from .hull import Hull


def joined(hulls: list[Hull], slack: float) -> list[Hull]:
    """Convex parts of the same union, fewer if possible; the largest ones are joined first.

    Args:
        hulls: convex parts with no volume in common.
        slack: how far corners may be off a common plane, metres.
    """
    numbers = count()
    parts = {next(numbers): hull for hull in sorted(hulls, key=lambda hull: -hull.volume)}
    waiting = deque(combinations(parts, 2))
    while waiting:
        one, other = waiting.popleft()
        if one not in parts or other not in parts:
            continue
        union = _together(parts[one], parts[other], slack)
        if union is not None:
            del parts[one], parts[other]
            number = next(numbers)
            waiting.extendleft((number, part) for part in reversed(parts))
            parts[number] = union
    return list(parts.values())


def _together(one: Hull, other: Hull, slack: float) -> Hull | None:
    """The hull of two convex parts that have a facet in common, if it holds nothing else.

    Below all planes of both but that of the common facet lies, on either side of that one, no more
    than the part on that side. So if all corners are below them, their hull is the union.
    """
    apart = np.maximum(
        one.corners.min(axis=0) - other.corners.max(axis=0),
        other.corners.min(axis=0) - one.corners.max(axis=0),
    )
    if apart.max() > slack:
        return None
    over_one, over_other = one.heights(other.corners), other.heights(one.corners)
    common_of_one = _common(over_one, slack)
    common_of_other = _common(over_other, slack)
    if common_of_one is None or common_of_other is None:
        return None
    rest_of_one = np.delete(over_one, common_of_one, axis=1)
    rest_of_other = np.delete(over_other, common_of_other, axis=1)
    if max(rest_of_one.max(), rest_of_other.max()) > slack:
        return None
    return Hull.around(np.concatenate([one.corners, other.corners]), slack)


def _common(heights: NDArray[np.float64], slack: float) -> int | None:
    """The plane that a part stands on: all its corners are above it, three or more of them on it.

    Args:
        heights: (n, p) of the part's corners above each plane of another, metres.
        slack: how far off the plane they may be, metres.
    """
    standing = (heights.min(axis=0) >= -slack) & ((heights <= slack).sum(axis=0) >= 3)
    return int(standing.argmax()) if standing.any() else None
