"""Drawings of the memo's experiments: its figures beside ours."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Literal

import numpy as np

from ..report.drawing import COLOURS, FAINT, in_style, panels_of, svg_of
from .judge import MEDIAN, Row

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.ticker import Locator

OURS, MEMO = COLOURS[0], COLOURS[1]
MANY_BINS = 12
FEWEST_TIMES = 8.0
"""Ends of a logarithmic axis of counts are in about this ratio at least."""
NARROW = 300.0
"""Ends of a logarithmic axis in a smaller ratio: it gets figures between decades."""


@in_style
def draw_rows(rows: Sequence[Row], label: str) -> str:
    """Medians with the span from least to 90th percentile, ours and the memo's; a panel a group.

    Args:
        rows: of one table.
        label: what is counted.

    Returns:
        The drawing as SVG.
    """
    groups = list(dict.fromkeys(row.group for row in rows))
    most = max(sum(row.group == group for row in rows) for group in groups)
    figure, panels = panels_of(len(groups), (2.9, 0.5 + 0.26 * most))
    for panel, group in zip(panels, groups, strict=True):
        own = [row for row in rows if row.group == group]
        for at, row in enumerate(own):
            for shift, four, colour, marker in (
                (-0.13, row.memo, MEMO, "o"),
                (0.13, row.ours, OURS, "s"),
            ):
                if four is None:
                    continue
                panel.plot(four[:3:2], [at + shift] * 2, color=colour, linewidth=1.0)
                panel.plot(four[MEDIAN], at + shift, marker, color=colour, markersize=3.5)
        panel.set_yticks(range(len(own)), [", ".join(row.key[1:]) for row in own])
        panel.set(title=group, xlabel=label, ylim=(len(own) - 0.5, -0.5))
        drawn = [
            value for row in own for four in (row.memo, row.ours) if four for value in four[:3]
        ]
        # Counts of 2 and 3 alone would be shown as if they were far apart.
        panel.set_xlim(0.9 * min(drawn), 1.1 * max(*drawn, FEWEST_TIMES * min(drawn)))
        _logarithmic(panel, "x")
    _legend(figure, panels[0], (("memo", MEMO, "o"), ("ours", OURS, "s")))
    return svg_of(figure)


@in_style
def draw_histograms(
    titled: Mapping[str, tuple[Sequence[int] | None, Sequence[float]]],
    bins: Sequence[str],
    label: str,
) -> str:
    """Runs in each bin, the memo's as an outline where it has them, ours filled; a panel a title.

    Args:
        titled: title to the memo's and our runs in each bin.
        bins: their names.
        label: what is counted.

    Returns:
        The drawing as SVG.
    """
    many = len(bins) > MANY_BINS
    size = (4.4, 2.0) if many else (2.9, 1.9)
    figure, panels = panels_of(len(titled), size, most_columns=2 if many else 3)
    places = np.arange(len(bins))
    for panel, (title, (memo, ours)) in zip(panels, titled.items(), strict=True):
        panel.bar(places, ours, width=0.8, color=OURS, alpha=0.75)
        if memo is not None:
            panel.step(places, memo, where="mid", color=MEMO, linewidth=1.1)
            panel.plot(places, memo, "o", color=MEMO, markersize=2.5)
        panel.set(title=title, xlabel=label, ylabel="runs")
        panel.margins(x=0.02)
        panel.set_xticks(places, bins, rotation=60 if many else 35, fontsize=6.5)
        panel.grid(axis="y", color=FAINT, linewidth=0.6)
        panel.set_axisbelow(True)
    if any(memo is not None for memo, _ in titled.values()):
        _legend(figure, panels[0], (("memo", MEMO, "o"), ("ours", OURS, "s")))
    return svg_of(figure)


@in_style
def draw_levels(titled: Mapping[str, Sequence[Row]], label: str) -> str:
    """Curves over the levels of the tree: medians, and the span from least to 90th percentile.

    Args:
        titled: title to rows whose one level is the tree's.
        label: what is counted.

    Returns:
        The drawing as SVG.
    """
    figure, panels = panels_of(len(titled), (3.6, 2.6), sharey=True)
    for panel, (title, rows) in zip(panels, titled.items(), strict=True):
        levels = [row.levels[0] for row in rows]
        least, median, p90, _ = np.array([row.ours for row in rows]).T
        panel.fill_between(levels, least, p90, color=OURS, alpha=0.16, linewidth=0)
        panel.plot(levels, median, "s-", color=OURS, markersize=3.5)
        least, median, p90, _ = np.array([row.memo for row in rows]).T
        for edge in (least, p90):
            panel.plot(levels, edge, ":", color=MEMO, linewidth=0.9)
        panel.plot(levels, median, "o-", color=MEMO, markersize=3.5)
        panel.set(title=title, xlabel="contacts that have a face", ylabel=label)
        panel.xaxis.set_major_locator(_whole_numbers())
        _logarithmic(panel, "y")
    _legend(figure, panels[0], (("memo", MEMO, "o"), ("ours", OURS, "s")))
    return svg_of(figure)


@in_style
def draw_bars(
    titled: Mapping[str, Sequence[tuple[str, float, float]]], label: str, limit: float
) -> str:
    """Medians as bars with a whisker to the 90th percentile; a panel a title.

    Args:
        titled: title to names, medians and 90th percentiles.
        label: what is counted.
        limit: where counting stopped.

    Returns:
        The drawing as SVG.
    """
    most = max(len(bars) for bars in titled.values())
    figure, panels = panels_of(len(titled), (3.4, 0.6 + 0.21 * most), sharey=True)
    for panel, (title, bars) in zip(panels, titled.items(), strict=True):
        places = np.arange(len(bars))
        panel.barh(places, [bar[1] for bar in bars], height=0.65, color=OURS, alpha=0.8)
        for at, (_, median, p90) in enumerate(bars):
            panel.plot([median, p90], [at, at], color="#000000", linewidth=0.8)
        panel.axvline(limit, color="#000000", linewidth=0.7, linestyle=":")
        panel.set_yticks(places, [bar[0] for bar in bars])
        panel.set(title=title, xlabel=label, ylim=(len(bars) - 0.5, -0.5))
        panel.set_xlim(left=1.0)
        _logarithmic(panel, "x")
    return svg_of(figure)


def _whole_numbers() -> Locator:
    from matplotlib.ticker import MaxNLocator

    return MaxNLocator(integer=True)


def _logarithmic(panel: Axes, axis: Literal["x", "y"]) -> None:
    from matplotlib.ticker import LogLocator, NullFormatter, NullLocator

    if axis == "x":
        panel.set_xscale("log")
    else:
        panel.set_yscale("log")
    scaled = panel.xaxis if axis == "x" else panel.yaxis
    low, high = sorted(scaled.get_view_interval())
    # Decades alone would leave a narrow axis without a single figure.
    if high < NARROW * low:
        scaled.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        scaled.set_minor_locator(NullLocator())
    scaled.set_major_formatter("{x:,g}")
    scaled.set_minor_formatter(NullFormatter())
    panel.grid(axis=axis, color=FAINT, linewidth=0.6)
    panel.set_axisbelow(True)


def _legend(figure: Figure, panel: Axes, entries: Sequence[tuple[str, str, str]]) -> None:
    handles = [
        panel.plot([], [], f"{marker}-", color=colour, markersize=3.5)[0]
        for _, colour, marker in entries
    ]
    names = [name for name, _, _ in entries]
    figure.legend(handles, names, loc="outside lower center", ncols=len(names), frameon=False)
