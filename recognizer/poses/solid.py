"""A solid of a library, with all that is built of it once."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..contacts.support import FOOTING, StableFace, hull_corners, stable_faces
from ..models.features import Features, all_features, face_features, with_squares
from ..models.permutations import feature_permutations
from ..models.polyhedron import Polyhedron
from ..tables.ranges import PairTables, pack_tables
from ..tables.table_cache import cached_tables
from .fits.pose import KernelModel
from .shape import Shape, shape_of

Bits = NDArray[np.uint64]
"""Sets of features: of each, one bit in rows of 64-bit words."""


@dataclass(frozen=True, eq=False)
class SolidEntry:
    """A solid of a library, with all that is built of it once."""

    model: Polyhedron
    features: Features
    tables: PairTables
    kernel: KernelModel
    packed: NDArray[np.float64]
    """The tables as the kernels read them."""

    @classmethod
    def of(cls, model: Polyhedron, *, edges: bool, folder: Path | None) -> SolidEntry:
        """Build tables and test of a solid.

        Args:
            model: the solid.
            edges: whether contacts may lie on edges and vertices too.
            folder: one to keep tables in; none, and they are built anew.
        """
        features = all_features(model) if edges else face_features(model)
        tables = (
            PairTables.of(model, features)
            if folder is None
            else cached_tables(model, folder, features=features if edges else None)
        )
        return cls(model, features, tables, KernelModel(model, features), pack_tables(tables))

    @cached_property
    def shape(self) -> Shape:
        """The features as the cover's kernels read them."""
        return shape_of(self.features, self.kernel.radius)

    @cached_property
    def permutations(self) -> tuple[NDArray[np.int32], float]:
        """(g, f) where each symmetry of the solid takes each feature, and by how much it misses."""
        return feature_permutations(self.model, self.features)

    @cached_property
    def orbits(self) -> Bits:
        """Bit set of one feature of each orbit under the symmetries."""
        return bit_set(np.unique(self.permutations[0].min(axis=0)), len(self.features))

    @cached_property
    def by_kind(self) -> Bits:
        """(4, w) the features that a contact of each kind may be on (see `contacts`)."""
        faces, count = self.model.face_count, len(self.features)
        ends = (0, faces, faces + self.features.edge_count, count)
        spans = [(0, count), *pairwise(ends)]
        return np.array([bit_set(np.arange(*span), count) for span in spans])

    @cached_property
    def corners(self) -> NDArray[np.float64]:
        """(v, 3) the corners of its convex hull, object frame, metres."""
        return hull_corners(self.model)

    @cached_property
    def stable_faces(self) -> list[StableFace]:
        """The faces of its convex hull that the solid can stand on."""
        return stable_faces(self.model)

    @cached_property
    def standing(self) -> SolidEntry:
        """The same with these faces' planes among the features, behind all others."""
        faces, model = self.stable_faces, self.model
        normals = np.array([face.normal for face in faces])
        heights = np.array([face.offset for face in faces]) - normals @ model.centroid
        features = with_squares(
            self.features,
            normals,
            model.centroid + heights[:, None] * normals,
            FOOTING * model.diameter,
        )
        tables = PairTables.of(model, features)
        return SolidEntry(
            model, features, tables, KernelModel(model, features), pack_tables(tables)
        )


def bit_set(members: NDArray[np.integer], count: int) -> Bits:
    """A set of some of ``count`` features, as one row of words."""
    bits = np.zeros(-(-count // 64), np.uint64)
    members = members.astype(np.uint64)
    np.bitwise_or.at(bits, members >> np.uint64(6), np.uint64(1) << (members & np.uint64(63)))
    return bits
