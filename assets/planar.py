"""The three stand-ins for the memo's planar test objects, as outlines.

Stand-ins: AI Memo 738 shows its planar objects only as a line drawing (Figure 6), and their
geometry is lost. What the memo does say of each, and what we chose, is in SOURCES.md.

Lengths here are inches, as in the memo, in each object's own design frame; `planar_corners` is the
edge at which they become metres.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .obj_file import DECIMALS
from .stand_ins import METRES_PER_INCH

Corners = list[tuple[float, float]]


@dataclass(frozen=True, eq=False)
class PlanarStandIn:
    """One planar object of the library."""

    name: str
    """What the library calls it."""
    edges: int
    """How many edges its outline has."""
    diameter_in: float
    """Largest distance between two of its points, inches, once scaled."""
    corners: Corners
    """Counter-clockwise, design frame, inches, before scaling."""


def planar_corners(name: str) -> NDArray[np.float64]:
    """An object's outline, scaled to its stated diameter.

    Args:
        name: one of `PLANAR_NAMES`.

    Returns:
        (e, 2) corners, counter-clockwise, metres. The object frame keeps the design frame's axes;
        its origin is the centre of the bounding box.

    Raises:
        ValueError: unknown name; the message lists the valid ones.
    """
    for stand_in in PLANAR_STAND_INS:
        if stand_in.name == name:
            break
    else:
        valid = ", ".join(PLANAR_NAMES)
        raise ValueError(f"no planar object is called {name!r}; the library has {valid}")
    points = np.array(stand_in.corners)
    diameter = np.linalg.norm(points[:, None] - points, axis=-1).max()
    centre = (points.min(axis=0) + points.max(axis=0)) / 2
    scale = stand_in.diameter_in * METRES_PER_INCH / diameter
    return np.round((points - centre) * scale, DECIMALS)


def _wrench() -> Corners:
    """A slender double open-ended wrench: a bar with a slanted notch in either end.

    Six corners an end; the other end is the same turned by pi, so the symmetry is exact.
    """
    lips = [(4.41, -0.45), (4.19, -0.31), (3.68, -0.27), (3.58, 0.41), (4.19, 0.37), (4.39, 0.55)]
    return [*lips, *((-x, -y) for x, y in lips)]


def _gator() -> Corners:
    """An alligator from the side: six teeth in an open mouth, two legs, an eye, a nostril."""
    tail = [(0.0, 1.6), (2.2, 1.1), (4.2, 0.95)]
    rear_leg = [(4.4, 0.3), (4.1, 0.0), (5.3, 0.0), (5.35, 0.25), (5.1, 0.5), (5.5, 0.9)]
    belly = [(6.6, 0.75), (7.6, 0.85)]
    front_leg = [(7.7, 0.35), (7.4, 0.0), (8.5, 0.0), (8.6, 0.25), (8.35, 0.5), (8.6, 0.95)]
    lower_jaw = [(9.5, 1.1), (11.0, 0.75), (12.9, 0.55), (13.3, 0.8), (13.05, 1.15), (12.7, 0.9)]
    lower_jaw += [(12.4, 1.25), (12.1, 0.95), (11.8, 1.3), (11.5, 1.02), (10.2, 1.5)]
    upper_jaw = [(11.3, 1.75), (11.6, 1.5), (11.9, 1.85), (12.3, 1.6), (12.6, 1.95), (13.0, 1.7)]
    snout = [(13.25, 2.05), (13.9, 2.1), (13.95, 2.5), (13.5, 2.75), (13.1, 2.6), (11.4, 2.5)]
    eye = [(11.0, 2.95), (10.4, 2.95), (10.1, 2.6), (9.2, 2.55)]
    back = [(8.2, 2.95), (6.6, 3.1), (5.0, 2.8), (3.9, 2.3), (2.0, 1.95), (0.9, 1.95)]
    return [*tail, *rear_leg, *belly, *front_leg, *lower_jaw, *upper_jaw, *snout, *eye, *back]


def _hand() -> Corners:
    """A hand with its fingers spread: four fingers, a thumb, the palm and a stump of the arm."""
    thumb = [(1.0, 0.1), (0.95, 0.4), (1.1, 0.55), (0.85, 0.85), (0.3, 1.0), (-0.5, 0.95)]
    thumb += [(-0.9, 0.75), (-0.85, 0.45), (-1.0, 0.2)]
    return [
        *[(-1.2, 0.0), (1.1, 0.0), (1.15, 1.3), (1.7, 2.2)],
        *_placed(thumb, (1.75, 2.7), -52.0, 0.55, 3.2),
        *[(1.95, 4.0), (1.7, 4.8)],
        *_finger((1.45, 5.45), -12.0, 0.48, 4.2),
        (0.82, 5.35),
        *_finger((0.2, 5.75), -2.0, 0.5, 4.8),
        (-0.42, 5.4),
        *_finger((-1.0, 5.5), 8.0, 0.47, 4.3),
        (-1.52, 4.8),
        *_finger((-2.1, 4.75), 20.0, 0.42, 3.3),
        *[(-2.6, 3.9), (-2.5, 3.2), (-2.3, 2.5), (-1.85, 1.75), (-1.3, 1.2)],
    ]


def _finger(root: tuple[float, float], lean_deg: float, half: float, length: float) -> Corners:
    """Eleven corners, from the right side of the root over the tip to the left side."""
    right = [(1.0, 0.0), (0.9, 0.3), (1.08, 0.42), (0.82, 0.6), (0.8, 0.86), (0.3, 1.0)]
    left = [(-0.35, 0.985), (-0.82, 0.82), (-0.8, 0.62), (-1.08, 0.42), (-1.0, 0.0)]
    return _placed([*right, *left], root, lean_deg, half, length)


def _placed(
    shares: Corners, root: tuple[float, float], lean_deg: float, half: float, length: float
) -> Corners:
    """Corners given as shares of a half-width and a length, leant to the left and put in place."""
    lean = np.radians(lean_deg)
    c, s = float(np.cos(lean)), float(np.sin(lean))
    scaled = [(half * x, length * y) for x, y in shares]
    return [(root[0] + c * x - s * y, root[1] + s * x + c * y) for x, y in scaled]


PLANAR_STAND_INS: tuple[PlanarStandIn, ...] = (
    PlanarStandIn("wrench", 12, 9.0, _wrench()),
    PlanarStandIn("gator", 50, 14.0, _gator()),
    PlanarStandIn("hand", 67, 12.0, _hand()),
)
"""Every planar stand-in, in the order of the memo's Table I."""

PLANAR_NAMES: tuple[str, ...] = tuple(stand_in.name for stand_in in PLANAR_STAND_INS)
"""Names of the planar objects, in the library's order."""
