"""The picture by matplotlib, for where no GL library works.

Faces are seen pixel by pixel (`picture_raster`) and laid under the plot. Lines, arrows and dots are
cut into short pieces; what the object hides is left out, and what lies behind something translucent
takes on its colour.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image

from . import picture_view as look
from .picture import PictureScene
from .picture_raster import Layer, blend, see, see_faces

__all__ = ["draw_plot"]

OVERSAMPLING = 2
DPI = 72  # one point is one pixel
PIECE = 1 / 30  # of the scene's radius: how exactly a line ends where a face hides it
BACKGROUND = 0.955
Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Marks:
    """Small polygons of one kind, all with ``k`` corners; lines have two.

    Attributes:
        corners: ``(n, k, 3)`` metres, world.
        colour: of all of them.
        width: of lines, metres; 0 for filled marks.
        nearer: how far towards the camera they count as, metres, so that the face that they lie on
            does not hide them.
    """

    corners: Floats
    colour: look.Colour
    width: float
    nearer: float


def draw_plot(scene: PictureScene, size: tuple[int, int]) -> Image.Image:
    """The picture without captions, ``size`` (width, height) pixels."""
    view = look.frame(scene, size)
    large = OVERSAMPLING * size[0], OVERSAMPLING * size[1]
    solid = scene.object_vertices_world[scene.object_triangles]
    opaque = see_faces(solid, look.OBJECT, 1.0, view, large)
    plane = _see_plane(scene, view, large)
    ghosts = _see_ghosts(scene, view, large)

    figure = Figure(figsize=(large[0] / DPI, large[1] / DPI), dpi=DPI)
    canvas = FigureCanvasAgg(figure)
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set_axis_off()
    under = _faces_picture(opaque, plane, ghosts)
    axes.imshow(under, extent=(0, large[0], large[1], 0), interpolation="none", aspect="auto")
    axes.add_collection(
        _painted(_marks(scene, view), opaque, [plane, *ghosts], view), autolim=False
    )
    canvas.draw()
    return Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB").reduce(OVERSAMPLING)


def _see_plane(scene: PictureScene, view: look.View, size: tuple[int, int]) -> Layer:
    ruled, _ = look.grid(scene, view)
    (x0, y0, z), (x1, y1, _) = ruled.min(axis=(0, 1)), ruled.max(axis=(0, 1))
    a, b, c, d = (x0, y0, z), (x1, y0, z), (x1, y1, z), (x0, y1, z)
    return see(np.array([[a, b, c], [a, c, d]]), np.ones(2), look.PLANE, 0.6, view, size)


def _see_ghosts(scene: PictureScene, view: look.View, size: tuple[int, int]) -> list[Layer]:
    """A layer for each label."""
    corners: dict[str, list[Floats]] = {}
    for ghost in scene.ghosts:
        corners.setdefault(ghost.label, []).append(ghost.vertices_world[ghost.triangles])
    colours = look.ghost_colours(scene)
    return [
        see_faces(np.concatenate(triangles), colours[label], 0.28, view, size)
        for label, triangles in corners.items()
    ]


def _faces_picture(opaque: Layer, plane: Layer, ghosts: list[Layer]) -> NDArray[np.uint8]:
    """All faces, ``(h, w, 3)``: the object, and over it ghosts behind the plane, plane, ghosts."""
    picture = np.full((*opaque.nearness.shape, 3), BACKGROUND, np.float32)
    blend(picture, opaque, opaque.nearness > 0)
    for ghost in ghosts:
        seen = ghost.nearness > opaque.nearness
        blend(picture, ghost, seen & (ghost.nearness <= plane.nearness))
    blend(picture, plane, plane.nearness > opaque.nearness)
    for ghost in ghosts:
        seen = ghost.nearness > opaque.nearness
        blend(picture, ghost, seen & (ghost.nearness > plane.nearness))
    return np.round(255 * picture).astype(np.uint8)


def _marks(scene: PictureScene, view: look.View) -> list[Marks]:
    unit = view.radius
    marks = [
        _lines(look.grid(scene, view)[0], look.GRID, 0.0010, view, 0.002),
        _lines(scene.object_edges_world, look.EDGE, 0.0035, view, 0.010),
    ]
    colours = look.ghost_colours(scene)
    for ghost in scene.ghosts:
        edges = look.sharp_edges(ghost.vertices_world, ghost.triangles)
        marks.append(_lines(edges, colours[ghost.label], 0.0025, view, 0.010))
    rays, hit = look.shown_rays(scene, view), scene.ray_hits
    tips = scene.contacts_world + look.NORMAL_LENGTH * unit * scene.normals_world
    shafts = np.stack([scene.contacts_world, 0.35 * scene.contacts_world + 0.65 * tips], axis=1)
    return [
        *marks,
        _lines(rays[~hit], look.RAY_MISSED, 0.0030, view, 0.02),
        _discs(rays[~hit, 1], look.RAY_MISSED, 0.012, view),
        _lines(rays[hit], look.RAY_HIT, 0.0045, view, 0.02),
        _lines(shafts, look.CONTACT, 0.009, view, 0.03),
        _discs(scene.contacts_world, look.CONTACT, 0.022, view),
        _arrow_heads(shafts[:, 1], tips, 0.022, view),
    ]


def _lines(
    segments: Floats, colour: look.Colour, radius: float, view: look.View, nearer: float
) -> Marks:
    """``(n, 2, 3)`` segments in short pieces; ``radius`` and ``nearer`` in units of the view's."""
    longest = np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1).max(initial=0.0)
    steps = np.linspace(0.0, 1.0, int(np.ceil(longest / (PIECE * view.radius))) + 2)[:, None]
    points = segments[:, None, 0] + steps * (segments[:, None, 1] - segments[:, None, 0])
    corners = np.stack([points[:, :-1], points[:, 1:]], axis=2).reshape(-1, 2, 3)
    return Marks(corners, colour, 2 * radius * view.radius, nearer * view.radius)


