"""Compiled signed distances from a solid, and how deep a path runs in it."""

from __future__ import annotations

import numpy as np

from ..compiling import borrowing
from .polygon_kernels import CORNER, foot_in_polygon

STRIDE = 64
"""Inside the object a path is looked at once in so small a share of its length at least."""

TIE = 1e-9
"""A share of squared distances by which those to one point of the surface may differ: rounding."""
GRAZING = 1e-3
"""Sines of slopes below which a face's plane doesn't say on which side of the surface a point is;
nor does one that has but a corner nearest. All faces together do."""


@borrowing
def _solid_angle(x, corners, start, stop):
    """Half the solid angle of a convex polygon seen from a point (Van Oosterom and Strackee)."""
    a0, a1, a2 = corners[start, 0] - x[0], corners[start, 1] - x[1], corners[start, 2] - x[2]
    a = np.sqrt(a0 * a0 + a1 * a1 + a2 * a2)
    total = 0.0
    for k in range(start + 1, stop - 1):
        b0, b1, b2 = corners[k, 0] - x[0], corners[k, 1] - x[1], corners[k, 2] - x[2]
        c0 = corners[k + 1, 0] - x[0]
        c1 = corners[k + 1, 1] - x[1]
        c2 = corners[k + 1, 2] - x[2]
        b = np.sqrt(b0 * b0 + b1 * b1 + b2 * b2)
        c = np.sqrt(c0 * c0 + c1 * c1 + c2 * c2)
        volume = a0 * (b1 * c2 - b2 * c1) + a1 * (b2 * c0 - b0 * c2) + a2 * (b0 * c1 - b1 * c0)
        beside = (
            a * b * c
            + (a0 * b0 + a1 * b1 + a2 * b2) * c
            + (a0 * c0 + a1 * c1 + a2 * c2) * b
            + (b0 * c0 + b1 * c1 + b2 * c2) * a
        )
        total += np.arctan2(volume, beside)
    return total


@borrowing
def signed_distance(x, model, faces, nearest):
    """How far a point is from a solid's surface, negative inside.

    Args:
        x: (3,) the point, object frame.
        model: see `pose.KernelModel`.
        faces: how many of its features are faces; they come first.
        nearest: (3,) the nearest point of the surface, written in place.
    """
    normals, offsets, first, start, corners = model[0], model[1], model[2], model[3], model[4]
    squared, side = np.inf, 0.0
    for f in range(faces):
        n = normals[f]
        height = n[0] * x[0] + n[1] * x[1] + n[2] * x[2] - offsets[f]
        if height * height > (1.0 + TIE) * squared:
            continue
        for p in range(first[f], first[f + 1]):
            gap, _, region, foot = foot_in_polygon(
                x, n, offsets[f], corners, start[p], start[p + 1]
            )
            if gap > (1.0 + TIE) * squared:
                continue
            if gap < (1.0 - TIE) * squared:
                side = 0.0
            if gap < squared:
                squared = gap
                nearest[0], nearest[1], nearest[2] = foot
            # Of two faces that meet at the nearest edge, the one seen more squarely knows the side.
            if region != CORNER and abs(height) > abs(side):
                side = height
    distance = np.sqrt(squared)
    if abs(side) <= GRAZING * distance:
        side = np.pi - _solid_angle_of_all(x, model, faces)
    return distance if side >= 0.0 else -distance


@borrowing
def _solid_angle_of_all(x, model, faces):
    """Half the solid angle of the surface: all directions, or as much given as taken back."""
    first, start, corners = model[2], model[3], model[4]
    seen = 0.0
    for p in range(first[0], first[faces]):
        seen += _solid_angle(x, corners, start[p], start[p + 1])
    return seen


@borrowing
def deepest(one, other, clearance, grain, bound, model, faces, place, point, nearest):
    """Where a path comes nearest to a solid, or runs deepest in it.

    The path is walked in steps that a signed distance allows, which changes no faster than the
    path is long; between two places looked at it is no nearer than ``clearance - grain``.

    Args:
        one: (3,) the path's start, object frame.
        other: (3,) its end.
        clearance: how far it should stay away, metres; negative, how deep it may run.
        grain: the least step, metres.
        bound: radius about the model's centroid that holds the solid.
        model: see `pose.KernelModel`.
        faces: how many of its features are faces.
        place: (3,) the place found, written in place.
        point: (3,) work space.
        nearest: (3,) likewise.

    Returns:
        The signed distance there, infinity if the whole path is out of reach.
    """
    centre = model[5]
    squared = 0.0
    for k in range(3):
        squared += (other[k] - one[k]) ** 2
    length = np.sqrt(squared)
    # Only the part within reach of the solid.
    about, away = 0.0, 0.0
    for k in range(3):
        step = (other[k] - one[k]) / length if length > 0.0 else 0.0
        about += (centre[k] - one[k]) * step
        away += (centre[k] - one[k]) ** 2
    reach = bound + max(clearance, 0.0)
    half = reach * reach - (away - about * about)
    if half < 0.0:
        return np.inf
    half = np.sqrt(half)
    at, last = max(0.0, about - half), min(length, about + half)
    least = np.inf
    while at <= last:
        share = at / length if length > 0.0 else 0.0
        for k in range(3):
            point[k] = one[k] + share * (other[k] - one[k])
        distance = signed_distance(point, model, faces, nearest)
        if distance < least:
            least = distance
            for k in range(3):
                place[k] = point[k]
        if at >= last:
            break
        room = distance - clearance
        if room < 0.0:
            # Too deep already; where it is deepest is looked for, not proved.
            room = min(-0.5 * room, length / STRIDE)
        at = min(at + max(room, grain), last)
    return least
