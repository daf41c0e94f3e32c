"""Work space of a search for poses: arrays that its steps write, made once."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .known import Known, nothing_known

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

ROWS = 28
"""Rows of a contact, on average, that there is room for; what finds none is left out."""
CUTS = 12
"""Cuts of a contact, likewise."""


class Work(NamedTuple):
    """Work space of a search, and what its steps hand to each other."""

    turn: Floats
    other: Floats
    middle: Floats
    """(3, 3) world to object: the middle of the box that was viewed last, ..."""
    half: Floats
    """(3,) ... half sides of the turns about it, ..."""
    facings: Floats
    """(n, 3) ... normals turned by it, ..."""
    fronts: Floats
    """(n, 3) ... ways back along approaches likewise, ..."""
    directions: Floats
    """(d, 3) ... the directions of slabs turned back by it, and ..."""
    ways: Floats
    """(n, d, 2) ... extents of the arms in the box."""
    hull: Floats
    low: Floats
    """(6,) a box: turns about the middle, radians, then shifts, radii."""
    high: Floats
    kept: Floats
    """(6, 2) the box while another is looked at."""
    columns: Floats
    """(7, m) rows and limits."""
    latest: Ints
    """(n + 2,) the interpretation that was cut last, how often, and how often any was."""
    still: Floats
    """(3,) zeros: what no shift changes."""
    lever: Floats
    best_place: Floats
    slope: Floats
    programs: Any
    """See `simplex_kernels.simplex_space`."""
    objective: Floats
    seen: Floats
    sum: Floats
    """(7,) see `polytope_kernels.tighten`."""
    cut_arms: Floats
    """(c, 3) places about the contacts' mean, in radii, or normals, ..."""
    cuts: Floats
    """(c, 7) ... directions, the same where shifts count and else zero, and how far out along them
    each can be."""
    cut_count: Ints
    """(1,)"""
    rotation: Floats
    translation: Floats
    seeking: Any
    """See `witness_kernels.seek_witness`."""
    best: Floats
    shift: Floats
    mean: Floats
    """(3,) of the contacts, metres."""
    form: Floats
    vectors: Floats
    charts: Floats
    """(2, 3, 3) see `first_box_kernels.first_boxes`, and ..."""
    sides: Floats
    """... (2, 3) likewise."""


def seeking_space(n: int, paths: int) -> Any:
    """Work space for `witness_kernels.seek_witness`, for so many contacts and free paths."""
    empty = np.empty
    readings = (
        *(empty((n, 3)), empty(n), empty(n), empty(n, np.int64), empty(n, np.int64)),
        *(empty(n), empty((n, 3))),
    )
    return (
        *(readings, empty((n, 3)), empty((n, 3)), empty((6, 6)), np.zeros((6, 6))),
        *(empty(6), empty(6), empty(6), empty(3), empty(3), empty(3), empty((3, 3)), empty(3)),
        *((empty(3), empty(3), empty(3), empty(3), empty(3)), np.zeros(paths, np.bool_)),
    )


def work_space(n: int, directions: int, mean: Floats, known: Known | None = None) -> Work:
    """Work space for so many contacts, of a mean (3,), metres, and directions of slabs."""
    known = known or nothing_known(n)
    extra = len(known.corners) + len(known.feet) + len(known.starts)
    empty, rows, cuts = np.empty, ROWS * n + extra, CUTS * n + len(known.starts)
    return Work(
        turn=empty((3, 3)),
        other=empty((3, 3)),
        middle=empty((3, 3)),
        half=empty(3),
        facings=empty((n, 3)),
        fronts=empty((n, 3)),
        directions=empty((directions, 3)),
        ways=empty((n, directions, 2)),
        hull=empty((directions, 2)),
        low=empty(6),
        high=empty(6),
        kept=empty((6, 2)),
        columns=empty((7, rows)),
        latest=np.zeros(n + 2, np.int64),
        still=np.zeros(3),
        lever=empty(3),
        best_place=empty(3),
        slope=empty(3),
        programs=(
            *(empty(6, np.int64), empty((6, 6)), empty(6), empty(6), empty(6), empty(6)),
            *(empty(rows), empty(rows), empty(rows), np.zeros(1, np.bool_)),
        ),
        objective=empty(6),
        seen=empty((6, 2)),
        sum=empty(7),
        cut_arms=empty((cuts, 3)),
        cuts=empty((cuts, 7)),
        cut_count=np.zeros(1, np.int64),
        rotation=empty((3, 3)),
        translation=empty(3),
        seeking=seeking_space(n, len(known.starts)),
        best=empty((3, 3)),
        shift=empty(3),
        mean=mean.copy(),
        form=empty((4, 4)),
        vectors=empty((4, 4)),
        charts=empty((2, 3, 3)),
        sides=empty((2, 3)),
    )
