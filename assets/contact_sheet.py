"""Draw the library's contact sheet: every object at one scale (needs matplotlib).

    python -m palpate.assets.contact_sheet [FILE]

The default FILE is docs/library.png in the working directory, which is the repository's root.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from . import mesh_path
from .obj_file import read_obj
from .render import View, render
from .stand_ins import METRES_PER_INCH, STAND_INS, StandIn

_PIXELS_PER_INCH = 96  # output pixels for an inch of an object
_DPI = 100
_MARGIN, _CAPTION = 50, 82  # pixels
_INK, _QUIET = "#20242c", "#5b6270"

# Housings and stapler stand on their base; the hands lie, fingers to the right.
_VIEWS = {
    "housing": View(eye=(0.75, -1.0, 0.62), up=(0.0, 0.0, 1.0)),
    "housing-34": View(eye=(0.75, -1.0, 0.62), up=(0.0, 0.0, 1.0)),
    "stapler": View(eye=(0.42, -1.0, 0.5), up=(0.0, 0.0, 1.0)),
    "simple-hand": View(eye=(0.6, 1.0, 0.35), up=(1.0, 0.0, 0.0)),
    "complex-hand": View(eye=(0.55, 1.0, 0.35), up=(1.0, 0.0, 0.0)),
}
_COLOURS = {
    "housing": (0.66, 0.80, 0.93),
    "housing-34": (0.72, 0.76, 0.97),
    "stapler": (0.98, 0.76, 0.62),
    "simple-hand": (0.70, 0.89, 0.76),
    "complex-hand": (0.97, 0.86, 0.60),
}
_ROWS = (("housing", "housing-34", "stapler"), ("simple-hand", "complex-hand"))


def draw(path: Path, pixels_per_inch: float = _PIXELS_PER_INCH) -> None:
    """Write the contact sheet as a PNG, under a temporary name that is then renamed.

    ``pixels_per_inch`` is the objects' scale; captions and margins keep their size.
    """
    known = {stand_in.name: stand_in for stand_in in STAND_INS}
    pictures = {name: _picture(name, pixels_per_inch) for row in _ROWS for name in row}
    widths = [sum(pictures[n].shape[1] for n in row) + _MARGIN * (len(row) + 1) for row in _ROWS]
    heights = [max(pictures[n].shape[0] for n in row) for row in _ROWS]
    width = max(widths)
    height = sum(heights) + len(_ROWS) * (_CAPTION + _MARGIN)
    figure = Figure(figsize=(width / _DPI, height / _DPI), dpi=_DPI, facecolor="white")
    FigureCanvasAgg(figure)
    floor = height
    for row, row_height in zip(_ROWS, heights, strict=True):
        floor -= row_height + _MARGIN
        spare = width - sum(pictures[name].shape[1] for name in row)
        gap = spare // (len(row) + 1)
        left = gap
        for name in row:
            figure.figimage(pictures[name], xo=left, yo=floor)
            centre = left + pictures[name].shape[1] / 2
            _caption(figure, known[name], centre / width, floor, height)
            left += pictures[name].shape[1] + gap
        floor -= _CAPTION
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.stem}.{os.getpid()}.png")
    # matplotlib would put its version into the file.
    figure.savefig(temporary, dpi=_DPI, metadata={"Software": None})
    temporary.replace(path)


def _picture(name: str, pixels_per_inch: float) -> NDArray[np.float64]:
    (mesh,) = read_obj(mesh_path(name))
    return render(mesh, _VIEWS[name], METRES_PER_INCH / pixels_per_inch, _COLOURS[name])


def _caption(figure: Figure, stand_in: StandIn, x: float, floor: int, height: int) -> None:
    diameter_mm = stand_in.diameter_in * METRES_PER_INCH * 1e3
    detail = f"{stand_in.faces} faces, diameter {stand_in.diameter_in:g} in ({diameter_mm:.1f} mm)"
    for text, below, size, colour, weight in (
        (stand_in.name, 16, 15, _INK, "bold"),
        (detail, 42, 12, _QUIET, "normal"),
    ):
        y = (floor - below) / height
        figure.text(x, y, text, ha="center", va="top", size=size, color=colour, weight=weight)


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line. Returns the exit status."""
    parser = argparse.ArgumentParser(prog="python -m palpate.assets.contact_sheet")
    parser.add_argument("file", nargs="?", type=Path, default=Path("docs/library.png"))
    draw(parser.parse_args(arguments).file)
    return 0


if __name__ == "__main__":
    sys.exit(main())
