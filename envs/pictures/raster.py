"""Faces as seen pixel by pixel: the depth buffer under the pictures that matplotlib draws."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import view as look

__all__ = ["Layer", "blend", "see", "see_faces"]

PIECE = 1 / 6  # of the scene's radius: smaller triangles waste fewer pixels of their bounding boxes
Floats = NDArray[np.float64]
Pixels = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Layer:
    """The nearest surface of one thing, seen through every pixel.

    Attributes:
        nearness: ``(h, w)`` one over the depth, 1/metres; zero where there is nothing.
        shade: ``(h, w)`` how bright it is there, 1 for its own colour.
        colour: of all of it.
        alpha: one opacity for all of it.
    """

    nearness: Pixels
    shade: Pixels
    colour: look.Colour
    alpha: float

    def shaded(self, where: tuple[NDArray[Any], ...] | NDArray[np.bool_]) -> Pixels:
        """``(n, 3)`` its colour, shaded, in the chosen pixels."""
        return np.minimum(self.shade[where][:, None] * np.array(self.colour, np.float32), 1.0)


def see_faces(
    triangles: Floats, colour: look.Colour, alpha: float, view: look.View, size: tuple[int, int]
) -> Layer:
    """The camera's side of ``(n, 3, 3)`` triangles, lit from above."""
    right, up, back = view.axes
    eye = view.centre + view.distance * back
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    facing = (normals * (eye - triangles[:, 0])).sum(axis=1) > 0
    light = 0.75 * up - 0.5 * right + 0.35 * back
    lit = np.maximum(normals @ light / np.linalg.norm(light), 0.0)
    shades = 0.60 + 0.12 * np.abs(normals @ back) + 0.36 * lit
    return see(triangles[facing], shades[facing], colour, alpha, view, size)


def see(
    triangles: Floats,
    shades: Floats,
    colour: look.Colour,
    alpha: float,
    view: look.View,
    size: tuple[int, int],
) -> Layer:
    """The nearest of ``(n, 3, 3)`` triangles in every pixel, in ``(n,)`` shades of ``colour``."""
    nearness = np.zeros((size[1], size[0]), np.float32)
    shade = np.zeros_like(nearness)
    small, owner = _cut_small(triangles, PIECE * view.radius)
    for corners, brightness in zip(view.project(small, size), shades[owner], strict=True):
        _fill(corners, brightness, nearness, shade)
    return Layer(nearness, shade, colour, alpha)


def blend(under: Pixels, layer: Layer, where: NDArray[np.bool_]) -> None:
    """Paint ``layer`` over the picture ``under``, in place, where ``where`` says so."""
    under[where] += np.float32(layer.alpha) * (layer.shaded(where) - under[where])


def _fill(corners: Floats, brightness: float, nearness: Pixels, shade: Pixels) -> None:
    """Draw one triangle, ``(3, 3)`` pixel coordinates and depth, where it is the nearest."""
    height, width = nearness.shape
    low = np.maximum(np.floor(corners[:, :2].min(axis=0)), 0).astype(int)
    high = np.minimum(np.ceil(corners[:, :2].max(axis=0)), (width, height)).astype(int)
    a, b, c = corners[:, :2]
    area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    if np.any(low >= high) or abs(area) < 1e-9:
        return
    x = np.arange(low[0], high[0]) + 0.5 - a[0]
    y = (np.arange(low[1], high[1]) + 0.5 - a[1])[:, None]
    along_b = (x * (c[1] - a[1]) - y * (c[0] - a[0])) / area
    along_c = (y * (b[0] - a[0]) - x * (b[1] - a[1])) / area
    inside = (along_b >= -1e-9) & (along_c >= -1e-9) & (along_b + along_c <= 1 + 1e-9)
    # One over the depth is what perspective keeps linear across the picture.
    at_a, at_b, at_c = 1 / corners[:, 2]
    value = at_a + along_b * (at_b - at_a) + along_c * (at_c - at_a)
    window = np.s_[low[1] : high[1], low[0] : high[0]]
    nearest = inside & (value > nearness[window])
    nearness[window][nearest] = value[nearest]
    shade[window][nearest] = brightness


def _cut_small(triangles: Floats, longest: float) -> tuple[Floats, NDArray[np.int64]]:
    """Halve the longest edge of every triangle until none is longer than ``longest``.

    Returns the pieces and, for each, the index of the triangle that it was cut from.
    """
    owner = np.arange(len(triangles))
    done, owners = [np.zeros((0, 3, 3))], [owner[:0]]
    while len(triangles):
        lengths = np.linalg.norm(np.roll(triangles, -1, axis=1) - triangles, axis=2)
        small = lengths.max(axis=1) <= longest
        done.append(triangles[small])
        owners.append(owner[small])
        triangles, lengths, owner = triangles[~small], lengths[~small], np.tile(owner[~small], 2)
        first = np.argmax(lengths, axis=1)
        a, b, c = (triangles[np.arange(len(triangles)), (first + k) % 3] for k in range(3))
        middle = (a + b) / 2
        triangles = np.concatenate([np.stack([a, middle, c], 1), np.stack([middle, b, c], 1)])
    return np.concatenate(done), np.concatenate(owners)
