"""The cover of all poses of one solid that contacts allow: the search, driven in steps.

Grimson and Lozano-Perez ask for the interpretations of contacts (memo, Sections 2 and 3); this asks
for the poses. See `cover_kernels`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..contacts.contacts import Contacts
from .cover_kernels import advance, begin
from .fits.pose import kernel_contacts
from .known import Known, nothing_known
from .leaf_kernels import COUNTS, CUT, HEIGHT, NODES, TRIED
from .node_kernels import OPEN
from .shape import Shape, Touches, touches_of
from .work_space import work_space

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

DEEP = 240
"""Levels of a search, beside one for each contact: a box is cut in two about 30 times across each
turn or shift until rounding ends it."""
STEPS = 10_000
"""Nodes between two looks at the limits: about a tenth of a second."""
UPRIGHT = 2
"""The axis across the plane."""
MOST_LEAVES = 256
"""Leaves that are written at once."""


class Tables(NamedTuple):
    """What pairs of contacts, and pairs of features, say of each other."""

    packed: Floats
    """See `ranges.pack_tables`."""
    half_angles: Floats
    """(f,) see `shape.Shape`."""
    readings: Floats
    """(n, n, 9) see `mask_kernels.pair_readings`; either way round."""
    errors: Floats
    """(n,) bounds on normals, radians."""
    switches: int
    """Bits, which constraints on pairs to apply."""


class Aims(NamedTuple):
    """What a search is to find out, and how it goes about it."""

    spare: int
    """How many contacts may be on none of the features."""
    coarse: float
    """How far turns about a box's axis may move contacts, in radii, when features are tried."""
    turns: int
    """How many turns normals may leave open of the rotations in which features are tried: none, one
    about an axis, or all three."""
    turn: float
    """Poses whose rotations are no farther apart than this, radians, ..."""
    shift: float
    """... and whose shifts no farther than this, in radii, are alike."""


class Problem(NamedTuple):
    """All that a search reads."""

    shape: Shape
    model: Any
    """See `pose.KernelModel`."""
    contacts: Any
    """See `pose.kernel_contacts`."""
    touches: Touches
    tables: Tables
    aims: Aims
    known: Known


class Stack(NamedTuple):
    """Nodes; every array has a row for each."""

    charts: Floats
    """(3, 3) rotation, world to object, of the Gibbs vector zero."""
    lows: Floats
    """(3,) least Gibbs vectors of the box, ..."""
    highs: Floats
    """(3,) ... and greatest."""
    rooms: Floats
    """(d, 2) least and greatest shift along each direction, in radii."""
    domains: NDArray[np.uint64]
    """(n, w) bit sets of the features left to each contact, ..."""
    sizes: Ints
    """(n,) ... and how many these are."""
    fixed: Ints
    """(n,) the feature that a contact is assigned; see `node_kernels.OPEN`."""
    targets: Ints
    """(n,) the polygon that stands for it: its hull, or a piece of a concave face."""
    boxed: Bools
    """Whether it has a box; if not, normals say each time what it is."""
    nulls: Ints
    """How many contacts are on none."""
    branching: Ints
    """The contact of which features are tried; -1 if none is."""
    null_left: Bools
    """Whether it is to be tried on none, too."""


class Leaves(NamedTuple):
    """Boxes that together hold all poses; every array has a row for each."""

    fixed: NDArray[np.int32]
    """(n,) the feature of each contact, below zero for none."""
    charts: Floats
    """(3, 3) as of `Stack`."""
    lows: Floats
    """(3,) likewise."""
    highs: Floats
    """(3,) likewise."""
    rooms: Floats
    """(3, 2) least and greatest shift along each axis, in radii."""
    rotations: Floats
    """(3, 3) object to world: of a pose in it that meets every bound, or nearly does."""
    translations: Floats
    """(3,) metres."""
    proven: Bools
    """Whether it meets every bound."""


@dataclass(frozen=True, eq=False)
class Cover:
    """What a search found."""

    leaves: Leaves
    interpretations: Ints
    """(m,) the interpretation of each leaf, numbered as they were found."""
    nodes: int
    """How many nodes were looked at."""
    tried: int
    """Searches for a witness."""
    complete: bool
    """False if a limit ended it, so that the leaves may not hold all poses."""