def _discs(centres: Floats, colour: look.Colour, radius: float, view: look.View) -> Marks:
    turn = np.linspace(0.0, 2 * np.pi, 24, endpoint=False)
    rim = np.outer(np.cos(turn), view.axes[0]) + np.outer(np.sin(turn), view.axes[1])
    corners = centres[:, None] + radius * view.radius * rim
    return Marks(corners, colour, 0.0, 0.04 * view.radius)


def _arrow_heads(bases: Floats, tips: Floats, radius: float, view: look.View) -> Marks:
    """Triangles that turn their broad side to the camera."""
    aside = np.cross(tips - bases, view.axes[2])
    aside *= radius * view.radius / np.maximum(np.linalg.norm(aside, axis=1, keepdims=True), 1e-12)
    corners = np.stack([tips, bases + aside, bases - aside], axis=1)
    return Marks(corners, look.CONTACT, 0.0, 0.04 * view.radius)


def _painted(
    marks: list[Marks], opaque: Layer, translucent: list[Layer], view: look.View
) -> PolyCollection:
    """The marks that can be seen, the farthest first."""
    height, width = opaque.nearness.shape
    pixels_per_metre = height / 2 / np.tan(look.FIELD_OF_VIEW / 2) / view.distance
    outlines: list[Floats] = []
    depths, colours, widths = [], [], []
    for group in marks:
        corners = view.project(group.corners, (width, height))
        middle = corners.mean(axis=1)
        depth = middle[:, 2] - group.nearer
        x, y = np.clip(middle[:, :2], 0, (width - 1, height - 1)).astype(int).T
        visible = 1 / depth > opaque.nearness[y, x]
        colour = np.tile(np.array(group.colour, np.float32), (len(corners), 1))
        for layer in translucent:
            veiled = layer.nearness[y, x] > 1 / depth
            colour[veiled] += layer.alpha * (layer.colour[y, x][veiled] - colour[veiled])
        outlines += list(corners[visible][..., :2])
        depths.append(depth[visible])
        colours.append(colour[visible])
        widths.append(np.full(visible.sum(), group.width * pixels_per_metre))
    order = np.argsort(-np.concatenate(depths), kind="stable")
    line_widths, rgb = np.concatenate(widths)[order], np.concatenate(colours)[order]
    filled = (line_widths == 0)[:, None]
    return PolyCollection(
        [outlines[i] for i in order],
        facecolors=np.hstack([rgb, filled]),
        edgecolors=np.hstack([rgb, ~filled]),
        linewidths=line_widths,
        capstyle="round",
    )
