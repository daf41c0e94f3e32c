"""The poses that hypotheses leave open: samples spread over all of each family."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..belief import Belief
from ..beliefs.hypotheses import Hypothesis
from ..contacts.contacts import Contacts
from ..contacts.support import SupportPlane
from ..poses.entry import SolidEntry
from ..poses.fits.pose import kernel_contacts
from ..poses.known import nothing_known
from ..poses.work_space import seeking_space
from .spread_kernels import DRAWS, LINES, spread_over_families

SEED = 738
"""Of the random numbers, which are always the same: samples are a rule of the belief."""

Floats = NDArray[np.float64]


def spread_families(
    belief: Belief, rows: NDArray[np.intp], counts: NDArray[np.int64]
) -> tuple[Floats, Floats]:
    """Poses of hypotheses, each one's own first and others spread over what it leaves open.

    Each pose is within all bounds on the contacts, as the hypothesis's best interpretation has
    them, and stands on the face that the hypothesis stands on where the support is known so. What
    was free space or below the support is not looked at. Poses of a hypothesis whose own is not
    proven may be as far off.

    Args:
        belief: what the contacts allow.
        rows: (h,) which of its hypotheses.
        counts: (h,) how many poses of each, one or more.

    Returns:
        (k, 3, 3) rotations and (k, 3) positions, model to world, in the order of the rows.
    """
    ends = np.cumsum(counts)
    rotations, positions = np.empty((counts.sum(), 3, 3)), np.empty((counts.sum(), 3))
    for (name, face), members in _grouped(belief, rows).items():
        chosen = [belief.hypotheses[rows[member]] for member in members]
        entry, contacts, first = _constraints(belief, name, face)
        found = _spread(entry, chosen, contacts, first, counts[members])
        into = np.concatenate([np.arange(ends[m] - counts[m], ends[m]) for m in members])
        rotations[into], positions[into] = found
    return rotations, positions


def _grouped(belief: Belief, rows: NDArray[np.intp]) -> dict[tuple[str, int], list[int]]:
    """Hypotheses by object and by the face that they stand on, -1 if they don't."""
    groups: dict[tuple[str, int], list[int]] = defaultdict(list)
    support = belief.support
    for member, row in enumerate(rows):
        hypothesis = belief.hypotheses[row]
        face = -1
        if support is not None and support.resting:
            face = _standing_face(belief.library.solid(hypothesis.object_name), hypothesis, support)
        groups[hypothesis.object_name, face].append(member)
    return groups


def _standing_face(entry: SolidEntry, hypothesis: Hypothesis, support: SupportPlane) -> int:
    down = -hypothesis.T_world_object[:3, :3].T @ support.up
    return int(np.argmax([face.normal @ down for face in entry.stable_faces]))


def _constraints(
    belief: Belief, name: str, face: int
) -> tuple[SolidEntry, Contacts, NDArray[np.int64]]:
    """A solid, what touches it, and the features that are known beforehand."""
    entry, contacts = belief.library.solid(name), belief.contacts.facing_approach()
    none = np.zeros(0, np.int64)
    if face < 0 or belief.support is None:
        return entry, contacts, none
    stable, diameter = entry.stable_faces[face], entry.model.diameter
    touch = belief.support.touch(stable, diameter, contacts, belief.outliers)
    if touch is None:
        return entry, contacts, none
    first = np.array([len(entry.features) + face])
    return entry.standing, Contacts.join([touch, contacts]), first


def _spread(
    entry: SolidEntry,
    hypotheses: Sequence[Hypothesis],
    contacts: Contacts,
    first: NDArray[np.int64],
    counts: NDArray[np.int64],
) -> tuple[Floats, Floats]:
    many, count = len(hypotheses), int(counts.sum())
    faces = np.empty((many, len(contacts)), np.int64)
    motions, widths = np.zeros((many, 6, 6)), np.zeros((many, 6))
    for row, hypothesis in enumerate(hypotheses):
        open_ways = hypothesis.freedoms
        faces[row, : len(first)] = first
        faces[row, len(first) :] = hypothesis.interpretations[0]
        motions[row, : len(open_ways)] = open_ways
        # Freedoms are principal axes of the covariance.
        variances = (open_ways @ hypothesis.covariance * open_ways).sum(axis=1)
        widths[row, : len(open_ways)] = np.sqrt(3.0 * variances)
    starts = np.array([hypothesis.T_world_object for hypothesis in hypotheses])
    rng = np.random.default_rng(SEED)
    jumps = rng.uniform(-1.0, 1.0, (count, 6)) * np.repeat(widths, counts, axis=0)
    draws = np.empty((count, LINES, 7 + DRAWS))
    draws[:, :, :6] = rng.standard_normal((count, LINES, 6))
    draws[:, :, 6:] = rng.random((count, LINES, 1 + DRAWS))
    rotations, positions = np.empty((count, 3, 3)), np.empty((count, 3))
    spread_over_families(
        faces,
        kernel_contacts(contacts),
        entry.kernel.model,
        (np.ascontiguousarray(starts[:, :3, :3]), np.ascontiguousarray(starts[:, :3, 3])),
        motions,
        np.asarray(counts, np.int64),
        jumps,
        draws,
        rotations,
        positions,
        (nothing_known(len(contacts)), seeking_space(len(contacts), 0)),
    )
    return rotations, positions
