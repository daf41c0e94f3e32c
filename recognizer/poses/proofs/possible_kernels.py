"""Compiled look ahead: which features a further contact can be on, given where the pose can be."""

from __future__ import annotations

import numpy as np

from ...compiling import borrowing
from ...contacts.reading_kernels import (
    ARC,
    NO_CONE,
    UNKNOWN_NORMAL,
    nearest_in_cone,
    nearest_on_feature,
)
from .region_kernels import remainder


@borrowing
def _reach_of(lever, direction, centre, inverse, root, angle, row):
    """How far the poses of a region move a contact along a direction: mean and half range."""
    a0, a1, a2 = lever[0], lever[1], lever[2]
    d0, d1, d2 = direction[0], direction[1], direction[2]
    row[0], row[1], row[2] = a2 * d1 - a1 * d2, a0 * d2 - a2 * d0, a1 * d0 - a0 * d1
    row[3], row[4], row[5] = -d0, -d1, -d2
    mean = 0.0
    square = 0.0
    for a in range(6):
        mean += row[a] * centre[a]
        for b in range(6):
            square += row[a] * inverse[a, b] * row[b]
    return mean, np.sqrt(max(square, 0.0)) + remainder(lever, direction, root, angle)


@borrowing
def possible(x, u, lever, f, reach, chord, sine, model, angle, region, root, row, near):
    """Whether any pose of a region puts a contact on a feature.

    Args:
        x: (3,) the contact at the region's pose, object frame.
        u: (3,) its normal there.
        lever: (3,) the contact less the region's pivot.
        f: the feature.
        reach: bound on the contact's distance, metres.
        chord: bound on its normal, as a chord.
        sine: the same as a sine.
        model: see `search_kernels.search_model`.
        angle: bounds every rotation of the region, radians.
        region: see `region_kernels.region_workspace`.
        root: (3, 3) square root of the region's spread.
        row: (6,) work space.
        near: (3,) work space.
    """
    normals, offsets, _, start, corners, _, _, cone_start, cone_normals = model
    inverse, centre = region[1], region[2]
    if chord < UNKNOWN_NORMAL:
        kind, miss = nearest_in_cone(u, cone_normals, cone_start[f], cone_start[f + 1], near)
        # No turn moves a unit vector farther than its chord, 2 sin(angle / 2), or its angle.
        if kind == ARC:
            if sine < 1.0 and miss > sine + angle:
                return False
        elif kind != NO_CONE and miss > chord + 2.0 * np.sin(0.5 * min(angle, np.pi)):
            return False
    squared, height, _ = nearest_on_feature(
        x, normals[f], offsets[f], corners, start[f], start[f + 1], near
    )
    if squared <= reach * reach:
        return True
    mean, half = _reach_of(lever, normals[f], centre, inverse, root, angle, row)
    if abs(height + mean) > reach + half:
        return False
    # Along the gap the feature, being convex, ends at its nearest point.
    distance = np.sqrt(squared)
    for k in range(3):
        near[k] = (x[k] - near[k]) / distance
    mean, half = _reach_of(lever, near, centre, inverse, root, angle, row)
    return distance + mean <= reach + half
