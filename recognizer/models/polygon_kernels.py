"""Compiled nearest points of planar polygons."""

from __future__ import annotations

import numpy as np

from ..compiling import borrowing

INSIDE, EDGE, CORNER = 1, 2, 3
"""What of a polygon is nearest; also in how many directions moving away costs distance."""


@borrowing
def nearest_in_polygon(x, normal, offset, corners, start, stop, nearest):
    """`foot_in_polygon`, with the nearest point written into (3,) ``nearest``."""
    squared, height, region, foot = foot_in_polygon(x, normal, offset, corners, start, stop)
    nearest[0], nearest[1], nearest[2] = foot
    return squared, height, region


@borrowing
def foot_in_polygon(x, normal, offset, corners, start, stop):
    """The nearest point of a solid convex polygon, or of a segment.

    Args:
        x: (3,) the point.
        normal: (3,) unit normal of the polygon's plane.
        offset: ``normal . y`` of that plane.
        corners: (c, 3) corners, of which start to stop are the polygon's, counter-clockwise.
        start: the first corner.
        stop: one past the last corner.

    Returns:
        The squared distance, the signed height above the plane, what is nearest, and where.
    """
    height = normal[0] * x[0] + normal[1] * x[1] + normal[2] * x[2] - offset
    y0 = x[0] - height * normal[0]
    y1 = x[1] - height * normal[1]
    y2 = x[2] - height * normal[2]
    best = np.inf
    region = INSIDE
    n0, n1, n2 = y0, y1, y2
    # Two corners are a segment: a point on its line isn't inside of anything.
    segment = stop - start == 2
    last = stop - 1
    for k in range(start, stop):
        e0 = corners[k, 0] - corners[last, 0]
        e1 = corners[k, 1] - corners[last, 1]
        e2 = corners[k, 2] - corners[last, 2]
        g0 = y0 - corners[last, 0]
        g1 = y1 - corners[last, 1]
        g2 = y2 - corners[last, 2]
        # Outward normal of the edge within the plane, not of unit length: edge x normal.
        side = (
            g0 * (e1 * normal[2] - e2 * normal[1])
            + g1 * (e2 * normal[0] - e0 * normal[2])
            + g2 * (e0 * normal[1] - e1 * normal[0])
        )
        if side > 0.0 or segment:
            share = (g0 * e0 + g1 * e1 + g2 * e2) / (e0 * e0 + e1 * e1 + e2 * e2)
            touched = EDGE if 0.0 < share < 1.0 else CORNER
            share = min(max(share, 0.0), 1.0)
            g0 -= share * e0
            g1 -= share * e1
            g2 -= share * e2
            gap = g0 * g0 + g1 * g1 + g2 * g2
            if gap < best:
                best = gap
                region = touched
                n0, n1, n2 = y0 - g0, y1 - g1, y2 - g2
        last = k
    if region == INSIDE:
        best = 0.0
    return height * height + best, height, region, (n0, n1, n2)
