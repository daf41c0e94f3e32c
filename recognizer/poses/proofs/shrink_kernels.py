"""Compiled tightening of a box of rotations by linear programs.

An ellipsoid around all that bounds allow (`region_kernels`) is wider than what they allow, by up to
the root of their number. The box around it bounds the remainders of their inequalities
(`inequality_kernels`), so linear programs say how far poses within the bounds turn along its axes:
that is a smaller box, with smaller remainders. This is what bound tightening does in global
optimisation; here it leaves a tenth of the boxes that branch and bound otherwise looks at.
"""

from __future__ import annotations

import numpy as np

from ...compiling import borrowing, kernel
from ..motions.align_kernels import diagonalise
from .inequality_kernels import ROUNDING, add_contact
from .simplex_kernels import farther, forget_vertex, simplex_space

ROOM = 24
"""Inequalities of a contact, on average, that there is room for; what finds none is left out."""
ROUNDS = 6
"""Times that the box is tightened, ..."""
WORTHWHILE = 0.85
"""... as long as a round leaves less than this share of its volume."""


@kernel
def shrink_space(count):
    """Work space of `shrink_box` for a number of contacts."""
    return (
        np.empty((7, count * ROOM)),
        simplex_space(count * ROOM),
        (np.empty(6), np.empty(6), np.empty(6)),
        (np.empty(3), np.empty(3), np.empty(3), np.empty(3), np.empty(3)),
    )


@borrowing
def _reaches(region, first, axes, middle, wide):
    """The middle of a region along axes, and how far it reaches from there, (3,) each in place.

    Of its turns if ``first`` is 0, of its shifts if it is 3.
    """
    for k in range(3):
        square = 0.0
        middle[k] = 0.0
        for a in range(3):
            middle[k] += axes[a, k] * region[2][first + a]
            for b in range(3):
                square += axes[a, k] * region[1][first + a, first + b] * axes[b, k]
        wide[k] = np.sqrt(max(square, 0.0)) * (1.0 + 1e-9)


@borrowing
def box_region(region, axes, centre, half, form):
    """The box around a region's rotations, about the pose that the region is about.

    Whatever the axes, a box of these sides holds the region; (3, 3) ``form`` is work space.
    """
    for a in range(3):
        for b in range(3):
            form[a, b] = region[1][a, b]
    diagonalise(form, axes)
    _reaches(region, 0, axes, centre, half)


@borrowing
def shrink_box(
    count, faces, targets, x, levers, u, model, contacts, region, axes, centre, half, space
):
    """Shrink a box of rotations to what poses within the bounds leave of it.

    Args:
        count: how many contacts count.
        faces: (n,) the feature of each contact, -1 for none.
        targets: (n,) the polygon that stands for it.
        x: (n, 3) contacts, object frame, metres.
        levers: (n, 3) contacts less the pivot.
        u: (n, 3) measured normals, object frame.
        model: see `pose.ModelTest`.
        contacts: likewise.
        region: about the pose that these are read at; see `region_kernels.region_workspace`.
        axes: (3, 3) columns, right-handed, object frame.
        centre: (3,) of the box along them, radians; changed in place.
        half: (3,) its half sides; likewise.
        space: see `shrink_space`.

    Returns:
        Whether any poses are left.
    """
    table, programs, (low, high, objective), vectors = space
    _, _, reaches, chords, sines = contacts
    middle, wide = vectors[0], vectors[1]
    _reaches(region, 3, axes, middle, wide)
    for k in range(3):
        low[k], high[k] = centre[k] - half[k], centre[k] + half[k]
        # Shifts, in radii.
        low[3 + k], high[3 + k] = (middle[k] - wide[k]) / model[6], (middle[k] + wide[k]) / model[6]
    objective[:] = 0.0
    for _ in range(ROUNDS):
        square = 0.0
        for k in range(3):
            square += max(low[k] ** 2, high[k] ** 2)
        used = 0
        for i in range(count):
            if faces[i] >= 0:
                used = add_contact(
                    (x[i], levers[i], u[i]),
                    faces[i],
                    targets[i],
                    model,
                    (reaches[i], chords[i], sines[i]),
                    axes,
                    (low, high, square),
                    used,
                    table,
                    vectors,
                )
        if used == 0:
            break
        shrunk = 1.0
        forget_vertex(programs)
        for k in range(3):
            before = high[k] - low[k]
            for side in range(2):
                sign = 2.0 * side - 1.0
                objective[k] = sign
                most = farther(objective, table, used, low, high, programs) + ROUNDING
                if side == 1:
                    high[k] = min(high[k], most)
                else:
                    low[k] = max(low[k], -most)
                if low[k] > high[k]:
                    return False
            objective[k] = 0.0
            shrunk *= (high[k] - low[k]) / before if before > 0.0 else 1.0
        if shrunk > WORTHWHILE:
            break
    for k in range(3):
        centre[k], half[k] = 0.5 * (low[k] + high[k]), 0.5 * (high[k] - low[k])
    return True
