"""Figures of the memo's Table V: mean errors by row, and where the direction is singular."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ....assets.memo import PoseErrorRow
from ...report.drawing import COLOURS, FAINT, in_style, panels_of, svg_of
from ..trial import Spec
from .judge import COLUMNS, NAMES, means, printed, standard_errors
from .trials import DIRECTION, METHODS, WHOLE, Errors

METHOD_COLOURS = dict(zip(METHODS, (COLOURS[1], COLOURS[0]), strict=True))
MEMO_MARKS: dict[bool, dict[str, Any]] = {
    True: {"color": "#000000", "label": "memo"},
    False: {"color": "#8a8a8a", "label": "memo, print damaged"},
}
"""How the memo's figures are drawn, whether they can be read for sure or not."""


@in_style
def draw_means(rows: Sequence[PoseErrorRow], errors: Sequence[Errors]) -> str:
    """Mean errors by row: the memo's, its method's and the joint fit's; a panel a figure.

    Returns:
        The drawing as SVG.
    """
    figure, panels = panels_of(len(NAMES), (3.0, 0.2 + 0.27 * len(rows)), sharey=True)
    heights = np.arange(len(rows))
    for place, (panel, name, column) in enumerate(zip(panels, NAMES, COLUMNS, strict=True)):
        for method, marker, drop in zip(METHODS, "so", (0.14, 0.28), strict=True):
            values = np.array([means(error.by_method[method])[column] for error in errors])
            wide = [1.96 * standard_errors(error.by_method[method])[column] for error in errors]
            # An interval that reaches below zero would leave a logarithmic axis.
            reach = np.minimum(np.nan_to_num(wide, posinf=0.0), 0.9 * values)
            panel.errorbar(
                values,
                heights + drop,
                xerr=reach,
                fmt=marker,
                color=METHOD_COLOURS[method],
                markersize=3.5,
                elinewidth=0.8,
                label=f"{method}, here",
            )
        for sure, shown in MEMO_MARKS.items():
            chosen = [number for number, row in enumerate(rows) if row.sure == sure]
            values = [printed(rows[number])[place] for number in chosen]
            panel.plot(values, heights[chosen], "x", markersize=4.5, **shown)
        panel.set(title=name, xscale="log", ylim=(len(rows) - 0.4, -0.6))
        panel.xaxis.set_major_formatter("{x:g}")
        panel.grid(axis="x", color=FAINT, linewidth=0.6)
        panel.set_axisbelow(True)
    panels[0].set_yticks(heights, [", ".join(Spec.of(row).key) for row in rows])
    handles, names = panels[0].get_legend_handles_labels()
    figure.legend(handles, names, loc="outside lower center", ncols=len(names), frameon=False)
    return svg_of(figure)


@in_style
def draw_singularity(errors: Sequence[Errors]) -> str:
    """Errors of the memo's direction and whole rotation against the angle of the true rotation.

    Returns:
        The drawing as SVG.
    """
    figure, panels = panels_of(2, (3.25, 2.0), sharey=True)
    angles = np.concatenate([error.angles for error in errors])
    found = np.concatenate([error.by_method[METHODS[0]] for error in errors])
    shown = ((panels[0], DIRECTION, "direction"), (panels[1], WHOLE, "whole rotation"))
    for panel, column, title in shown:
        # As pixels: a thousand dots are a large drawing.
        panel.plot(
            angles,
            found[:, column],
            ".",
            markersize=2,
            color=METHOD_COLOURS[METHODS[0]],
            alpha=0.5,
            rasterized=True,
        )
        panel.set(title=title, xlabel="angle of the true rotation, °", xlim=(0, 180))
        panel.set_xticks(range(0, 181, 30))
        panel.grid(color=FAINT, linewidth=0.6)
    panels[0].set(yscale="log", ylabel="error, °")
    panels[0].yaxis.set_major_formatter("{x:g}")
    return svg_of(figure)
