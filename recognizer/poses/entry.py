"""A model of a library, with all that is built of it once."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..contacts.contacts import Contacts
from ..contacts.support import FOOTING, StableFace, hull_corners, stable_faces
from ..models.features import Features, all_features, face_features, with_squares
from ..models.permutations import feature_permutations
from ..models.polygon import Polygon
from ..models.polyhedron import Polyhedron
from ..models.prism import Prism, outline_features
from ..tables.planar_ranges import PlanarTables
from ..tables.ranges import PairTables, pack_tables
from ..tables.table_cache import cached_tables
from .fits.pose import KernelModel
from .shape import Shape, shape_of

Bits = NDArray[np.uint64]
"""Sets of features: of each, one bit in rows of 64-bit words."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Entry:
    """What a search for poses reads of a model."""

    body: Polyhedron | Prism
    """It, in space."""
    features: Features
    kernel: KernelModel
    packed: NDArray[np.float64]
    """Its tables of pairs as the kernels read them."""

    @property
    def flat(self) -> bool:
        """Whether it is an outline: only turned about z and shifted across it."""
        return isinstance(self.body, Prism)

    @cached_property
    def shape(self) -> Shape:
        """The features as the cover's kernels read them."""
        return shape_of(self.features, self.kernel.radius, flat=self.flat)

    @cached_property
    def permutations(self) -> tuple[NDArray[np.int32], float]:
        """(g, f) where each symmetry takes each feature, and by how much it misses."""
        return feature_permutations(self.body, self.features)

    @cached_property
    def orbits(self) -> Bits:
        """Bit set of one feature of each orbit under the symmetries."""
        return bit_set(np.unique(self.permutations[0].min(axis=0)), len(self.features))

    @cached_property
    def by_kind(self) -> Bits:
        """(4, w) the features that a contact of each kind may be on (see `contacts`)."""
        faces, count = self.features.face_count, len(self.features)
        ends = (0, faces, faces + self.features.edge_count, count)
        spans = [(0, count), *pairwise(ends)]
        return np.array([bit_set(np.arange(*span), count) for span in spans])

    def in_space(self, contacts: Contacts) -> Contacts:
        """Contacts with it as contacts with `body`."""
        return contacts


@dataclass(frozen=True, eq=False, kw_only=True)
class SolidEntry(Entry):
    """A solid of a library."""

    model: Polyhedron
    tables: PairTables

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
        return cls.made(model, features, tables)

    @classmethod
    def made(cls, model: Polyhedron, features: Features, tables: PairTables) -> SolidEntry:
        """The entry of a solid, with tables of some features of it."""
        return cls(
            body=model,
            features=features,
            kernel=KernelModel(model, features),
            packed=pack_tables(tables),
            model=model,
            tables=tables,
        )

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
        return SolidEntry.made(model, features, PairTables.of(model, features))


@dataclass(frozen=True, eq=False, kw_only=True)
class OutlineEntry(Entry):
    """An outline of a library (memo, Section 4.1): three degrees of freedom."""

    model: Polygon
    tables: PlanarTables

    @classmethod
    def of(cls, model: Polygon) -> OutlineEntry:
        """Build the tables of an outline."""
        body, features, tables = Prism.of(model), outline_features(model), PlanarTables.of(model)
        return cls(
            body=body,
            features=features,
            kernel=KernelModel(body, features),
            packed=pack_tables(tables.in_space(features)),
            model=model,
            tables=tables,
        )

    def in_space(self, contacts: Contacts) -> Contacts:
        """Contacts of the plane as contacts with the prism, off whose sides its own points lie."""
        columns = (contacts.positions, contacts.normals, contacts.approaches)
        height = np.zeros((len(contacts), 1))
        positions, normals, approaches = (np.hstack([column, height]) for column in columns)
        return Contacts.trusted(
            positions,
            normals,
            position_error=contacts.position_error + self.model.straightness,
            normal_error=contacts.normal_error,
            approaches=approaches,
            kinds=contacts.kinds,
        )


def bit_set(members: NDArray[np.integer], count: int) -> Bits:
    """A set of some of ``count`` features, as one row of words."""
    bits = np.zeros(-(-count // 64), np.uint64)
    members = members.astype(np.uint64)
    np.bitwise_or.at(bits, members >> np.uint64(6), np.uint64(1) << (members & np.uint64(63)))
    return bits
