"""The figures that AI Memo 738 prints, as data."""

from __future__ import annotations

import json
from dataclasses import dataclass
from importlib import resources


@dataclass(frozen=True)
class CountRow:
    """One row of a table of counts: least, median, 90th percentile and most of 100 runs."""

    object_name: str
    pi_over: int
    """The bound on normals is pi over this, radians."""
    position_error_in: float
    """The bound on positions, inches."""
    smallest: int
    median: int
    p90: int
    largest: int


def table2() -> tuple[CountRow, ...]:
    """Table II (Section 4.3): interpretations left by the tree, grid sensing, 12 to 20 points."""
    text = resources.files("palpate.assets").joinpath("memo738.json").read_text(encoding="utf-8")
    return tuple(CountRow(*row) for row in json.loads(text)["table2"]["rows"])
