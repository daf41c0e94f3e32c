"""Pictures by NumPy alone, for where no GL library works.

All is flat convex polygons, marks too: what is nearest in a pixel is seen there. What is
translucent is seen each thing by itself, and laid over the rest.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from . import view as look
from .marks import Mark, marks
from .picture_scene import PictureScene

__all__ = ["paint"]

OVERSAMPLING = 2
THIN = 4.0
"""Up to this radius a mark has corners, pixels; a wider one is round."""
BACKGROUND = 244
GHOST_OPACITY, PLANE_OPACITY = 0.28, 0.6
Floats = NDArray[np.float64]


class Layer:
    """What is nearest in every pixel of a picture, and how much it hides of what lies behind."""

    def __init__(self, view: look.View, size: tuple[int, int], opacity: float = 1.0) -> None:
        self.view, self.size, self.opacity = view, size, opacity
        self.nearness = np.zeros(size[0] * size[1])
        """One over the depth, 1/metres; zero where nothing is seen."""
        self.colours = np.full((size[0] * size[1], 3), BACKGROUND, np.uint8)

    def add_body(self, triangles_world: Floats, colour: look.Colour) -> None:
        """Add the camera's side of ``(n, 3, 3)`` triangles, lit from above."""
        back, light = self.view.axes[2], self.view.towards_light
        a, b, c = np.moveaxis(triangles_world, 1, 0)
        normals = np.cross(b - a, c - a)
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
        lit = np.maximum(normals @ light / np.linalg.norm(light), 0.0)
        shades = 0.60 + 0.12 * np.abs(normals @ back) + 0.36 * lit
        eye = self.view.centre + self.view.distance * back
        facing = ((eye - a) * normals).sum(axis=1) > 0.0
        corners = self.view.project(triangles_world[facing], self.size)
        for each, shade in zip(corners, shades[facing], strict=True):
            self.add(each, shade * np.array(colour))

    def add_mark(self, mark: Mark) -> None:
        """Add a mark, as wide as it is; it hides what it touches."""
        start, end = self.view.project(mark.ends_world, self.size)
        radius = mark.radius * self.view.pixels_per_metre(self.size) / end[2]
        way = end - start
        length = float(np.hypot(way[0], way[1]))
        along, aside = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])
        if length > 1e-9:
            along = np.array([way[0], way[1], 0.0]) / length
            aside = np.array([-along[1], along[0], 0.0])
        if mark.arrow:
            neck = start + 0.65 * way
            head = np.stack([end, neck + 2.4 * radius * aside, neck - 2.4 * radius * aside])
            self.add(head - (0.0, 0.0, 3.0 * mark.radius), np.array(mark.colour))
            end = neck
        count = 4 if radius < THIN else 24
        turn = 2.0 * np.pi / count * (np.arange(count)[:, None] + 0.5)
        spokes = radius / np.cos(np.pi / count) * (np.cos(turn) * along + np.sin(turn) * aside)
        rim = np.where(np.cos(turn) > 0.0, end, start) + spokes
        self.add(rim - (0.0, 0.0, 2.0 * mark.radius), np.array(mark.colour))

    def add(self, corners: Floats, colour: Floats) -> None:
        """Add a convex polygon: ``(k, 3)`` pixels right and down, and depth in metres."""
        low = np.maximum(corners[:, :2].min(axis=0), 0).astype(int)
        high = np.minimum(np.ceil(corners[:, :2].max(axis=0)), self.size).astype(int)
        # One over the depth is what perspective keeps linear across the picture.
        (ax, ay, a), (bx, by, b), (cx, cy, c) = corners[:: len(corners) // 3][:3]
        area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        if (low >= high).any() or abs(area) < 1e-9 or corners[:, 2].min() <= 0.0:
            return
        a, b, c = 1.0 / a, 1.0 / b, 1.0 / c
        rightwards = ((b - a) * (cy - ay) - (c - a) * (by - ay)) / area
        downwards = ((c - a) * (bx - ax) - (b - a) * (cx - ax)) / area

        x, y = np.arange(low[0], high[0]) + 0.5, np.arange(low[1], high[1]) + 0.5
        inside = np.ones((len(y), len(x)), bool)
        sides = np.sign(area) * (np.roll(corners, -1, axis=0) - corners)
        for (x0, y0, _), (dx, dy, _) in zip(corners, sides, strict=True):
            inside &= (dx * (y - y0) + 1e-6)[:, None] >= dy * (x - x0)
        row, column = inside.nonzero()
        value = a + rightwards * (x[column] - ax) + downwards * (y[row] - ay)
        pixel = (row + low[1]) * self.size[0] + column + low[0]
        seen = value > self.nearness[pixel]
        self.nearness[pixel[seen]] = value[seen]
        self.colours[pixel[seen]] = np.round(255 * np.minimum(colour, 1.0))

    def lay_over(self, picture: NDArray[np.float32], pixels: NDArray[np.int64]) -> None:
        """Paint some of its pixels over a picture, ``(h w, 3)``, in place."""
        under = picture[pixels]
        picture[pixels] = under + np.float32(self.opacity) * (self.colours[pixels] - under)


def paint(scene: PictureScene, stage: look.Stage, size: tuple[int, int]) -> NDArray[np.uint8]:
    """The picture without captions, ``(height, width, 3)``; ``size`` is (width, height)."""
    large = OVERSAMPLING * size[0], OVERSAMPLING * size[1]
    solid, *translucent = _layers(scene, stage, large)
    plane = Layer(stage.view, large, PLANE_OPACITY)
    (x0, y0, z), (x1, y1, _) = stage.ruled.min(axis=(0, 1)), stage.ruled.max(axis=(0, 1))
    corners = np.array([(x0, y0, z), (x1, y0, z), (x1, y1, z), (x0, y1, z)])
    plane.add(stage.view.project(corners, large), np.array(look.PLANE))

    picture = solid.colours.astype(np.float32)
    above: list[tuple[Layer, NDArray[np.int64]]] = []
    for layer in translucent:
        seen = np.flatnonzero(layer.nearness > solid.nearness)
        below = layer.nearness[seen] <= plane.nearness[seen]
        layer.lay_over(picture, seen[below])
        above.append((layer, seen[~below]))
    plane.lay_over(picture, np.flatnonzero(plane.nearness > solid.nearness))
    for layer, seen in above:
        layer.lay_over(picture, seen)
    pixels = np.round(picture).astype(np.uint8).reshape(large[1], large[0], 3)
    return np.asarray(Image.fromarray(pixels).reduce(OVERSAMPLING))


def _layers(scene: PictureScene, stage: look.Stage, size: tuple[int, int]) -> list[Layer]:
    """What is solid, then each ghost, then all marks of one colour and opacity together."""
    layers = [Layer(stage.view, size)]
    layers[0].add_body(scene.object_vertices_world[scene.object_triangles], look.OBJECT)
    colours = look.ghost_colours(scene)
    for ghost in scene.ghosts:
        layers.append(Layer(stage.view, size, GHOST_OPACITY * ghost.opacity))
        layers[-1].add_body(ghost.vertices_world[ghost.triangles], colours[ghost.label])
    fading: dict[tuple[look.Colour, float], Layer] = {}
    for mark in marks(scene, stage):
        layer, key = layers[0], (mark.colour, mark.opacity)
        if mark.opacity < 1.0:
            if key not in fading:
                fading[key] = Layer(stage.view, size, mark.opacity)
            layer = fading[key]
        layer.add_mark(mark)
    return [*layers, *fading.values()]
