"""A last search for a witness where the cuts of `cut_kernels` have found none.

Sequential linear programming: near a pose every bound is about linear in a small motion, so the
motion that lowers the largest most, within a box, is a linear program's. It sees all bounds at
once, where cuts come one by one and are soon too many; and where noise is on the very bounds, so
that hardly any pose is left, a program's corners are exact. It proves nothing: a pose that it finds
is a witness only if the kernels' own tests say so.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .repair_kernels import apply_motion, bound_rows

Floats = NDArray[np.float64]

STEPS = 10
"""Linear programs for one interpretation; those that end with a witness mostly need three."""
REACH = 3.0
"""Half the box of the first, in bounds on positions."""
FINEST = 1e-5
"""The same, below which it is given up."""
ENOUGH = -0.1
"""No bound needs to be met by more than this share of it."""
HOPELESS = 0.2
"""A program that leaves this much, and the next one too: poses near here have little to offer."""
RELEVANT = 3.0
"""By how much more than it has to a bound may be met, in bounds, and still be heeded."""


@dataclass(frozen=True, eq=False)
class Bounds:
    """All that a pose has to meet, as `repair_kernels.bound_rows` reads it."""

    contacts: tuple[Floats, ...]
    model: tuple
    solid_faces: int
    bound: float
    paths: tuple[Floats, Floats, Floats, Floats]
    path_scales: Floats
    support: tuple[Floats, Floats, Floats, Floats]
    support_scale: float
    approaches: tuple[Floats, Floats]

    def rows(
        self, faces: NDArray[np.int64], rotation: Floats, translation: Floats
    ) -> tuple[Floats, Floats, bool]:
        """Values, slopes, and whether the pose is a witness."""
        return bound_rows(
            faces,
            self.contacts,
            self.model,
            self.solid_faces,
            self.bound,
            self.paths,
            self.path_scales,
            self.support,
            self.support_scale,
            self.approaches,
            rotation,
            translation,
        )


def repair(
    faces: NDArray[np.int64], rotation: Floats, translation: Floats, bounds: Bounds, steps: int
) -> tuple[Floats, Floats, bool, int]:
    """Move a pose to where it meets all bounds, if that is near.

    Args:
        faces: (n,) a feature for each contact, -1 for none.
        rotation: (3, 3) object to world.
        translation: (3,) likewise, metres.
        bounds: what to meet.
        steps: the most linear programs.

    Returns:
        Rotation and translation; whether they are a witness; how many programs were solved.
    """
    count = len(faces)
    unit = float(bounds.contacts[2][:count].min())
    values, rows, met = bounds.rows(faces, rotation, translation)
    size = REACH * unit
    solved = 0
    left = np.inf
    while not met and solved < min(STEPS, steps) and size > FINEST * unit:
        step, promised = _lower(values, rows, size)
        solved += 1
        if step is None or min(left, promised) > HOPELESS:
            break
        left = promised
        moved = apply_motion(rotation, translation, step, bounds.model[5], bounds.model[6])
        trial_values, trial_rows, met = bounds.rows(faces, *moved)
        worst, trial = float(values.max()), float(trial_values.max())
        if met or trial < worst:
            size *= 2.0 if worst - trial > 0.5 * (worst - promised) else 0.7
            (rotation, translation), values, rows = moved, trial_values, trial_rows
        else:
            size *= 0.3
    return rotation, translation, met, solved


def _lower(values: Floats, rows: Floats, size: float) -> tuple[Floats | None, float]:
    """The motion within a box that lowers the largest value most, and what it promises."""
    near = values + size * np.abs(rows).sum(axis=1) > values.max() - RELEVANT
    from scipy.optimize import linprog  # a tenth of all imports, and seldom needed

    found = linprog(
        np.append(np.zeros(6), 1.0),
        A_ub=np.column_stack([rows[near], np.full(int(near.sum()), -1.0)]),
        b_ub=-values[near],
        bounds=[(-size, size)] * 6 + [(ENOUGH, None)],
        method="highs",
    )
    if found.status != 0:
        return None, 0.0
    return found.x[:6], float(found.x[6])
