"""The tree's constraints chosen by name, and what compiled kernels make of them."""

from __future__ import annotations

from collections.abc import Callable, Container

import numpy as np
from numpy.typing import NDArray

from palpate.recognizer import Constraints, Contacts, PairTables
from palpate.recognizer.tables.planar_ranges import PlanarTables

NAMES = ("distance", "angle", "component", "tilt")


def only(names: Container[str]) -> Constraints:
    """These constraints and no others."""
    return Constraints(**{name: name in names for name in NAMES})


def compiled_masks(
    pair_masks: Callable[..., None],
    tables: PairTables | PlanarTables,
    contacts: Contacts,
    constraints: Constraints,
) -> NDArray[np.bool_]:
    """(n, n, f, f) what a kernel allows of solids or of the plane, unpacked; pairs i < j only."""
    count, faces = len(contacts), tables.face_count
    words = -(-faces // 64)
    bits = np.zeros((count, words * 64), np.uint8)
    bits[:, :faces] = 1
    domains = np.packbits(bits, axis=1, bitorder="little").view(np.uint64).copy()
    masks = np.zeros((count, count, faces, words), np.uint64)
    pair_masks(
        contacts.positions,
        contacts.normals,
        contacts.position_error,
        contacts.normal_error,
        tables.distance_min,
        tables.distance_max,
        tables.angle,
        tables.component_min,
        tables.component_max,
        tables.tilt_min,
        tables.tilt_max,
        domains,
        0,
        constraints.bits,
        masks,
    )
    unpacked = np.unpackbits(masks.view(np.uint8), axis=-1, bitorder="little")
    assert not unpacked[..., faces:].any()
    return unpacked[..., :faces].astype(bool)
