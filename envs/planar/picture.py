"""A picture of an episode in the plane: the outline, the rays, what they felt, the rivals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patches import Polygon as Patch
from numpy.typing import NDArray

from ..pictures import view as look

Floats = NDArray[np.float64]

DPI = 100
ARROW = 0.12
"""Length of a normal, in half widths of the picture."""
MARGIN = 1.1
"""The picture's own half width, in that of what it shows."""


@dataclass(frozen=True, eq=False)
class PlanarGhost:
    """A rival: an outline at a pose that the contacts allow."""

    outline_world: Floats
    """(e, 2) corners, metres."""
    colour: int
    """Ghosts of one number share a colour."""
    label: str
    """Its line in the legend; ghosts of one label share it."""
    weight: float
    """Its share of the belief; the more, the plainer it is drawn."""


@dataclass(frozen=True, eq=False, kw_only=True)
class PlanarPicture:
    """Everything that a picture shows; world frame, metres."""

    outline_world: Floats
    """(e, 2) corners of the outline as it truly lies."""
    rays_world: Floats
    """(r, 2, 2) start and end of each ray."""
    ray_hits: NDArray[np.bool_]
    """(r,) whether it ended on the outline."""
    contacts_world: Floats
    """(n, 2) measured positions."""
    normals_world: Floats
    """(n, 2) measured outward unit normals."""
    ghosts: tuple[PlanarGhost, ...]
    """The rivals."""
    half_width: float
    """How far from the origin the picture reaches at least."""
    title: str
    """One line above it."""


def draw_planar(picture: PlanarPicture, size: int = 600) -> NDArray[np.uint8]:
    """Draw a picture, (``size``, ``size``, 3) pixels, row 0 at the top."""
    figure = Figure(figsize=(size / DPI, size / DPI), dpi=DPI)
    canvas = FigureCanvasAgg(figure)
    axes = figure.add_axes((0.02, 0.02, 0.96, 0.90))
    reach = MARGIN * max(picture.half_width, float(np.abs(picture.outline_world).max()))
    axes.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal", xticks=(), yticks=())
    axes.set_title(picture.title, fontsize=11)
    axes.add_patch(
        Patch(picture.outline_world, facecolor=look.OBJECT, edgecolor=look.EDGE, label="truth")
    )
    _draw_ghosts(axes, picture)
    for hit, colour in ((True, look.RAY_HIT), (False, look.RAY_MISSED)):
        chosen = picture.rays_world[picture.ray_hits == hit]
        axes.add_collection(LineCollection(list(chosen), colors=[colour], linewidths=1.2))
    # Arrows even where there are none yet would need a scale of their own.
    if len(picture.contacts_world):
        x, y = picture.contacts_world.T
        u, v = ARROW * picture.half_width * picture.normals_world.T
        exact = {"angles": "xy", "scale_units": "xy", "scale": 1.0}
        axes.quiver(x, y, u, v, color=look.CONTACT, width=0.006, zorder=4, **exact)
        axes.plot(x, y, "o", color=look.CONTACT, markersize=5, zorder=4)
    axes.legend(loc="lower left", fontsize=8)
    canvas.draw()
    return np.array(canvas.buffer_rgba())[..., :3]


def _draw_ghosts(axes: Axes, picture: PlanarPicture) -> None:
    """Outlines of the rivals, the heaviest on top; the first of a label is in the legend."""
    labelled: set[str] = set()
    order = np.argsort([-ghost.weight for ghost in picture.ghosts], kind="stable")
    for rank, row in enumerate(order):
        ghost = picture.ghosts[row]
        label = None if ghost.label in labelled else ghost.label
        labelled.add(ghost.label)
        axes.add_patch(
            Patch(
                ghost.outline_world,
                fill=False,
                edgecolor=look.GHOSTS[ghost.colour % len(look.GHOSTS)],
                linewidth=1.0 + 2.0 * ghost.weight,
                alpha=0.3 + 0.7 * min(ghost.weight, 1.0),
                zorder=3.0 - rank / (1.0 + len(order)),
                label=label,
            )
        )
