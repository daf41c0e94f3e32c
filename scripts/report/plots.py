"""A report's figures: probes needed, and curves probe by probe."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..whole_file import write_whole
from .drawing import COLOURS, COLUMNS, FAINT, drawn, in_style, panels_of
from .results import BASELINES, PolicyResult, SettingResult

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

GREYS = {"random": "#9a9a9a", "random-hit": "#5f5f5f"}
LINES = ("-", "--", "-.", ":")
MARKERS = "osD^vPX<>*hp"
PANEL = (2.75, 2.2)
"""Width and height of a panel, inches."""


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


@in_style
def draw_probes(results: Sequence[SettingResult]) -> Figure:
    """Mean probes to unique with intervals and, dotted, the floor; a panel a setting."""
    names = [result.policy for result in results[0].policies]
    styles = style_of(names)
    figure, panels = panels_of(len(results), (PANEL[0], 0.6 + 0.17 * len(names)), sharey=True)
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
        panel.grid(axis="x", color=FAINT, linewidth=0.6)
        panel.set_axisbelow(True)
    for panel in panels[-COLUMNS:]:
        panel.set_xlabel("probes to unique")
    return figure


def draw_unsolved(results: Sequence[SettingResult]) -> Figure:
    """Share of the episodes that aren't solved, against probes."""
    figure, panels = _curves(results, lambda one: one.unsolved, "unsolved")
    panels[0].set_ylim(0.0, 1.02)
    return figure


def draw_left(results: Sequence[SettingResult]) -> Figure:
    """Mean number of hypotheses left, against probes."""
    figure, panels = _curves(results, lambda one: one.left, "hypotheses left")
    panels[0].set_yscale("log")
    panels[0].yaxis.set_major_formatter("{x:g}")
    return figure


@in_style
def save(figure: Figure, path: Path) -> None:
    """Write a figure as SVG and PDF, and close it.

    Args:
        figure: what is drawn.
        path: without ending.
    """
    import matplotlib.pyplot as plt

    for kind in ("svg", "pdf"):
        write_whole(path.with_name(f"{path.name}.{kind}"), drawn(figure, kind))
    plt.close(figure)


@in_style
def _curves(
    results: Sequence[SettingResult],
    curve: Callable[[PolicyResult], NDArray[np.float64]],
    label: str,
) -> tuple[Figure, list[Axes]]:
    names = [result.policy for result in results[0].policies]
    styles = style_of(names)
    figure, panels = panels_of(len(results), PANEL, sharey=True)
    for panel, result in zip(panels, results, strict=True):
        for one in result.policies:
            values = curve(one)
            sent = np.arange(1, len(values) + 1)
            panel.plot(sent, values, **styles[one.policy], markersize=3, markevery=(2, 6))
        panel.set(title=result.objects, xlim=(1, None))
        panel.grid(color=FAINT, linewidth=0.6)
    for panel in panels[-COLUMNS:]:
        panel.set_xlabel("probes")
    for panel in panels[::COLUMNS]:
        panel.set_ylabel(label)
    columns = min(len(names), 2 + 2 * min(COLUMNS, len(results)))
    handles = panels[0].get_lines()
    figure.legend(handles, names, loc="outside lower center", ncols=columns, frameon=False)
    return figure, panels
