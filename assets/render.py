"""Shaded pictures of closed meshes: orthographic, hidden surfaces removed, numpy only.

Each pixel is given the planar face that it shows (a depth buffer decides). Shading then follows
from the face's normal, and a dark line is drawn wherever the face changes from one pixel to the
next: the solid's own edges and its outline, without the diagonals that divide a face.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .obj_file import TriangleMesh

_BACKGROUND = -1
_SUPERSAMPLING = 4  # rays per output pixel and direction
_LINE_RADIUS = 2  # supersamples; a line is about 2 * 2 / 4 = 1 output pixel wide
_LINE_COLOUR = np.array([0.13, 0.15, 0.19])
# Directions towards two lamps in the camera's frame (right, up, towards the eye), with weights.
_LAMPS = ((np.array([-0.45, 0.80, 0.40]), 0.50), (np.array([-0.25, 0.05, 0.95]), 0.27))
_AMBIENT = 0.36


@dataclass(frozen=True)
class View:
    """Where an object is seen from: directions in its own frame, of any length.

    Attributes:
        eye: from the object towards the eye.
        up: what appears upwards in the picture (its part across ``eye``).
    """

    eye: tuple[float, float, float]
    up: tuple[float, float, float]

    def axes(self) -> NDArray[np.float64]:
        """``(3, 3)``: rows are the camera's right, up and towards-the-eye axes, object frame."""
        eye = np.array(self.eye) / np.linalg.norm(self.eye)
        right = np.cross(self.up, eye)
        right /= np.linalg.norm(right)
        return np.array([right, np.cross(eye, right), eye])


def render(
    mesh: TriangleMesh, view: View, metres_per_pixel: float, colour: tuple[float, float, float]
) -> NDArray[np.float64]:
    """Picture of a mesh that just fits it; ``(height, width, 4)`` RGBA in 0..1, row 0 on top.

    ``colour`` is the surface's RGB under full light.
    """
    points = mesh.vertices @ view.axes().T / (metres_per_pixel / _SUPERSAMPLING)
    margin = 2 * _SUPERSAMPLING
    points[:, :2] += margin - points[:, :2].min(axis=0)
    cells = np.ceil((points[:, :2].max(axis=0) + margin) / _SUPERSAMPLING).astype(int)
    nearest = _nearest_triangle(points[mesh.triangles], tuple(cells * _SUPERSAMPLING))
    normals = _unit_normals(points[mesh.triangles])
    faces = _same_plane(normals, points[mesh.triangles][:, 0])
    seen = np.where(nearest == _BACKGROUND, _BACKGROUND, faces[nearest])
    rgba = _shade(normals, colour)[nearest]
    rgba[seen == _BACKGROUND] = 0.0
    rgba[_lines(seen)] = (*_LINE_COLOUR, 1.0)
    return _average(rgba)[::-1]


def _nearest_triangle(triangles: NDArray[np.float64], size: tuple[int, int]) -> NDArray[np.int64]:
    """Depth buffer: for each (row, column) the triangle nearest to the eye, or background."""
    nearest = np.full((size[1], size[0]), _BACKGROUND)
    depth = np.full((size[1], size[0]), -np.inf)
    for number, (a, b, c) in enumerate(triangles):
        double_area = (b - a)[0] * (c - a)[1] - (b - a)[1] * (c - a)[0]
        if double_area <= 1e-9:  # seen from behind, or edge-on
            continue
        low = np.floor(np.minimum(np.minimum(a, b), c)[:2]).astype(int)
        high = np.ceil(np.maximum(np.maximum(a, b), c)[:2]).astype(int) + 1
        x, y = np.meshgrid(np.arange(low[0], high[0]) + 0.5, np.arange(low[1], high[1]) + 0.5)
        at_b = ((x - a[0]) * (c - a)[1] - (y - a[1]) * (c - a)[0]) / double_area
        at_c = ((b - a)[0] * (y - a[1]) - (b - a)[1] * (x - a[0])) / double_area
        z = a[2] + at_b * (b - a)[2] + at_c * (c - a)[2]
        window = (slice(low[1], high[1]), slice(low[0], high[0]))
        # The small negative bound leaves no gap between triangles that share an edge.
        inside = (at_b >= -1e-9) & (at_c >= -1e-9) & (at_b + at_c <= 1 + 1e-9)
        shown = inside & (z > depth[window])
        depth[window][shown] = z[shown]
        nearest[window][shown] = number
    return nearest


def _unit_normals(triangles: NDArray[np.float64]) -> NDArray[np.float64]:
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


def _same_plane(normals: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.int64]:
    """A number for each triangle's plane. Separate faces of one plane need no line between them."""
    planes = np.column_stack([normals * 1e3, (normals * points).sum(axis=1)])
    return np.unique(np.round(planes), axis=0, return_inverse=True)[1].reshape(-1)


def _shade(normals: NDArray[np.float64], colour: tuple[float, float, float]) -> NDArray[np.float64]:
    light = np.full(len(normals), _AMBIENT)
    for direction, weight in _LAMPS:
        light += weight * np.clip(normals @ (direction / np.linalg.norm(direction)), 0.0, None)
    rgb = np.clip(light[:, None] * np.array(colour), 0.0, 1.0)
    return np.column_stack([rgb, np.ones(len(normals))])


def _lines(seen: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Samples within the line radius of a place where the face seen changes."""
    lines = np.zeros(seen.shape, dtype=bool)
    lines[:, 1:] |= seen[:, 1:] != seen[:, :-1]
    lines[1:] |= seen[1:] != seen[:-1]
    thick = np.zeros_like(lines)
    reach = range(-_LINE_RADIUS, _LINE_RADIUS + 1)
    for dy, dx in ((dy, dx) for dy in reach for dx in reach if dx**2 + dy**2 <= _LINE_RADIUS**2):
        thick |= np.roll(lines, (dy, dx), axis=(0, 1))  # the margin keeps lines off the border
    return thick


def _average(rgba: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean of each block of supersamples; colours weighted by their cover."""
    n = _SUPERSAMPLING
    blocks = rgba.reshape(rgba.shape[0] // n, n, rgba.shape[1] // n, n, 4)
    cover = blocks[..., 3:].mean(axis=(1, 3))
    colour = (blocks[..., :3] * blocks[..., 3:]).mean(axis=(1, 3))
    return np.concatenate([colour / np.maximum(cover, 1e-12), cover], axis=-1)
