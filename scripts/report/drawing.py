"""How figures are drawn: vectors that can go into a paper, told apart without colour too."""

from __future__ import annotations

import io
from collections.abc import Callable
from functools import wraps
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
"""Okabe and Ito's, but yellow: told apart with any colour vision."""
FAINT = "#ececec"
"""Of grids."""
COLUMNS = 4
"""Most panels beside one another."""
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

P = ParamSpec("P")
T = TypeVar("T")


def in_style(draw: Callable[P, T]) -> Callable[P, T]:
    """Have a drawing made in the reports' style."""

    @wraps(draw)
    def styled(*args: P.args, **named: P.kwargs) -> T:
        import matplotlib as mpl

        mpl.use("Agg", force=False)
        with mpl.rc_context(STYLE):
            return draw(*args, **named)

    return styled


def panels_of(
    count: int, size: tuple[float, float], *, most_columns: int = COLUMNS, sharey: bool = False
) -> tuple[Figure, list[Axes]]:
    """As many panels as are asked for, in rows.

    Args:
        count: how many.
        size: width and height of a panel, inches.
        most_columns: the most beside one another.
        sharey: whether they have one vertical axis.
    """
    import matplotlib.pyplot as plt

    columns = min(count, most_columns)
    rows = -(-count // columns)
    figure, grid = plt.subplots(
        rows,
        columns,
        figsize=(size[0] * columns, size[1] * rows + 0.4),
        squeeze=False,
        sharey=sharey,
        layout="constrained",
    )
    panels = list(grid.flat)
    for unused in panels[count:]:
        unused.set_axis_off()
    return figure, panels[:count]


def drawn(figure: Figure, kind: str) -> bytes:
    """A figure as "svg" or "pdf", the same each time it is drawn."""
    sink = io.BytesIO()
    stamp = {"svg": "Date", "pdf": "CreationDate"}[kind]
    figure.savefig(sink, format=kind, metadata={stamp: None}, bbox_inches="tight")
    return sink.getvalue()


def svg_of(figure: Figure) -> str:
    """A figure as SVG; it is closed."""
    import matplotlib.pyplot as plt

    svg = drawn(figure, "svg").decode()
    plt.close(figure)
    return svg
