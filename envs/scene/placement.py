"""How an object is placed: held at any orientation across the plane, or resting on it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import RigidTransform, Rotation

from ...recognizer import Polyhedron, SupportPlane
from ...recognizer.contacts.support import COPLANAR
from ..collision.collision import collision_parts
from .drop import DropScene, onto_plane
from .resting_faces import resting_faces

Floats = NDArray[np.float64]

RESTING_ERROR = 2.0 * COPLANAR
"""How far off the plane a corner of the face stood on may be, as a share of the diameter. Corners
count as in one face within `COPLANAR`; the same again is far above what a turn rounds."""


class Placement(Protocol):
    """How poses of objects are drawn, and what a prober may know of them."""

    def draw(self, rng: np.random.Generator, model: Polyhedron) -> RigidTransform:
        """A pose, model to world."""
        ...

    def support(self, model: Polyhedron) -> SupportPlane | None:
        """The support plane that the poses keep to, if they do."""
        ...


@dataclass(frozen=True, kw_only=True)
class AcrossPlane:
    """Held at any orientation, partly below the plane z = 0 (memo, Section 4.4)."""

    offset: float
    """Largest distance of the object's centroid from the origin along the plane, metres."""
    sunk: tuple[float, float] = (0.1, 0.5)
    """Least and greatest share of its height below the plane."""

    def __post_init__(self) -> None:
        _check_offset(self.offset)
        low, high = self.sunk
        if not 0.0 <= low <= high <= 1.0:
            raise ValueError(f"sunk is {self.sunk}; it must be two shares, 0 <= least <= most <= 1")

    def draw(self, rng: np.random.Generator, model: Polyhedron) -> RigidTransform:
        """A pose, model to world, uniform in orientation, offset and share sunk."""
        rotation = Rotation.random(rng=rng)
        heights = rotation.apply(model.vertices.copy())[:, 2]
        sunk = rng.uniform(*self.sunk)
        lift = -heights.min() - sunk * np.ptp(heights)
        return _around_origin(rng, rotation, model, self.offset, lift)

    def support(self, model: Polyhedron) -> SupportPlane | None:
        """None: it reaches through the plane."""
        return None


@dataclass(frozen=True, kw_only=True)
class Resting:
    """Standing on the plane z = 0, its lowest corner at z = 0 exactly."""

    offset: float
    """Largest distance of the object's centroid from the origin along the plane, metres."""
    mode: Literal["placed", "dropped"] = "placed"
    """`placed`: on a stable face drawn by how often a drop without inertia ends on it. `dropped`:
    on the face on which a simulated drop ends. Simulated contacts are soft, so the body then tilts
    and sinks in a little (measured: up to 6e-5 rad and a hundred-thousandth of its size); what is
    returned has the face exactly on the plane."""
    parts_folder: Path | None = None
    """Where collision parts are kept; see `collision_parts`."""

    def __post_init__(self) -> None:
        _check_offset(self.offset)
        if self.mode not in ("placed", "dropped"):
            raise ValueError(f"mode is {self.mode!r}; it must be 'placed' or 'dropped'")

    def draw(self, rng: np.random.Generator, model: Polyhedron) -> RigidTransform:
        """A pose, model to world, with any turn about the vertical.

        Raises:
            ValueError: dropped, it never comes to rest, or its collision parts stray too far.
        """
        if self.mode == "placed":
            resting = resting_faces(model)
            face = resting.faces[int(rng.choice(len(resting.faces), p=resting.shares))]
            turn = Rotation.from_rotvec([0.0, 0.0, rng.uniform(0.0, 2.0 * np.pi)])
            rotation = turn * onto_plane(Rotation.identity(), face)
        else:
            parts = collision_parts(model, folder=self.parts_folder).parts
            rotation = DropScene(model, parts).drop(rng).upright
        lift = -float(rotation.apply(model.vertices.copy())[:, 2].min())
        return _around_origin(rng, rotation, model, self.offset, lift)

    def support(self, model: Polyhedron) -> SupportPlane | None:
        """The plane z = 0, on which the object stands."""
        return SupportPlane(error=RESTING_ERROR * model.diameter, resting=True)


def make_placement(name: str, offset: float) -> Placement:
    """The placement of a name: "across", "resting" or "dropped".

    Raises:
        ValueError: another name.
    """
    if name == "across":
        return AcrossPlane(offset=offset)
    if name == "resting":
        return Resting(offset=offset)
    if name == "dropped":
        return Resting(offset=offset, mode="dropped")
    raise ValueError(f"placement is {name!r}; it must be 'across', 'resting' or 'dropped'")


def _around_origin(
    rng: np.random.Generator, rotation: Rotation, model: Polyhedron, offset: float, lift: float
) -> RigidTransform:
    """A pose with the centroid above a point uniform in the disc of radius ``offset``."""
    centroid = rotation.apply(model.centroid.copy())
    distance, bearing = offset * np.sqrt(rng.random()), rng.uniform(0.0, 2.0 * np.pi)
    along = distance * np.array([np.cos(bearing), np.sin(bearing)]) - centroid[:2]
    return RigidTransform.from_components([*along, lift], rotation)


def _check_offset(offset: float) -> None:
    if not (np.isfinite(offset) and offset >= 0.0):
        raise ValueError(f"offset is {offset:g} m; it must be zero or more")
