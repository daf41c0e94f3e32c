"""The picture by matplotlib, for where no GL library works.

Faces are seen pixel by pixel (`picture_raster`) and laid under the plot. Lines, arrows and dots are
cut into short pieces; what the object hides is left out, and what lies behind something translucent
takes on its colour.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image

from . import view as look
from .picture_scene import PictureScene, Tip
from .raster import Layer, blend, see, see_faces

__all__ = ["PlotPainter"]

OVERSAMPLING = 2
DPI = 72  # one point is one pixel
PIECE = 1 / 30  # of the scene's radius: how exactly a line ends where a face hides it
BACKGROUND = 0.955
GHOST_OPACITY, PLANE_OPACITY = 0.28, 0.6
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
        opacity: below 1 for marks that fade.
    """

    corners: Floats
    colour: look.Colour
    width: float
    nearer: float
    opacity: float = 1.0


class PlotPainter:
    """Paints scene after scene; faces that stay as they are, are looked at once."""

    def __init__(self) -> None:
        self._layers: dict[bytes, Layer] = {}
        self._key = b""

    def paint(
        self, scene: PictureScene, stage: look.Stage, size: tuple[int, int]
    ) -> NDArray[np.uint8]:
        """The picture without captions, ``(height, width, 3)``; ``size`` is (width, height)."""
        self._look(scene, stage, size)
        figure = Figure(figsize=(size[0] / DPI, size[1] / DPI), dpi=DPI)
        canvas = FigureCanvasAgg(figure)
        figure.figimage(self._faces, origin="upper", zorder=-1)
        axes = figure.add_axes((0, 0, 1, 1))
        axes.set_axis_off()
        axes.set(xlim=(0, size[0]), ylim=(size[1], 0))
        marks = _painted(_marks(scene, stage), self._opaque, self._translucent, stage.view)
        axes.add_collection(marks, autolim=False)
        canvas.draw()
        return np.array(canvas.buffer_rgba())[..., :3]

    def _look(self, scene: PictureScene, stage: look.Stage, size: tuple[int, int]) -> None:
        """Have the faces of a scene as the camera sees them."""
        opacities = np.array([ghost.opacity for ghost in scene.ghosts])
        key = look.mesh_key(scene, stage.view, size) + opacities.tobytes()
        if key == self._key:
            return
        large = OVERSAMPLING * size[0], OVERSAMPLING * size[1]
        kept, self._layers = self._layers, {}

        def see_once(triangles: Floats, colour: look.Colour) -> Layer:
            facts = np.array([*stage.view.numbers, *large, *colour])
            name = facts.tobytes() + triangles.tobytes()
            layer = kept.get(name) or see_faces(triangles, colour, 1.0, stage.view, large)
            self._layers[name] = layer
            return layer

        colours = look.ghost_colours(scene)
        ghosts = [
            replace(
                see_once(ghost.vertices_world[ghost.triangles], colours[ghost.label]),
                alpha=GHOST_OPACITY * ghost.opacity,
            )
            for ghost in scene.ghosts
        ]
        plane = _see_plane(stage, large)
        self._opaque = see_once(scene.object_vertices_world[scene.object_triangles], look.OBJECT)
        self._translucent = [plane, *ghosts]
        self._faces = _faces_picture(self._opaque, plane, ghosts)
        self._key = key


def _see_plane(stage: look.Stage, size: tuple[int, int]) -> Layer:
    (x0, y0, z), (x1, y1, _) = stage.ruled.min(axis=(0, 1)), stage.ruled.max(axis=(0, 1))
    a, b, c, d = (x0, y0, z), (x1, y0, z), (x1, y1, z), (x0, y1, z)
    corners = np.array([[a, b, c], [a, c, d]])
    return see(corners, np.ones(2), look.PLANE, PLANE_OPACITY, stage.view, size)


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
    return np.asarray(
        Image.fromarray(np.round(255 * picture).astype(np.uint8)).reduce(OVERSAMPLING)
    )


def _marks(scene: PictureScene, stage: look.Stage) -> list[Marks]:
    view, size = stage.view, look.mark_size(scene)
    unit = view.radius
    marks = [
        _lines(stage.ruled, look.GRID, 0.0010, view, 0.002),
        _lines(scene.object_edges_world, look.EDGE, 0.0035, view, 0.010),
    ]
    colours = look.ghost_colours(scene)
    for ghost in scene.ghosts:
        edges = look.sharp_edges(ghost.vertices_world, ghost.triangles)
        lines = _lines(edges, colours[ghost.label], 0.0025, view, 0.010)
        marks.append(replace(lines, opacity=ghost.opacity))
    rays, hit = look.shown_rays(scene, view), scene.ray_hits
    arrows = scene.normals_world.any(axis=1)
    starts = scene.contacts_world[arrows]
    ends = starts + look.NORMAL_LENGTH * size * unit * scene.normals_world[arrows]
    shafts = np.stack([starts, 0.35 * starts + 0.65 * ends], axis=1)
    return [
        *marks,
        _lines(rays[~hit], look.RAY_MISSED, 0.0030, view, 0.02),
        _discs(rays[~hit, 1], look.RAY_MISSED, 0.012, view),
        _lines(rays[hit], look.RAY_HIT, 0.0045, view, 0.02),
        *(mark for tip in scene.tips for mark in _tip_marks(tip, view)),
        _lines(shafts, look.CONTACT, 0.009 * size, view, 0.03),
        _discs(scene.contacts_world, look.CONTACT, 0.022 * size, view),
        _arrow_heads(shafts[:, 1], ends, 0.022 * size, view),
    ]


def _tip_marks(tip: Tip, view: look.View) -> list[Marks]:
    """A ball and what it sweeps; of a point its line, and a dot that can be seen."""
    path, radius = tip.path_world[None], tip.radius / view.radius
    swept = _lines(path, look.RAY_HIT, max(radius, 0.0045), view, 0.02)
    return [
        replace(swept, opacity=0.25 if radius else 1.0),
        _lines(path, look.RAY_HIT, 0.0045, view, 0.02),
        _discs(path[:, 1], look.RAY_HIT, radius or look.POINT_SIZE, view),
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
        colour = np.tile(np.array([*group.colour, group.opacity], np.float32), (len(corners), 1))
        for layer in translucent:
            veiled = layer.nearness[y, x] > 1 / depth
            veil = layer.shaded((y[veiled], x[veiled]))
            colour[veiled, :3] += layer.alpha * (veil - colour[veiled, :3])
        outlines += list(corners[visible][..., :2] / OVERSAMPLING)
        depths.append(depth[visible])
        colours.append(colour[visible])
        widths.append(np.full(visible.sum(), group.width * pixels_per_metre / OVERSAMPLING))
    order = np.argsort(-np.concatenate(depths), kind="stable")
    line_widths, rgba = np.concatenate(widths)[order], np.concatenate(colours)[order]
    filled = line_widths == 0
    faces, strokes = rgba.copy(), rgba.copy()
    faces[~filled, 3] = 0.0
    strokes[filled, 3] = 0.0
    return PolyCollection(
        [outlines[i] for i in order],
        facecolors=faces,
        edgecolors=strokes,
        linewidths=line_widths,
        capstyle="round",
    )
