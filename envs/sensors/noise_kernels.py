"""Compiled noise: arithmetic on a few rows, for which a call of numpy costs more than it does."""

from __future__ import annotations

import numpy as np

from ...recognizer.compiling import kernel
from ...recognizer.poses.motions.motion_kernels import perpendicular


@kernel
def blur_rows(touched, points, normals, directions, draws, even, radius, half_angle, moved, turned):
    """Move points, and turn unit vectors away from where they point.

    Args:
        touched: (n,) 1 where there is anything to blur; the other rows are copied.
        points: (n, 3) metres.
        normals: (n, 3) unit vectors.
        directions: (n, 3) where to move the points, of any length above zero.
        draws: (3, n) how far to move in shares of the radius, how far to turn in shares of the
            half-angle, and which way in whole turns about the vector.
        even: whether the first two are draws, uniform from 0 to 1, of what is to be uniform in the
            ball and in the cone.
        radius: metres.
        half_angle: of the cone, radians.
        moved: (n, 3) points, written in place.
        turned: (n, 3) unit vectors, likewise.
    """
    cap = 1.0 - np.cos(half_angle)
    for row in range(len(points)):
        if touched[row] != 1:
            moved[row], turned[row] = points[row], normals[row]
            continue
        x, y, z = directions[row]
        share, cosine = draws[0, row], np.cos(half_angle * draws[1, row])
        if even:
            # On a sphere, area is uniform in the cosine of the angle from the axis.
            share, cosine = share ** (1.0 / 3.0), 1.0 - draws[1, row] * cap
        far = radius * share / np.sqrt(x * x + y * y + z * z)
        moved[row, 0] = points[row, 0] + far * x
        moved[row, 1] = points[row, 1] + far * y
        moved[row, 2] = points[row, 2] + far * z
        _lean(normals[row], cosine, 2.0 * np.pi * draws[2, row], turned[row])


@kernel
def _lean(normal, cosine, around, turned):
    x, y, z = normal
    u0, u1, u2 = perpendicular(x, y, z)
    v0, v1, v2 = y * u2 - z * u1, z * u0 - x * u2, x * u1 - y * u0
    sine = np.sqrt(max(1.0 - cosine * cosine, 0.0))
    one, other = sine * np.cos(around), sine * np.sin(around)
    turned[0] = cosine * x + one * u0 + other * v0
    turned[1] = cosine * y + one * u1 + other * v1
    turned[2] = cosine * z + one * u2 + other * v2
