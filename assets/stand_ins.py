"""The five stand-ins for the memo's three-dimensional test objects, as unions of convex parts.

Stand-ins: AI Memo 738 shows its objects only as line drawings (Figure 7) and their geometry is
lost. What the memo does say of each, and what we chose, is in SOURCES.md.

Lengths here are inches, as in the memo, in each object's own design frame (z up); :func:`parts_m`
is the edge at which they become metres. Parts overlap in volume, and a part that stands on another
is smaller all round than the face it stands on, so every union is a clean closed 2-manifold.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .obj_file import DECIMALS
from .solids import Points, box, chamfered_rectangle, extrude, place, regular_polygon, turn_half

METRES_PER_INCH = 0.0254


@dataclass(frozen=True, eq=False)
class StandIn:
    """One object of the library.

    Attributes:
        name: what the library calls it.
        faces: the number of planar faces of the union.
        diameter_in: largest distance between two of its points, inches, once scaled.
        parts: convex parts, ``(n, 3)`` hull points each, design frame, before scaling.
    """

    name: str
    faces: int
    diameter_in: float
    parts: tuple[Points, ...]


def parts_m(stand_in: StandIn) -> tuple[Points, ...]:
    """The convex parts in metres, object frame: scaled to the stated diameter and centred.

    The object frame keeps the design frame's axes; its origin is the centre of the bounding box.
    """
    points = np.vstack(stand_in.parts)
    # The diameter of a union of hulls is attained between two hull points.
    diameter = np.linalg.norm(points[:, None] - points[None], axis=-1).max()
    centre = (points.min(axis=0) + points.max(axis=0)) / 2
    scale = stand_in.diameter_in * METRES_PER_INCH / diameter
    return tuple(np.round((part - centre) * scale, DECIMALS) for part in stand_in.parts)


def _housing() -> tuple[Points, ...]:
    """Base flange 10, body 8, top flange 10, terminal pad 5 and lip 7 faces.

    The flanges differ by 0.06 to 0.12, and flanks of body and pad are nearly flush. Without the
    lip, a rotation by pi about z maps this onto itself, and those about x and y nearly do, but for
    the pad. The lip is off centre so that no mirror plane is left.
    """
    tongue = [(1.1, 0.1), (1.62, 0.1), (1.8, 0.28), (1.8, 0.5), (1.62, 0.68), (1.1, 0.68)]
    return (
        extrude(chamfered_rectangle(1.36, 1.1, 0.28), "z", 0.0, 0.8),
        extrude(chamfered_rectangle(0.97, 0.8, 0.28), "z", 0.4, 2.1),
        extrude(chamfered_rectangle(1.3, 1.02, 0.28), "z", 1.77, 2.45),
        box((-0.99, 0.99), (-0.6, 0.6), (2.1, 2.73)),
        extrude(tongue, "y", -0.6, 0.36),
    )


def _housing_34() -> tuple[Points, ...]:
    """Flanges 10 and 10, body 8, and a lip of 6 faces: a tongue with one chamfer along its edge.

    But for the lip and the flanges' thicknesses (0.6 and 0.5), rotations by pi about x, y and z
    map this onto itself: the memo's "nearly symmetric about two axes".
    """
    flange = chamfered_rectangle(1.35, 1.1, 0.35)
    tongue = [(1.1, 0.15), (1.95, 0.15), (1.95, 0.31), (1.8, 0.45), (1.1, 0.45)]
    return (
        extrude(flange, "z", 0.0, 0.6),
        extrude(regular_polygon(8, 0.78), "z", 0.3, 2.0),
        extrude(flange, "z", 1.7, 2.2),
        extrude(tongue, "y", -0.45, 0.45),
    )


def _stapler() -> tuple[Points, ...]:
    """Base 7, foot 5, rear post 4, arm 8, nose 5, cap 5 faces; the arm opens towards +x.

    Plates in layers: base with foot below, arm with cap above are near mirror images of each other
    across the gap, and each is nearly so end for end. The flanks step by 0.04 to 0.09 from one
    layer to the next.
    """
    base = [(0.0, 0.0), (6.6, 0.0), (6.6, 0.22), (6.32, 0.5), (0.0, 0.5)]
    arm = [(0.0, 0.0), (6.4, 0.0), (6.4, 0.37), (6.12, 0.65), (0.28, 0.65), (0.0, 0.37)]
    in_arm = (
        extrude(arm, "y", -0.6, 0.6),
        box((1.6, 5.8), (-0.34, 0.34), (0.45, 0.85)),
        box((5.0, 5.9), (-0.42, 0.42), (-0.22, 0.2)),
    )
    # A negative tilt lifts the arm's +x end.
    opened = tuple(place(part, np.deg2rad(-3.0), (0.0, 0.0, 1.05)) for part in in_arm)
    return (
        extrude(base, "y", -0.68, 0.68),
        box((0.3, 5.8), (-0.51, 0.51), (-0.18, 0.2)),
        box((0.2, 1.4), (-0.3, 0.3), (0.3, 1.3)),
        *opened,
    )


def _simple_hand() -> tuple[Points, ...]:
    """Wrist 5, flange 5, palm 6, two fingers 6 faces each; symmetric by pi about z.

    The second finger is the first one turned, so the symmetry is exact to the last bit.
    """
    finger_profile = [(0.8, 3.2), (1.45, 3.2), (1.45, 6.6), (1.1, 7.3), (0.8, 7.3)]
    finger = extrude(finger_profile, "y", -0.45, 0.45)
    return (
        box((-0.55, 0.55), (-0.4, 0.4), (0.0, 1.8)),
        box((-1.1, 1.1), (-0.65, 0.65), (1.4, 2.4)),
        box((-1.7, 1.7), (-0.9, 0.9), (1.9, 3.6)),
        finger,
        turn_half(finger),
    )


_PALM_TOP = 2.05  # where the digits start


def _digit(y: float, lengths: tuple[float, float, float], chamfered: int) -> tuple[Points, ...]:
    """Three segments in a straight line upwards, 4 + 1 faces each, and a tip chamfer.

    Each segment is 0.07 smaller all round than the one before. ``lengths`` runs from the palm to
    the tip, ``chamfered`` is the side, +1 or -1 along x, on which the tip is cut.
    """
    half_x, half_y, step, sunk, cut = 0.54, 0.78, 0.07, 0.25, 0.18
    bottom = _PALM_TOP
    segments = []
    for number, length in enumerate(lengths):
        half, top = half_x - number * step, bottom + length
        profile = [(half, bottom - sunk), (half, top), (-half, top), (-half, bottom - sunk)]
        if number == len(lengths) - 1:
            profile[1:2] = [(half, top - cut), (half - cut, top)]
        corners = np.array(profile) * (chamfered, 1)
        width = half_y - number * step
        segments.append(extrude(corners, "y", y - width, y + width))
        bottom = top
    return tuple(segments)


def _complex_hand() -> tuple[Points, ...]:
    """Wrist 9, palm 7, three digits 16 faces each: a flat hand with its thumb in the middle.

    But for one edge of the palm, and the tips' chamfers, which face +x on the fingers and -x on
    the shorter thumb, the plane x = 0 would be a second mirror plane. Digits and palm are nearly
    of one thickness: flat surfaces of one side lie within 0.21 of each other, and like segments
    of two digits in one plane.
    """
    palm = [(0.43, 1.1), (0.61, 1.28), (0.61, _PALM_TOP), (-0.61, _PALM_TOP), (-0.61, 1.1)]
    fingers = (_digit(y, (1.9, 1.7, 1.4), 1) for y in (-1.86, 1.86))
    thumb = _digit(0.0, (1.55, 1.4, 1.15), -1)
    wrist = extrude(regular_polygon(8, 0.55), "z", 0.0, 1.4)
    return (wrist, extrude(palm, "y", -2.71, 2.71), *(s for f in fingers for s in f), *thumb)


STAND_INS: tuple[StandIn, ...] = (
    StandIn("housing", 40, 4.0, _housing()),
    StandIn("housing-34", 34, 4.0, _housing_34()),
    StandIn("stapler", 34, 7.0, _stapler()),
    StandIn("simple-hand", 28, 8.0, _simple_hand()),
    StandIn("complex-hand", 64, 8.0, _complex_hand()),
)
"""Every stand-in, in the library's order (that of the memo's tables)."""
