"""Compiled cuts of error ellipsoids: how far along each axis bounds let an interpretation reach."""

from __future__ import annotations

import numpy as np
from numba import njit

from .extent_kernels import ROWS_OF_ONE, contact_rows
from .motion_kernels import to_object
from .polytope_kernels import take_needed
from .simplex_kernels import farther, farthest, simplex_space


@njit(cache=True)
def reach_along(
    interpretations,
    rotations,
    translations,
    contacts,
    errors,
    model,
    half_angles,
    axes,
    widest,
    reaches,
):
    """How far each interpretation's poses reach along axes of their own, there and back together.

    As linear programs about its pose have it, without the remainders of turns: an approximation.

    Args:
        interpretations: (m, n) a feature for each contact, -1 for none.
        rotations: (m, 3, 3) object to world.
        translations: (m, 3) likewise, metres.
        contacts: see `search_kernels.search_model`.
        errors: likewise.
        model: likewise.
        half_angles: likewise.
        axes: (m, 6, 6) unit motions, in rows (see `motion_kernels`).
        widest: (6,) the largest motion of each kind, metres.
        reaches: (m, 6) written in place, metres; infinite where no motion is left by the bounds.
    """
    size, count = interpretations.shape
    start = model[3]
    corners = 0
    for f in range(len(half_angles)):
        corners = max(corners, start[f + 1] - start[f])
    room = count * (ROWS_OF_ONE + corners)
    rows, limits, columns = np.empty((room, 6)), np.empty(room), np.empty((7, room))
    space = simplex_space(room)
    vectors = (np.empty(3), np.empty(3), np.empty(3), np.empty(3), np.empty(3))
    x, u = np.empty((count, 3)), np.empty((count, 3))
    faces, objective = np.empty(count, np.int64), np.empty(6)
    low = -widest
    for m in range(size):
        faces[:] = interpretations[m]
        to_object(contacts[0], contacts[1], rotations[m], translations[m], x, u)
        used = contact_rows(
            faces, contacts, errors, model, half_angles, x, u, 0.0, rows, limits, vectors
        )
        used = take_needed(rows, limits, used, low, widest, columns)
        for a in range(6):
            reach = 0.0
            for side in range(2):
                for k in range(6):
                    objective[k] = (2.0 * side - 1.0) * axes[m, a, k]
                program = (objective, columns, used, low, widest, space)
                reach += farthest(*program) if a + side == 0 else farther(*program)
            reaches[m, a] = reach if np.isfinite(reach) else np.inf