def search_cover(
    problem: Problem, domains: NDArray[np.uint64], *, most_nodes: int, most_found: int
) -> Cover:
    """Boxes that together hold all poses that contacts allow.

    Args:
        problem: of one solid; its readings are set in place.
        domains: (n, w) bit sets, the features that each contact may be on.
        most_nodes: the most nodes to look at.
        most_found: the most interpretations to find.
    """
    n, words = domains.shape
    directions = len(problem.shape.directions)
    stack = _stack(n, words, directions)
    work = work_space(n, directions, problem.touches.mean, problem.known)
    stack.domains[0] = domains
    stack.rooms[0] = -np.inf, np.inf
    if problem.shape.flat:
        stack.rooms[0, UPRIGHT] = 0.0
    tables = problem.tables
    begin(problem.contacts, tables.errors, tables.readings, stack.domains[0], stack.sizes[0])
    counts = np.zeros(COUNTS, np.int64)
    counts[HEIGHT] = 1
    buffer, parts = _leaves(n, MOST_LEAVES), []
    known: dict[bytes, int] = {}
    interpretations: list[int] = []
    while counts[HEIGHT] > 0 and counts[NODES] < most_nodes and len(known) < most_found:
        steps = min(STEPS, most_nodes - int(counts[NODES]))
        # Each may be of another interpretation.
        room = Leaves._make(array[: most_found - len(known)] for array in buffer)
        found = advance(problem, stack, room, counts, work, steps)
        parts.append(Leaves._make(array[:found].copy() for array in buffer))
        interpretations += [known.setdefault(r.tobytes(), len(known)) for r in parts[-1].fixed]
    parts = parts or [Leaves._make(array[:0] for array in buffer)]
    return Cover(
        join(parts),
        np.array(interpretations, np.int64),
        int(counts[NODES]),
        int(counts[TRIED]),
        counts[HEIGHT] == 0 and not counts[CUT],
    )


def join(parts: Sequence[Leaves]) -> Leaves:
    """The leaves of all parts, at least one, in order."""
    if len(parts) == 1:
        return parts[0]
    return Leaves._make(np.concatenate(arrays) for arrays in zip(*parts, strict=True))


def problem_of(
    shape: Shape,
    model: Any,
    packed: Floats,
    contacts: Contacts,
    switches: int,
    aims: Aims,
    known: Known | None = None,
) -> Problem:
    """What a search for poses of a solid reads.

    Args:
        shape: of its features.
        model: likewise, see `pose.KernelModel`.
        packed: ranges of its features, see `ranges.pack_tables`.
        contacts: at least one.
        switches: bits, which constraints on pairs to apply.
        aims: what it is to find out.
        known: what is known besides the contacts.
    """
    touches, count = touches_of(contacts, shape.radius), len(contacts)
    readings = np.empty((count, count, 9))
    tables = Tables(packed, shape.half_angles, readings, touches.errors, switches)
    known = known or nothing_known(count)
    return Problem(shape, model, kernel_contacts(contacts), touches, tables, aims, known)


def _stack(n: int, words: int, directions: int) -> Stack:
    size, empty = n + DEEP, np.empty
    return Stack(
        charts=empty((size, 3, 3)),
        lows=empty((size, 3)),
        highs=empty((size, 3)),
        rooms=empty((size, directions, 2)),
        domains=empty((size, n, words), np.uint64),
        sizes=empty((size, n), np.int64),
        fixed=np.full((size, n), OPEN, np.int64),
        targets=np.zeros((size, n), np.int64),
        boxed=np.zeros(size, np.bool_),
        nulls=np.zeros(size, np.int64),
        branching=np.full(size, -1, np.int64),
        null_left=np.zeros(size, np.bool_),
    )


def _leaves(n: int, most: int) -> Leaves:
    empty = np.empty
    return Leaves(
        fixed=empty((most, n), np.int32),
        charts=empty((most, 3, 3)),
        lows=empty((most, 3)),
        highs=empty((most, 3)),
        rooms=empty((most, 3, 2)),
        rotations=empty((most, 3, 3)),
        translations=empty((most, 3)),
        proven=empty(most, np.bool_),
    )
