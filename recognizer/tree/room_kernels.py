"""Compiled room for the contacts' middle: where it can be on the object, in a cell of rotations.

Each contact on a feature leaves the middle of all contacts a region of the object's frame: the
feature, less the way from the middle to the contact, which a cell of rotations knows up to its
angle. The regions of several contacts have to meet. They are held as slabs along a few fixed
directions, so that the meeting of many costs no more than that of two.
"""

from __future__ import annotations

import numpy as np

from ..compiling import borrowing, kernel

DIRECTIONS = np.array(
    [
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, 0.0, 1.0],
        [1.0, 1.0, 0.0],
        [1.0, -1.0, 0.0],
        [1.0, 0.0, 1.0],
        [1.0, 0.0, -1.0],
        [0.0, 1.0, 1.0],
        [0.0, 1.0, -1.0],
        [1.0, 1.0, 1.0],
        [1.0, 1.0, -1.0],
        [1.0, -1.0, 1.0],
        [-1.0, 1.0, 1.0],
    ]
)
DIRECTIONS /= np.linalg.norm(DIRECTIONS, axis=1, keepdims=True)
"""Unit directions, object frame."""
SPARE = 1e-7
"""By how much slabs may miss each other, as a share of lengths: rounding, which the square root of
a difference near zero makes as large as 1.5e-8."""


@kernel
def feature_slabs(model):
    """(f, k, 2) the extent of each feature along each direction, metres."""
    first, corner_first, corners = model[2], model[3], model[4]
    count = len(first) - 1
    slabs = np.empty((count, len(DIRECTIONS), 2))
    slack = SPARE * model[6]
    for f in range(count):
        for k in range(len(DIRECTIONS)):
            low, high = np.inf, -np.inf
            for c in range(corner_first[f], corner_first[f + 1]):
                height = (
                    DIRECTIONS[k, 0] * corners[c, 0]
                    + DIRECTIONS[k, 1] * corners[c, 1]
                    + DIRECTIONS[k, 2] * corners[c, 2]
                )
                low, high = min(low, height), max(high, height)
            slabs[f, k, 0] = low - slack
            slabs[f, k, 1] = high + slack
    return slabs


@borrowing
def view_ways(points, reaches, rotation, angle, ways):
    """The ways from the contacts' middle to each, along the directions, in a cell.

    A turn changes the angle between a way and a direction by no more than its own.

    Args:
        points: (n, 3), metres, world frame.
        reaches: (n,) bounds on positions, metres.
        rotation: (3, 3) of the cell, object to world.
        angle: of the cell, radians.
        ways: (n, k, 2) least and largest, bounds on positions included; in place.
    """
    n = len(points)
    cosine, sine = np.cos(angle), np.sin(angle)
    middle0 = middle1 = middle2 = 0.0
    for i in range(n):
        middle0 += points[i, 0] / n
        middle1 += points[i, 1] / n
        middle2 += points[i, 2] / n
    for i in range(n):
        x, y, z = points[i, 0] - middle0, points[i, 1] - middle1, points[i, 2] - middle2
        length = np.sqrt(x * x + y * y + z * z)
        margin = reaches[i] + SPARE * length
        a = rotation[0, 0] * x + rotation[1, 0] * y + rotation[2, 0] * z
        b = rotation[0, 1] * x + rotation[1, 1] * y + rotation[2, 1] * z
        c = rotation[0, 2] * x + rotation[1, 2] * y + rotation[2, 2] * z
        for k in range(len(DIRECTIONS)):
            along = DIRECTIONS[k, 0] * a + DIRECTIONS[k, 1] * b + DIRECTIONS[k, 2] * c
            across = sine * np.sqrt(max(length * length - along * along, 0.0))
            least = -length if along <= -cosine * length else along * cosine - across
            most = length if along >= cosine * length else along * cosine + across
            ways[i, k, 0] = least - margin
            ways[i, k, 1] = most + margin


@borrowing
def enter(way, slab, room, kept):
    """Narrow the middle's room by a contact on a feature; false if there is none left.

    Args:
        way: (k, 2) see `view_ways`.
        slab: (k, 2) of the feature, see `feature_slabs`.
        room: (k, 2) of the middle, least and largest along each direction, metres.
        kept: (k, 2) what is left of it; in place.
    """
    for k in range(len(room)):
        kept[k, 0] = max(room[k, 0], slab[k, 0] - way[k, 1])
        kept[k, 1] = min(room[k, 1], slab[k, 1] - way[k, 0])
        if kept[k, 0] > kept[k, 1]:
            return False
    return True
