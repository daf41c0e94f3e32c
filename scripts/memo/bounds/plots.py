"""The figure of the memo's Section 6: formulas and counts against the level of the tree."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ...report.drawing import COLOURS, COLUMNS, FAINT, in_style, panels_of, svg_of
from .counts import COUNTERS, LEVELS, SHAPES, Shape, make_shape

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Floats = NDArray[np.float64]

FORMULA_LINES = {
    "n^k": ("#b0b0b0", "-", "n^k, all there are"),
    "Proposition 1": ("#000000", "-", "Proposition 1"),
    "corollary": (COLOURS[1], "--", "corollary as printed"),
    "mended": (COLOURS[4], "-.", "corollary, mended"),
}
"""Colour, line and name of each formula."""
COUNTER_MARKS = {
    "chain of middles": (COLOURS[3], "v"),
    "chain of ranges": (COLOURS[5], "^"),
    "all distances": (COLOURS[0], "o"),
    "all constraints": (COLOURS[2], "s"),
}
"""Colour and mark of each count."""


@in_style
def draw_nodes(nodes: Mapping[str, Floats]) -> str:
    """Formulas and counts against the level, a panel an object.

    Returns:
        The drawing as SVG.
    """
    # One panel more, for the legend.
    figure, (*panels, legend) = panels_of(len(SHAPES) + 1, (2.4, 2.1))
    for panel, name in zip(panels, SHAPES, strict=True):
        _draw_object(panel, make_shape(name), nodes[name])
    for panel in panels[::COLUMNS]:
        panel.set_ylabel("interpretations")
    for panel in panels[-COLUMNS:]:
        panel.set_xlabel("level")
    legend.set_axis_off()
    handles, labels = panels[0].get_legend_handles_labels()
    legend.legend(handles, labels, loc="upper left", frameon=False)
    return svg_of(figure)


def _draw_object(panel: Axes, shape: Shape, counted: Floats) -> None:
    levels = np.arange(1, LEVELS + 1)
    for name, formula in shape.formulas().items():
        colour, line, label = FORMULA_LINES[name]
        panel.plot(levels, formula, color=colour, linestyle=line, label=label)
    for name, means in zip(COUNTERS, counted.mean(axis=0), strict=True):
        colour, mark = COUNTER_MARKS[name]
        panel.plot(
            levels, means, f"{mark}-", color=colour, markersize=3.5, linewidth=0.7, label=name
        )
    panel.set(title=f"{shape.model.name}: {shape.described}", yscale="log")
    panel.set_xticks(levels)
    panel.grid(color=FAINT, linewidth=0.6)
