"""What a picture shows of an episode: the object, the finger's rays, what it felt, the rivals.

All lengths are metres, all coordinates are in the world frame, z points up.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["Ghost", "PictureScene", "Tip"]


@dataclass(frozen=True, eq=False)
class Ghost:
    """A rival: an object at a pose that the contacts allow.

    Attributes:
        vertices_world: ``(v, 3)`` float64.
        triangles: ``(t, 3)`` int64 indices, counter-clockwise seen from outside.
        label: its line in the legend; ghosts of one label share a line and a colour.
        colour: the number of its colour; None takes one that follows from the labels.
        opacity: 1 for a ghost as plain as ghosts are, less for one that fades.
    """

    vertices_world: NDArray[np.float64]
    triangles: NDArray[np.int64]
    label: str
    colour: int | None = None
    opacity: float = 1.0

    def __post_init__(self) -> None:
        _coerce(self, "vertices_world", np.float64, (3,))
        _coerce(self, "triangles", np.int64, (3,))


@dataclass(frozen=True, eq=False)
class Tip:
    """A finger's tip under way.

    Attributes:
        path_world: ``(2, 3)`` where the path that is shown begins, and where the tip's centre is.
        radius: of a ball, metres; 0 for a point.
    """

    path_world: NDArray[np.float64]
    radius: float


@dataclass(frozen=True, eq=False, kw_only=True)
class PictureScene:
    """Everything that a picture shows.

    Attributes:
        object_vertices_world: ``(v, 3)`` float64, the object as it truly lies.
        object_triangles: ``(t, 3)`` int64 indices, counter-clockwise seen from outside.
        object_edges_world: ``(e, 2, 3)`` outline segments of the planar faces; may be empty.
        rays_world: ``(r, 2, 3)`` start and end of each ray that the finger took.
        ray_hits: ``(r,)`` bool, whether the ray ended on the object.
        contacts_world: ``(n, 3)`` measured positions.
        normals_world: ``(n, 3)`` measured outward unit normals. A shorter one has a shorter arrow,
            one of zero has none.
        ghosts: the rivals, drawn translucent.
        tips: fingers under way.
        plane_height: z of the support plane. The object may reach below it.
        title: one line, large.
        subtitle: one line below it.

    Raises:
        ValueError: an array has another shape, or arrays that belong together differ in length.
    """

    object_vertices_world: NDArray[np.float64]
    object_triangles: NDArray[np.int64]
    object_edges_world: NDArray[np.float64]
    rays_world: NDArray[np.float64]
    ray_hits: NDArray[np.bool_]
    contacts_world: NDArray[np.float64]
    normals_world: NDArray[np.float64]
    ghosts: tuple[Ghost, ...] = ()
    tips: tuple[Tip, ...] = ()
    plane_height: float = 0.0
    title: str = ""
    subtitle: str = ""

    def __post_init__(self) -> None:
        _coerce(self, "object_vertices_world", np.float64, (3,))
        _coerce(self, "object_triangles", np.int64, (3,))
        _coerce(self, "object_edges_world", np.float64, (2, 3))
        _coerce(self, "rays_world", np.float64, (2, 3))
        _coerce(self, "ray_hits", np.bool_, ())
        _coerce(self, "contacts_world", np.float64, (3,))
        _coerce(self, "normals_world", np.float64, (3,))
        for one, other in (("rays_world", "ray_hits"), ("contacts_world", "normals_world")):
            lengths = len(getattr(self, one)), len(getattr(self, other))
            if lengths[0] != lengths[1]:
                raise ValueError(f"{one} has {lengths[0]} rows but {other} has {lengths[1]}")
        if not len(self.object_vertices_world):
            raise ValueError("object_vertices_world is empty: there is nothing to draw")


def _coerce(owner: object, name: str, dtype: type, row_shape: tuple[int, ...]) -> None:
    value: ArrayLike = getattr(owner, name)
    array = np.ascontiguousarray(value, dtype=dtype)
    if array.size == 0:
        array = array.reshape(0, *row_shape)
    if array.ndim != 1 + len(row_shape) or array.shape[1:] != row_shape:
        wanted = ", ".join(["n", *map(str, row_shape)])
        raise ValueError(f"{name} has shape {array.shape}, not ({wanted})")
    object.__setattr__(owner, name, array)
