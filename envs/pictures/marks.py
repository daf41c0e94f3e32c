"""What a picture shows beside bodies: lines, balls and arrows, the same for either painter."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from . import view as look
from .picture_scene import PictureScene, Tip

__all__ = ["Mark", "marks", "sharp_edges"]

Floats = NDArray[np.float64]

FEW_CONTACTS = 15
"""Up to which their marks have the full size."""
POINT_SIZE = 0.02
"""Radius of a dot that stands for a point, in units of the view's radius."""


@dataclass(frozen=True, eq=False)
class Mark:
    """A round line.

    Attributes:
        ends_world: ``(2, 3)`` metres; both ends of a ball are its centre.
        radius: metres.
        colour: of all of it.
        opacity: below 1 for what fades, and for the path that a ball has swept.
        arrow: whether it has a head at its second end.
    """

    ends_world: Floats
    radius: float
    colour: look.Colour
    opacity: float = 1.0
    arrow: bool = False


def marks(scene: PictureScene, stage: look.Stage) -> Iterator[Mark]:
    """All marks of a scene."""
    unit = stage.view.radius
    for line in stage.ruled:
        yield Mark(line, 0.0015 * unit, look.GRID)
    for edge in scene.object_edges_world:
        yield Mark(edge, 0.0035 * unit, look.EDGE)
    colours = look.ghost_colours(scene)
    for ghost in scene.ghosts:
        for edge in sharp_edges(ghost.vertices_world, ghost.triangles):
            yield Mark(edge, 0.0025 * unit, colours[ghost.label], ghost.opacity)
    for ray, hit in zip(_shown_rays(scene, unit), scene.ray_hits, strict=True):
        if hit:
            yield Mark(ray, 0.0045 * unit, look.RAY_HIT)
        else:
            yield Mark(ray, 0.003 * unit, look.RAY_MISSED)
            yield Mark(ray[[1, 1]], 0.012 * unit, look.RAY_MISSED)
    for tip in scene.tips:
        yield from _tip_marks(tip, unit)
    # So many contacts would hide all else if they kept their size.
    size = unit * float(np.clip(np.sqrt(FEW_CONTACTS / max(len(scene.contacts_world), 1)), 0.4, 1))
    for contact, normal in zip(scene.contacts_world, scene.normals_world, strict=True):
        yield Mark(np.stack([contact, contact]), 0.024 * size, look.CONTACT)
        if normal.any():
            end = contact + look.NORMAL_LENGTH * size * normal
            yield Mark(np.stack([contact, end]), 0.010 * size, look.CONTACT, arrow=True)


def _tip_marks(tip: Tip, unit: float) -> Iterator[Mark]:
    """A ball and what it sweeps; of a point its line, and a dot that can be seen."""
    yield Mark(tip.path_world, 0.0045 * unit, look.RAY_HIT)
    if tip.radius > 0.0:
        yield Mark(tip.path_world, tip.radius, look.RAY_HIT, 0.25)
    yield Mark(tip.path_world[[1, 1]], tip.radius or POINT_SIZE * unit, look.RAY_HIT)


def _shown_rays(scene: PictureScene, unit: float) -> Floats:
    """``(r, 2, 3)`` the last stretch of each ray: where it began is far off and tells nothing."""
    start, end = scene.rays_world[:, 0], scene.rays_world[:, 1]
    length = np.linalg.norm(end - start, axis=1, keepdims=True)
    kept = np.minimum(1.0, 0.9 * unit / np.maximum(length, 1e-12))
    return np.stack([end + (start - end) * kept, end], axis=1)


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
