"""A solid's features, and contacts with it, as the cover's kernels read them."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..contacts.contacts import APPROACH_ERROR, Contacts
from ..models.features import Features

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

TANGENTS = 8
"""Half-planes about a cone of normals."""
MOST_DIRECTIONS = 24
"""Directions of slabs."""
LIKE = 1.0 - 1e-6
"""Cosine of normals that one direction stands for."""


class Shape(NamedTuple):
    """Features of a solid; lengths are over its radius, half its diameter; object frame."""

    normals: Floats
    """(f, 3) unit, of an edge or vertex the middle of its cone."""
    half_angles: Floats
    """(f,) radians."""
    cone_start: Ints
    """(f + 1,) the first of each feature's ..."""
    cone_sides: Floats
    """... (c, 3) unit directions that no normal of its cone leans towards."""
    first: Ints
    """(f + 1,) the first convex piece of each feature, as a polygon."""
    side_start: Ints
    """(p + 1,) the first half-space of each polygon; the first f are the features' hulls."""
    sides: Floats
    """(k, 3) outward unit normals of half-spaces that hold the polygon, ..."""
    limits: Floats
    """(k,) ... and how far out along them it reaches."""
    directions: Floats
    """(d, 3) unit directions, the axes first."""
    slabs: Floats
    """(f, d, 2) the extent of each feature's hull along each direction."""
    radius: float
    """Metres."""
    flat: bool
    """Whether poses are of the plane: turns about z, shifts across it."""


class Touches(NamedTuple):
    """Contacts with a solid; lengths are over its radius; world frame."""

    arms: Floats
    """(n, 3) positions less their mean."""
    normals: Floats
    """(n, 3) measured unit normals."""
    reaches: Floats
    """(n,) bounds on positions."""
    errors: Floats
    """(n,) bounds on normals, radians."""
    fronts: Floats
    """(n, 3) the way back along each approach, unit; zero where that is unknown."""
    front_errors: Floats
    """(n,) how far from it a normal may be, radians; half a turn where it is unknown."""
    mean: Floats
    """(3,) of the positions, metres."""


def touches_of(contacts: Contacts, radius: float) -> Touches:
    """Contacts as the kernels read them, for a solid of a radius (metres)."""
    mean = contacts.positions.mean(axis=0)
    return Touches(
        (contacts.positions - mean) / radius,
        contacts.normals.copy(),
        contacts.position_error / radius,
        contacts.normal_error.copy(),
        -contacts.approaches,
        np.where(contacts.approach_known, 0.5 * np.pi + APPROACH_ERROR, np.pi),
        mean,
    )


def shape_of(features: Features, radius: float, *, flat: bool = False) -> Shape:
    """Features as the kernels read them.

    Args:
        features: of a solid.
        radius: what lengths are taken over, metres.
        flat: whether poses are of the plane.
    """
    corners = features.corners / radius
    start = features.start
    count = len(features)
    owner = np.empty(len(start) - 1, np.int64)
    owner[:count] = np.arange(count)
    for f in range(count):
        owner[features.first[f] : features.first[f + 1]] = f
    sides, limits, side_start = [], [], [0]
    for p in range(len(start) - 1):
        mine = corners[start[p] : start[p + 1]]
        found = _half_spaces(mine, features.normals[owner[p]])
        sides.append(found)
        # The outline itself may be off its plane by rounding: its corners are what counts.
        limits.append((mine @ found.T).max(axis=0))
        side_start.append(side_start[-1] + len(found))
    cones = [_cone_sides(features, f) for f in range(count)]
    cone_start = np.cumsum([0, *map(len, cones)]).astype(np.int64)
    directions = _directions(features)
    heights = corners[: start[count]] @ directions.T
    slabs = np.stack(
        [
            np.minimum.reduceat(heights, start[:count], axis=0),
            np.maximum.reduceat(heights, start[:count], axis=0),
        ],
        axis=-1,
    )
    return Shape(
        np.ascontiguousarray(features.normals),
        np.ascontiguousarray(features.half_angles),
        cone_start,
        np.ascontiguousarray(np.concatenate(cones)),
        np.ascontiguousarray(features.first),
        np.array(side_start, np.int64),
        np.ascontiguousarray(np.concatenate(sides)),
        np.concatenate(limits),
        directions,
        np.ascontiguousarray(slabs),
        float(radius),
        flat,
    )


def _half_spaces(corners: Floats, normal: Floats) -> Floats:
    """(k, 3) outward normals of half-spaces whose meeting is a polygon, a segment or a point."""
    if len(corners) > 2:
        edges = np.roll(corners, -1, axis=0) - corners
        outward = np.cross(edges, normal)
        lengths = np.linalg.norm(outward, axis=1)
        keep = lengths > 1e-12
        return np.vstack([normal, -normal, outward[keep] / lengths[keep, None]])
    axes = np.eye(3)
    if len(corners) == 2:
        along = corners[1] - corners[0]
        along /= np.linalg.norm(along)
        one = np.cross(along, axes[np.abs(along).argmin()])
        one /= np.linalg.norm(one)
        axes = np.array([along, one, np.cross(along, one)])
    # Beside the axes the directions halfway between: what bounds them is a ball or a cylinder.
    more = [axes[1] + axes[2], axes[1] - axes[2]]
    if len(corners) == 1:
        more += [axes[0] + axes[1], axes[0] - axes[1], axes[0] + axes[2], axes[0] - axes[2]]
    half = np.vstack([axes, np.array(more) / np.sqrt(2.0)])
    return np.vstack([half, -half])


def _directions(features: Features) -> Floats:
    """The axes, then the features' own normals, those of faces of the longest outlines first."""
    chosen: list[Any] = list(np.eye(3))
    start = features.start
    spans = [
        np.ptp(features.corners[start[f] : start[f + 1]], axis=0) for f in range(len(features))
    ]
    for f in np.argsort([-float(span @ span) for span in spans], kind="stable"):
        if len(chosen) == MOST_DIRECTIONS or features.half_angles[f] > 0.0:
            continue
        if np.abs(np.array(chosen) @ features.normals[f]).max() < LIKE:
            chosen.append(features.normals[f])
    return np.ascontiguousarray(chosen)


def _cone_sides(features: Features, f: int) -> Floats:
    """(k, 3) unit directions that lean on no normal of a feature's cone, about its outside."""
    cone = features.cone_normals[features.cone_start[f] : features.cone_start[f + 1]]
    if len(cone) == 1:
        return _tangents(cone[0])
    after = np.roll(cone, -1, axis=0)
    across = np.cross(cone, after)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    if len(cone) > 2:
        return -across
    axis = across[0]
    return np.array([axis, -axis, np.cross(cone[0], axis), np.cross(axis, cone[1])])


def _tangents(normal: Floats) -> Floats:
    one = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
    one /= np.linalg.norm(one)
    angles = 2.0 * np.pi * np.arange(TANGENTS)[:, None] / TANGENTS
    around = np.cos(angles) * one + np.sin(angles) * np.cross(normal, one)
    return np.asarray(around, np.float64)
