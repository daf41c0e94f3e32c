"""The poses of one model that contacts allow: a cover, as interpretations with poses."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..contacts.contacts import Contacts
from ..contacts.support import StableFace
from ..models.polyhedron import Polyhedron
from ..models.prism import Prism
from ..tree.limits import SearchLimits
from ..tree.tree import Constraints
from .component_kernels import link_leaves, report_components
from .cover import Aims, problem_of, search_cover
from .entry import Bits, Entry, SolidEntry, bit_set
from .fits.pose import Poses
from .known import NOWHERE, Surroundings, known_of
from .work_space import seeking_space

EXACT_SYMMETRY = 1e-7
"""How far a symmetry may miss, as a share of the smallest bound on a position, to stand for a part
of the search: what it misses is then below what a witness may miss a bound by."""
COARSE, COARSEST = 5.0, 0.1
"""How far turns about a box's axis may move contacts when their features are tried: in bounds on
positions, and at least so many radii. Features of wider boxes are mostly left by what rules out
nothing."""
FEW, SOME = 3, 8
"""Contacts up to which, this not included, features are chosen before rotations; the same, where
all normals are known."""
ROUNDING = 1e-12
"""Of a cosine."""

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Aim:
    """What a search is to find out, and how far it goes."""

    constraints: Constraints
    """Which constraints on pairs prune the tree."""
    limits: SearchLimits
    turn: float
    """Poses whose rotations are no farther apart than this, radians, ..."""
    shift: float
    """... and whose shifts no farther than this, metres, count as the same."""
    outliers: int = 0
    """How many contacts may lie on no feature."""


@dataclass(frozen=True, eq=False)
class Found:
    """What a search found, and how."""

    poses: Poses
    """One for each component of the poses that an interpretation has."""
    nodes: int
    """Nodes of the tree, boxes with features that are left to contacts, that were looked at."""
    tried: int
    """Searches for a pose that meets every bound."""
    complete: bool
    """False if a limit ended it."""


def find_poses(
    entry: Entry,
    contacts: Contacts,
    aim: Aim,
    surroundings: Surroundings,
    known: NDArray[np.int32] | None = None,
) -> Found:
    """Every interpretation of contacts with one model that isn't ruled out, with poses.

    Args:
        entry: the model.
        contacts: at least one contact, in the order of the search.
        aim: what to find out.
        surroundings: what else is known.
        known: (m, k) all interpretations of the first k contacts, if they are known.
    """
    resting = surroundings.support is not None and surroundings.support.resting
    if resting and isinstance(entry, SolidEntry):
        return _find_standing(entry, contacts, aim, surroundings, known)
    domains = _domains(entry, contacts, known)
    permutations, missed = entry.permutations
    symmetric = (
        known is None
        and len(permutations) > 1
        and missed < EXACT_SYMMETRY * float(contacts.position_error.min())
        and aim.outliers == 0
    )
    if symmetric:
        domains[0] &= entry.orbits
    found = _find(entry, contacts, aim, domains, surroundings)
    poses = found.poses
    if symmetric:
        poses = _spread_over_symmetries(entry.body, poses, permutations)
    return replace(found, poses=poses)


def test_interpretations(
    entry: Entry, interpretations: NDArray[np.int32], contacts: Contacts, aim: Aim
) -> Poses:
    """A pose of each of some interpretations that isn't ruled out, in their order.

    It is the best fit of one that meets every bound, if there is one.

    Args:
        entry: the model.
        interpretations: (m, n) a feature for each contact, -1 for none.
        contacts: the n contacts.
        aim: what to find out; none of these is looked for among others.
    """
    aim = replace(aim, outliers=int((interpretations < 0).sum(axis=1).max(initial=0)))
    domains = _domains(entry, contacts, interpretations)
    poses = _find(entry, contacts, aim, domains, Surroundings.of(None, None)).poses
    best: dict[bytes, int] = {}
    for row in np.lexsort((poses.costs, ~poses.proven)):
        best.setdefault(poses.faces[row].tobytes(), int(row))
    rows = np.ascontiguousarray(interpretations, np.int32)
    kept = [best[row.tobytes()] for row in rows if row.tobytes() in best]
    return poses.take(np.array(kept, np.intp))


def _domains(entry: Entry, contacts: Contacts, known: NDArray[np.int32] | None) -> Bits:
    """(n, w) the features that each contact may be on."""
    domains = entry.by_kind[contacts.kinds]
    if known is not None:
        for i, column in enumerate(known.T):
            domains[i] &= bit_set(np.unique(column[column >= 0]), len(entry.features))
    return domains


def _find(
    entry: Entry,
    contacts: Contacts,
    aim: Aim,
    domains: Bits,
    surroundings: Surroundings,
    feet: Sequence[StableFace] = (),
    square: int = NOWHERE,
) -> Found:
    """The same, with the features that each contact may be on.

    Args:
        feet: faces of its hull that the solid may stand on, if it does.
        square: the feature that stands for the first, if the first contact says which it is.
    """
    upright, contacts = (np.eye(3), contacts) if entry.flat else _upright(contacts)
    shape, model = entry.shape, entry.kernel.model
    largest = float(contacts.position_error.max()) / shape.radius
    aims = Aims(
        spare=aim.outliers,
        coarse=max(COARSE * largest, COARSEST),
        turns=_open_turns(contacts),
        turn=aim.turn,
        shift=aim.shift / shape.radius,
    )
    known = known_of(entry, contacts, surroundings, upright, feet, square)
    problem = problem_of(*(shape, model, entry.packed, contacts, aim.constraints.bits, aims), known)
    cover = search_cover(
        problem, domains, most_nodes=aim.limits.nodes, most_found=aim.limits.budget
    )
    leaves = cover.leaves
    labels, count = link_leaves(leaves, cover.interpretations, problem.touches.mean, shape.radius)
    poses = Poses(
        *report_components(
            *(leaves, labels, count, problem),
            seeking_space(len(contacts), len(known.starts)),
        )
    )
    poses = replace(
        poses,
        rotations=np.ascontiguousarray(upright.T @ poses.rotations),
        translations=np.ascontiguousarray(poses.translations @ upright),
    )
    return Found(poses, cover.nodes, cover.tried, cover.complete)


def _find_standing(
    entry: SolidEntry,
    contacts: Contacts,
    aim: Aim,
    surroundings: Surroundings,
    known: NDArray[np.int32] | None,
) -> Found:
    """The search of a solid that stands on a face of its hull: the support is one more contact."""
    support = surroundings.support
    assert support is not None
    standing, stable = entry.standing, entry.stable_faces
    count, size = len(entry.features), len(standing.features)
    own = _domains(entry, contacts, known)
    domains = np.zeros((len(contacts) + 1, -(-size // 64)), np.uint64)
    domains[1:, : own.shape[1]] = own
    parts: list[Found] = []
    alike: dict[float, tuple[Contacts, list[int]]] = {}
    for index, face in enumerate(stable):
        touch = support.touch(face, entry.model.diameter, contacts, aim.outliers)
        if touch is None:
            # Bounds so wide that the face's plane, as a contact, says nothing: its corners do.
            parts.append(_find(entry, contacts, aim, own, surroundings, [face]))
            continue
        # Faces of about one width are one search, with the widest of their bounds.
        step = np.ceil(np.log2(touch.normal_error[0]))
        widest, members = alike.setdefault(step, (touch, []))
        members.append(index)
        if touch.normal_error[0] > widest.normal_error[0]:
            alike[step] = touch, members
    for touch, members in alike.values():
        everything = Contacts.join([touch, contacts])
        domains[0] = bit_set(count + np.array(members), size)
        found = _find(standing, everything, aim, domains, surroundings, stable, count)
        poses = found.poses.take(found.poses.faces[:, 0] >= 0)
        poses = replace(poses, faces=np.ascontiguousarray(poses.faces[:, 1:]))
        parts.append(replace(found, poses=poses))
    return Found(
        Poses.join([part.poses for part in parts]),
        sum(part.nodes for part in parts),
        sum(part.tried for part in parts),
        all(part.complete for part in parts),
    )


def _upright(contacts: Contacts) -> tuple[Floats, Contacts]:
    """A rotation (3, 3) that brings what normals have in common upright, and contacts turned by it.

    Where they leave a turn about it open, boxes are then along that turn.
    """
    known = contacts.normal_error < math.pi / 2.0
    axis = np.array([0.0, 0.0, 1.0])
    if known.any():
        normals, errors = contacts.normals[known], contacts.normal_error[known]
        surest = normals[errors.argmin()]
        weights = np.where(normals @ surest < 0.0, -1.0, 1.0) / errors**2
        axis = weights @ normals
        axis /= np.linalg.norm(axis)
    one = np.cross(axis, np.eye(3)[np.abs(axis).argmin()])
    one /= np.linalg.norm(one)
    turn = np.array([one, np.cross(axis, one), axis], np.float64)
    return turn, Contacts.trusted(
        np.ascontiguousarray(contacts.positions @ turn.T),
        np.ascontiguousarray(contacts.normals @ turn.T),
        position_error=contacts.position_error,
        normal_error=contacts.normal_error,
        approaches=np.ascontiguousarray(contacts.approaches @ turn.T),
        kinds=contacts.kinds,
    )


def _open_turns(contacts: Contacts) -> int:
    """How many turns normals may leave open of the rotations in which features are tried.

    None where contacts are few, or two of their normals lean apart: what a contact is on says more
    of a pose than a rotation, and what leaves a family of poses is told as it is. All three where
    no normal is known, and one, about an axis, where those that are may all be parallel: many
    contacts on many parallel faces have too many ways to be tried before a turn is.
    """
    known = contacts.normal_error < math.pi / 2.0
    if len(contacts) < (SOME if known.all() else FEW):
        return 0
    if not known.any():
        return 3
    normals, errors = contacts.normals[known], contacts.normal_error[known]
    # If none surely leans away from the first, two others are about as parallel.
    leans = np.cos(np.minimum(errors[0] + errors, math.pi / 2.0)) - ROUNDING
    return int((np.abs(normals @ normals[0])[1:] >= leans[1:]).all())


def _spread_over_symmetries(
    model: Polyhedron | Prism, poses: Poses, permutations: NDArray[np.int32]
) -> Poses:
    """Each interpretation as seen from every symmetry of the model, with all its poses."""
    if not len(poses):
        return poses
    rows, row_of = np.unique(poses.faces, axis=0, return_inverse=True)
    images = permutations[:, rows].reshape(len(permutations) * len(rows), -1)
    # One is seen from several symmetries, or from several of those that were found, where all are
    # of one contact's feature: it has the poses of any of them.
    faces, first = np.unique(images, axis=0, return_index=True)
    turn_of, seen = np.divmod(first, len(rows))
    sizes = np.bincount(row_of)
    image = np.repeat(np.arange(len(faces)), sizes[seen])
    within = np.arange(len(image)) - np.repeat(np.cumsum(sizes[seen]) - sizes[seen], sizes[seen])
    starts = np.cumsum(sizes) - sizes
    of = np.argsort(row_of, kind="stable")[starts[seen[image]] + within]
    faces, which = faces[image], turn_of[image]
    turns = model.symmetries[which]
    rotations = poses.rotations[of] @ turns.transpose(0, 2, 1)
    centres = poses.translations[of] + poses.rotations[of] @ model.centroid
    # A motion in the object's frame turns along.
    frames = np.zeros((len(of), 6, 6))
    frames[:, :3, :3] = frames[:, 3:, 3:] = turns
    informations = frames @ poses.informations[of] @ frames.transpose(0, 2, 1)
    return Poses(
        np.ascontiguousarray(faces, np.int32),
        rotations,
        centres - rotations @ model.centroid,
        poses.costs[of],
        informations,
        poses.proven[of],
        poses.reaches[of],
    )
