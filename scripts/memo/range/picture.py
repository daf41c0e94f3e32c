"""Range images, and the poses that fit their points, drawn as the scanner sees them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import RigidTransform

from ....envs.probe_env import INCH
from ....envs.scene.scene import PLANE, ProbeScene
from ....envs.sensors.grid import centred_ticks
from ....envs.sensors.range_image import RangeView, take_image
from ....envs.sensors.range_sensor import MEMO_SPACING
from ....recognizer import Contacts, pose_difference
from ....recognizer.models.rays import cast_rays
from ...report.drawing import in_style, svg_of
from ...report.plots import COLOURS

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Floats = NDArray[np.float64]

PIXELS = 220
"""Of a side of a picture of a pose."""
FINER = 2
"""Rays a pixel and direction."""
MARGIN = 0.08
"""Around the object, in its diameters."""
MOST_POSES = 4
LIGHT = np.array([-0.35, -0.55, 0.75]) / np.linalg.norm([-0.35, -0.55, 0.75])
"""Towards the lamp: right, down, towards the eye."""
AMBIENT = 0.35
RIGHT_BODY, WRONG_BODY = (0.62, 0.77, 0.92), (0.97, 0.80, 0.66)
INK = (0.13, 0.15, 0.19)


@dataclass(frozen=True, eq=False)
class FoundPose:
    """A pose that fits."""

    pose: RigidTransform
    """Model to world."""
    right: bool
    """Whether the right interpretation is among those that have it."""


@dataclass(frozen=True, eq=False)
class PictureRow:
    """A range image, its points, and the poses that fit them."""

    title: str
    scene: ProbeScene
    """With the object, wherever it is put."""
    T_world_object: RigidTransform
    """Where the object truly is."""
    view: RangeView
    """From where the scanner looks."""
    width: float
    """Side of the image, metres."""
    range_error: float
    """Metres."""
    contacts: Contacts
    poses: Sequence[FoundPose]

    def across_view(self, points_world: Floats) -> Floats:
        """(n, 2) places of points in the image, metres to the right and down."""
        axes = np.stack([self.view.right_world, self.view.down_world])
        return (points_world - self.view.origin_world) @ axes.T

    def window(self) -> tuple[Floats, float]:
        """(2,) middle and half the side of a square that the object fits into, metres."""
        model = self.scene.model
        places = self.across_view(self.T_world_object.apply(model.vertices))
        low, high = places.min(axis=0), places.max(axis=0)
        half = float((high - low).max()) / 2.0 + MARGIN * model.diameter
        return (low + high) / 2.0, half


@in_style
def draw_views(rows: Sequence[PictureRow]) -> str:
    """A row of pictures for each view: what was scanned, then each pose.

    Returns:
        The drawing as SVG.
    """
    import matplotlib.pyplot as plt

    columns = 1 + max(min(len(row.poses), MOST_POSES) for row in rows)
    size = (2.4 * columns, 2.5 * len(rows))
    figure, grid = plt.subplots(
        len(rows), columns, figsize=size, squeeze=False, layout="constrained"
    )
    for panels, row in zip(grid, rows, strict=True):
        for panel in panels:
            panel.set_axis_off()
        _draw_scan(panels[0], row)
        for panel, found in zip(panels[1:], row.poses, strict=False):
            _draw_pose(panel, row, found)
    return svg_of(figure)


def _draw_scan(panel: Axes, row: PictureRow) -> None:
    """The range image, shaded by its slopes, the plane paler than the object."""
    columns, rows = (centred_ticks(int(row.width / step) + 1, step) for step in MEMO_SPACING)
    row.scene.place(row.T_world_object)
    image = take_image(
        row.scene,
        row.view,
        columns,
        rows,
        noise=row.range_error,
        distribution="uniform",
        rng=np.random.default_rng(0),
    )
    # A plane whose depth grows to the right faces right.
    slopes = np.gradient(image.depths, columns, rows)
    normals = np.stack([*slopes, np.ones_like(image.depths)], axis=-1)
    light = _light_on(normals / np.linalg.norm(normals, axis=-1, keepdims=True))
    light = np.where(image.outcomes == PLANE, 0.75 + 0.25 * light, light)
    edges = (columns[0], columns[-1], rows[-1], rows[0])
    panel.imshow(light.T, extent=edges, interpolation="none", cmap="gray", vmin=0.0, vmax=1.0)
    _finish(panel, row, row.title)


def _draw_pose(panel: Axes, row: PictureRow, found: FoundPose) -> None:
    """The object at a pose, shaded, its edges dark."""
    model, view, count = row.scene.model, row.view, FINER * PIXELS
    middle, half = row.window()
    ticks = centred_ticks(count, 2.0 * half / count)
    starts = view.starts(middle[0] + ticks, middle[1] + ticks).reshape(-1, 3)
    hits = cast_rays(model, found.pose, starts, np.tile(view.direction_world, (len(starts), 1)))
    faces = hits.faces.reshape(count, count)
    axes = np.stack([view.right_world, view.down_world, -view.direction_world])
    light = _light_on(found.pose.rotation.apply(model.normals.copy()) @ axes.T)
    body = np.array(RIGHT_BODY if found.right else WRONG_BODY)
    colours = np.where((faces < 0)[..., None], 1.0, light[faces][..., None] * body)
    colours[_edges(faces)] = INK
    small = colours.reshape(PIXELS, FINER, PIXELS, FINER, 3).mean(axis=(1, 3))
    right, down = middle
    edges = (right - half, right + half, down + half, down - half)
    panel.imshow(small.transpose(1, 0, 2), extent=edges, interpolation="none")
    off = pose_difference(model, found.pose, row.T_world_object)
    kind = "right" if found.right else "wrong"
    _finish(
        panel,
        row,
        f"{kind}: off by {np.degrees(off.rotation):.2f}°, {off.translation / INCH:.3f} in",
    )


def _finish(panel: Axes, row: PictureRow, title: str) -> None:
    """The points, a title, and the part of the image where the object is."""
    right, down = row.across_view(row.contacts.positions).T
    panel.plot(right, down, "o", color=COLOURS[1], markersize=3.5, markeredgecolor="w")
    middle, half = row.window()
    panel.set(
        title=title,
        xlim=(middle[0] - half, middle[0] + half),
        ylim=(middle[1] + half, middle[1] - half),
    )


def _light_on(normals: Floats) -> Floats:
    """(...) brightness of planes of (..., 3) unit normals: right, down, towards the eye."""
    return AMBIENT + (1.0 - AMBIENT) * np.clip(normals @ LIGHT, 0.0, None)


def _edges(faces: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Where the face seen changes from one ray to the next."""
    edges = np.zeros(faces.shape, bool)
    across, along = faces[1:] != faces[:-1], faces[:, 1:] != faces[:, :-1]
    edges[1:] |= across
    edges[:-1] |= across
    edges[:, 1:] |= along
    edges[:, :-1] |= along
    return edges
