"""Which outlines a planar environment draws from: the stand-ins, or the user's own."""

from __future__ import annotations

from collections.abc import Sequence

from ...assets.planar import PLANAR_NAMES, planar_corners
from ...recognizer import Polygon

OutlineSource = Sequence[str] | Sequence[Polygon] | None
"""Names of stand-ins, ready outlines, or None for all stand-ins."""


def load_outlines(source: OutlineSource = None) -> tuple[Polygon, ...]:
    """Load the outlines that a source names.

    Args:
        source: see `OutlineSource`.

    Raises:
        ValueError: an unknown name, or an empty library.
    """
    if source is None:
        source = PLANAR_NAMES
    if isinstance(source, str):
        raise ValueError(f"library is {source!r}; give a sequence of names, such as [{source!r}]")
    if not source:
        raise ValueError("the library is empty; name at least one outline")
    return tuple(
        item if isinstance(item, Polygon) else Polygon.from_corners(planar_corners(item), name=item)
        for item in source
    )
