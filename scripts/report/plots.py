"""A report's figures: vector drawings that can go into a paper, told apart without colour too."""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from .results import BASELINES, PolicyResult, SettingResult

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
"""Okabe and Ito's, but yellow: told apart with any colour vision."""
GREYS = {"random": "#9a9a9a", "random-hit": "#5f5f5f"}
LINES = ("-", "--", "-.", ":")
MARKERS = "osD^vPX<>*hp"
COLUMNS = 4
PANEL = (2.6, 2.2)
"""Width and height of a panel, inches."""
STYLE: dict[Any, Any] = {
    "font.size": 8.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlesize": 8.5,
    "axes.linewidth": 0.7,
    "lines.linewidth": 1.2,
    "pdf.fonttype": 42,
    "svg.hashsalt": "palpate",
}


def style_of(policies: Sequence[str]) -> dict[str, dict[str, Any]]:
    """Colour, line and marker of each strategy; baselines are grey."""
    styles: dict[str, dict[str, Any]] = {}
    others = [policy for policy in policies if policy not in BASELINES]
    for number, policy in enumerate(others):
        styles[policy] = {
            "color": COLOURS[number % len(COLOURS)],
            "linestyle": LINES[number // len(COLOURS) % len(LINES)],
            "marker": MARKERS[number % len(MARKERS)],
        }
    for policy in set(BASELINES) & set(policies):
        dashed = "--" if policy == "random" else "-"
        styles[policy] = {"color": GREYS[policy], "linestyle": dashed, "marker": "."}
    return styles


def draw_probes(results: Sequence[SettingResult]) -> Figure:
    """Mean probes to unique with intervals and, dotted, the floor; a panel a setting."""
    with _style():
        names = [result.policy for result in results[0].policies]
        styles = style_of(names)
        height = 0.6 + 0.17 * len(names)
        figure, panels = _panels(len(results), height, "probes to unique", sharey=True)
        most = max(one.mean.high for result in results for one in result.policies)
        for panel, result in zip(panels, results, strict=True):
            for row, one in enumerate(result.policies):
                style, mean = styles[one.policy], one.mean
                panel.plot([mean.low, mean.high], [row, row], color=style["color"])
                panel.plot(mean.value, row, style["marker"], color=style["color"], markersize=4)
            if result.floor is not None:
                panel.axvline(result.floor, color="#000000", linewidth=0.7, linestyle=":")
            panel.set(title=result.objects, xlim=(0.0, 1.05 * most), ylim=(len(names) - 0.5, -0.5))
            panel.set_yticks(range(len(names)), names)
            panel.grid(axis="x", color="#e4e4e4", linewidth=0.6)
            panel.set_axisbelow(True)
        return figure


def draw_unsolved(results: Sequence[SettingResult]) -> Figure:
    """Share of the episodes that aren't solved, against probes."""
    return _curves(results, lambda one: one.unsolved, "unsolved", logarithmic=False)


def draw_left(results: Sequence[SettingResult]) -> Figure:
    """Mean number of hypotheses left, against probes."""
    return _curves(results, lambda one: one.left, "hypotheses left", logarithmic=True)


def save(figure: Figure, path: Path) -> None:
    """Write a figure as SVG and PDF, and close it.

    Args:
        figure: what is drawn.
        path: without ending.
    """
    import matplotlib.pyplot as plt

    from ..whole_file import write_whole

    with _style():
        for kind, stamp in (("svg", "Date"), ("pdf", "CreationDate")):
            sink = io.BytesIO()
            figure.savefig(sink, format=kind, metadata={stamp: None}, bbox_inches="tight")
            write_whole(path.with_name(f"{path.name}.{kind}"), sink.getvalue())
    plt.close(figure)


def _curves(
    results: Sequence[SettingResult],
    curve: Callable[[PolicyResult], NDArray[np.float64]],
    label: str,
    *,
    logarithmic: bool,
) -> Figure:
    with _style():
        names = [result.policy for result in results[0].policies]
        styles = style_of(names)
        figure, panels = _panels(len(results), PANEL[1], "probes", sharey=True)
        for panel, result in zip(panels, results, strict=True):
            for one in result.policies:
                values = curve(one)
                sent = np.arange(1, len(values) + 1)
                panel.plot(sent, values, **styles[one.policy], markersize=3, markevery=(2, 6))
            panel.set(title=result.objects, xlim=(1, None))
            panel.grid(color="#ececec", linewidth=0.6)
        if logarithmic:
            panels[0].set_yscale("log")
            panels[0].yaxis.set_major_formatter("{x:g}")
        else:
            panels[0].set_ylim(0.0, 1.02)
        for panel in panels[::COLUMNS]:
            panel.set_ylabel(label)
        columns = min(len(names), 2 + 2 * min(COLUMNS, len(results)))
        handles = panels[0].get_lines()
        figure.legend(handles, names, loc="outside lower center", ncols=columns, frameon=False)
        return figure


def _style() -> AbstractContextManager[None]:
    import matplotlib as mpl

    mpl.use("Agg", force=False)
    return mpl.rc_context(STYLE)


def _panels(count: int, height: float, below: str, *, sharey: bool) -> tuple[Figure, list[Axes]]:
    """As many panels as are asked for, in rows; the lowest of each column says what is below."""
    import matplotlib.pyplot as plt

    columns = min(COLUMNS, count)
    rows = math.ceil(count / columns)
    figure, grid = plt.subplots(
        rows,
        columns,
        figsize=(PANEL[0] * columns + 0.6, height * rows + 0.5),
        sharey=sharey,
        squeeze=False,
        layout="constrained",
    )
    panels = list(grid.flat)
    for panel in panels[max(count - columns, 0) : count]:
        panel.set_xlabel(below)
    for unused in panels[count:]:
        unused.set_axis_off()
    return figure, panels[:count]
