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
    "mark_size",
    "mesh_key",
    "sharp_edges",
    "shown_rays",
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

POINT_SIZE = 0.02  # radius of a dot that stands for a point, in the same units
FEW_CONTACTS = 15  # up to which their marks have the full size
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

    def project(self, points_world: Floats, size: tuple[int, int]) -> Floats:
        """``(..., 3)``: pixels right of and below the top left corner, and depth in metres."""
        width, height = size
        right, up, back = np.moveaxis((points_world - self.centre) @ self.axes.T, -1, 0)
        depth = self.distance - back
        scale = height / 2 / np.tan(FIELD_OF_VIEW / 2) / depth
        return np.stack([width / 2 + right * scale, height / 2 - up * scale, depth], axis=-1)


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


def mesh_key(scene: PictureScene, view: View, size: tuple[int, int]) -> bytes:
    """Differs where the meshes of a scene, their colours, the camera or the picture's size do."""
    meshes = [(scene.object_vertices_world, scene.object_triangles)]
    meshes += [(ghost.vertices_world, ghost.triangles) for ghost in scene.ghosts]
    facts = np.array([*view.numbers, *size, *np.ravel([*ghost_colours(scene).values()])])
    arrays = [facts, *(array for mesh in meshes for array in mesh)]
    return b"".join(str(array.shape).encode() + array.tobytes() for array in arrays)


def mark_size(scene: PictureScene) -> float:
    """How large marks of contacts are drawn, 1 but where so many would hide all else."""
    return float(np.clip(np.sqrt(FEW_CONTACTS / max(len(scene.contacts_world), 1)), 0.4, 1.0))


def shown_rays(scene: PictureScene, view: View) -> Floats:
    """``(r, 2, 3)`` the last stretch of each ray: where it began is far off and tells nothing."""
    start, end = scene.rays_world[:, 0], scene.rays_world[:, 1]
    length = np.linalg.norm(end - start, axis=1, keepdims=True)
    kept = np.minimum(1.0, 0.9 * view.radius / np.maximum(length, 1e-12))
    return np.stack([end + (start - end) * kept, end], axis=1)


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


def sharp_edges(vertices: Floats, triangles: NDArray[np.int64]) -> Floats:
    """``(e, 2, 3)`` the edges between triangles that are not coplanar."""
    scale = np.ptp(vertices, axis=0).max() or 1.0
    _, merged = np.unique(np.round(vertices / scale, 7), axis=0, return_inverse=True)
    corners = vertices[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)

    sides = np.sort(merged.reshape(-1)[triangles][:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2))
    ends = vertices[triangles[:, [[0, 1], [1, 2], [2, 0]]]].reshape(-1, 2, 3)
    owner = np.repeat(np.arange(len(triangles)), 3)
    _, first, edge = np.unique(sides, axis=0, return_index=True, return_inverse=True)
    # Unit normals of an edge's n triangles add up to length n only where all of them agree.
    total = np.zeros((len(first), 3))
    np.add.at(total, edge.reshape(-1), normals[owner])
    number = np.bincount(edge.reshape(-1))
    return ends[first[(np.linalg.norm(total, axis=1) < 0.9995 * number) | (number == 1)]]


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
