"""What a picture shows of its scene, and from where: the part that all renderers share."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from .picture_scene import PictureScene

__all__ = [
    "CONTACT",
    "EDGE",
    "GRID",
    "NORMAL_LENGTH",
    "OBJECT",
    "PLANE",
    "RAY_HIT",
    "RAY_MISSED",
    "Stage",
    "View",
    "frame",
    "ghost_colours",
    "grid",
]

Floats = NDArray[np.float64]
Colour = tuple[float, float, float]


def _rgb(code: str) -> Colour:
    red, green, blue = (int(code[i : i + 2], 16) / 255 for i in (0, 2, 4))
    return red, green, blue


# Okabe and Ito's palette, which colour-blind readers can tell apart.
OBJECT = _rgb("9AD2F2")  # their sky blue, paler, so that what lies on it stands out
CONTACT = _rgb("D55E00")
RAY_HIT = _rgb("0072B2")
GHOSTS = tuple(map(_rgb, ("E69F00", "CC79A7", "009E73", "F0E442")))
RAY_MISSED = _rgb("8A8A8A")
EDGE = _rgb("1E2A33")
PLANE = _rgb("D9DCDF")
GRID = _rgb("A9AFB5")

FIELD_OF_VIEW = np.radians(28.0)  # vertical; narrow, so that parallel edges look nearly parallel
ELEVATION = np.radians(-30.0)
FILLED_WIDTH, FILLED_HEIGHT = 0.86, 0.70  # the share of the picture left to the object by captions

NORMAL_LENGTH = 0.21  # of a normal's arrow, in units of the view's radius


@dataclass(frozen=True, eq=False)
class View:
    """A perspective camera that looks at ``centre``.

    Attributes:
        centre: ``(3,)`` the point in the middle of the picture, metres, world.
        azimuth: heading of the line of sight about z, radians.
        elevation: angle of the line of sight over the horizon, radians; negative looks down.
        distance: from camera to ``centre``, metres.
        radius: half the diagonal of what is framed, metres: the unit of all line widths.
    """

    centre: Floats
    azimuth: float
    elevation: float
    distance: float
    radius: float

    @property
    def numbers(self) -> Floats:
        """``(6,)`` centre, azimuth, elevation, distance: all that decides what is seen."""
        return np.array([*self.centre, self.azimuth, self.elevation, self.distance])

    @cached_property
    def axes(self) -> Floats:
        """``(3, 3)`` rows: right, up and towards the viewer, world frame."""
        return _axes(self.azimuth, self.elevation)

    @property
    def towards_light(self) -> Floats:
        """``(3,)`` from above, a little from the left and from behind the viewer; world frame."""
        right, up, back = self.axes
        return 0.75 * up - 0.5 * right + 0.35 * back

    def project(self, points_world: Floats, size: tuple[int, int]) -> Floats:
        """``(..., 3)``: pixels right of and below the top left corner, and depth in metres."""
        width, height = size
        right, up, back = np.moveaxis((points_world - self.centre) @ self.axes.T, -1, 0)
        depth = self.distance - back
        scale = self.pixels_per_metre(size) / depth
        return np.stack([width / 2 + right * scale, height / 2 - up * scale, depth], axis=-1)

    def pixels_per_metre(self, size: tuple[int, int]) -> float:
        """How large a metre is at a depth of one metre."""
        return size[1] / 2 / float(np.tan(FIELD_OF_VIEW / 2))


@dataclass(frozen=True, eq=False)
class Stage:
    """What stays as it is from picture to picture: the camera and the ruled plane.

    Attributes:
        view: the camera.
        ruled: ``(g, 2, 3)`` lines on the plane; see `grid`.
        step: between the lines, metres.
    """

    view: View
    ruled: Floats
    step: float

    @classmethod
    def of(cls, scene: PictureScene, size: tuple[int, int], room: float = 1.0) -> Stage:
        """The stage on which all of ``scene`` is seen.

        Args:
            scene: what is to be seen.
            size: of the picture, (width, height) pixels.
            room: how many times farther away the camera is than it must be.
        """
        view = frame(scene, size)
        view = replace(view, distance=room * view.distance)
        return cls(view, *grid(scene, view))

    def holds(self, points_world: Floats, size: tuple[int, int]) -> bool:
        """Whether all ``(n, 3)`` points are seen, clear of the captions."""
        x, y, depth = self.view.project(points_world, size).T
        wide, tall = (1 - FILLED_WIDTH) / 4 * size[0], (1 - FILLED_HEIGHT) / 4 * size[1]
        inside = (x > wide) & (x < size[0] - wide) & (y > tall) & (y < size[1] - tall)
        return bool((inside & (depth > 0)).all())


def frame(scene: PictureScene, size: tuple[int, int]) -> View:
    """The view that shows the object and most contacts, and the ghosts as far as they are near."""
    solid = np.concatenate([scene.object_vertices_world, scene.contacts_world])
    low, high = solid.min(axis=0), solid.max(axis=0)
    radius = float(np.linalg.norm(high - low)) / 2 or 1.0
    tips = scene.contacts_world + NORMAL_LENGTH * radius * scene.normals_world
    around = [np.clip(g.vertices_world, low - radius / 3, high + radius / 3) for g in scene.ghosts]
    points = np.concatenate([solid, tips, *around])

    azimuth = _azimuth_facing(scene.normals_world)
    axes = _axes(azimuth, ELEVATION)
    seen = points @ axes.T
    middle = (seen.min(axis=0) + seen.max(axis=0)) / 2
    right, up, back = (seen - middle).T
    tangent = np.tan(FIELD_OF_VIEW / 2)
    # A point is inside when |right| <= tangent * aspect * (distance - back), likewise for up.
    wide = back + np.abs(right) / (FILLED_WIDTH * tangent * size[0] / size[1])
    tall = back + np.abs(up) / (FILLED_HEIGHT * tangent)
    return View(middle @ axes, azimuth, ELEVATION, float(max(wide.max(), tall.max())), radius)


def ghost_colours(scene: PictureScene) -> dict[str, Colour]:
    """A colour for each label, in the order of the ghosts."""
    numbers: dict[str, int] = {}
    for ghost in scene.ghosts:
        numbers.setdefault(ghost.label, len(numbers) if ghost.colour is None else ghost.colour)
    return {label: GHOSTS[number % len(GHOSTS)] for label, number in numbers.items()}


def grid(scene: PictureScene, view: View) -> tuple[Floats, float]:
    """``(g, 2, 3)`` lines ruled on the plane under the scene, and the step between them.

    The step is 1, 2 or 5 times a power of ten metres; the first line is the plane's border.
    """
    shown = np.concatenate([scene.object_vertices_world, scene.contacts_world])[:, :2]
    rough = view.radius / 5
    decade = 10.0 ** np.floor(np.log10(rough))
    step = float(decade * min((1, 2, 5, 10), key=lambda n: abs(np.log(n * decade / rough))))
    low = np.floor((shown.min(axis=0) - 0.7 * view.radius) / step) * step
    high = np.ceil((shown.max(axis=0) + 0.7 * view.radius) / step) * step
    xs, ys = (np.arange(a, b + step / 2, step) for a, b in zip(low, high, strict=True))
    lines = [[(x, low[1]), (x, high[1])] for x in xs] + [[(low[0], y), (high[0], y)] for y in ys]
    flat = np.array(lines)
    return np.concatenate([flat, np.full((*flat.shape[:2], 1), scene.plane_height)], axis=2), step


def _axes(azimuth: float, elevation: float) -> Floats:
    flat = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    forward = np.cos(elevation) * flat + np.array([0.0, 0.0, np.sin(elevation)])
    right = np.array([np.sin(azimuth), -np.cos(azimuth), 0.0])
    return np.stack([right, np.cross(right, forward), -forward])


def _azimuth_facing(normals_world: Floats) -> float:
    """The heading against which the felt faces turn most openly."""
    quarters = np.arange(0.0, 360.0, 90.0)  # and none along an axis, where a box looks flat
    headings = np.radians(np.add.outer(quarters, [135.0, 115.0, 125.0, 145.0, 155.0]).reshape(-1))
    towards = -np.stack([np.cos(headings), np.sin(headings)], axis=1)
    openness = np.maximum(normals_world[:, :2] @ towards.T, 0.0).sum(axis=0)
    return float(headings[np.argmax(np.round(openness, 9))])
