"""Recognition of one model: contacts in, weighted hypotheses out."""

from __future__ import annotations

from time import perf_counter

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import RigidTransform, Rotation

from ..contacts.contacts import Contacts
from ..poses.entry import Entry
from ..poses.fits.pose import kernel_contacts
from ..poses.known import Surroundings, nothing_known
from ..poses.pose_search import Aim, find_poses
from ..poses.work_space import seeking_space
from ..tree.limits import SearchLimits
from ..tree.tree import Constraints
from .family_kernels import span_family
from .hypotheses import Hypothesis, PoseTolerance, cluster
from .search import Search


def search_model(
    entry: Entry,
    contacts: Contacts,
    constraints: Constraints,
    tolerance: PoseTolerance,
    limits: SearchLimits,
    *,
    outliers: int = 0,
    known: NDArray[np.int32] | None = None,
    surroundings: Surroundings | None = None,
) -> tuple[list[Hypothesis], NDArray[np.float64], Search]:
    """The search and its groups of poses, for one model.

    Args:
        entry: the model.
        contacts: at least one contact, in the order of the search.
        constraints: which constraints on pairs prune the tree.
        tolerance: which poses count as the same.
        limits: how far the search goes.
        outliers: how many contacts may lie on no feature.
        known: (m, k) all interpretations of the first k contacts, if they are known.
        surroundings: what else is known.

    Returns:
        Hypotheses; (h,) the logarithms of their weights, not yet normalised; and what was done.
    """
    started = perf_counter()
    contacts = entry.in_space(contacts)
    largest = float(contacts.position_error.max())
    aim = Aim(
        constraints,
        limits,
        tolerance.rotation,
        tolerance.distance(entry.body.diameter, largest),
        outliers,
    )
    found = find_poses(entry, contacts, aim, surroundings or Surroundings.of(None, None), known)
    searched = perf_counter()
    hypotheses, log_weights = cluster(entry.body, found.poses, tolerance, largest)
    search = Search(
        object_name=entry.body.name,
        nodes=found.nodes,
        tried=found.tried,
        tested=len(found.poses),
        hypotheses=len(hypotheses),
        complete=found.complete,
        search_seconds=searched - started,
        cluster_seconds=perf_counter() - searched,
    )
    return hypotheses, log_weights, search


def span_hypothesis(
    entry: Entry,
    hypothesis: Hypothesis,
    contacts: Contacts,
    tolerance: PoseTolerance,
    most: int,
) -> RigidTransform:
    """Poses that span a hypothesis: its own and, along the freedoms it leaves open, others.

    Neighbours are half a pose tolerance apart, over the family that the hypothesis's best
    interpretation allows, outwards from its own pose as far as ``most`` reach.

    Args:
        entry: the model that the hypothesis is of.
        hypothesis: of a belief about these contacts.
        contacts: what was felt.
        tolerance: which poses count as the same.
        most: the most poses.

    Returns:
        A stack of poses, model to world, the hypothesis's own first.
    """
    if hypothesis.determined:
        return RigidTransform.from_matrix(hypothesis.pose.as_matrix()[None])
    contacts = entry.in_space(contacts)
    largest = float(contacts.position_error.max())
    diameter = entry.body.diameter
    step = 0.5 * min(tolerance.distance(diameter, largest), tolerance.rotation * diameter / 2.0)
    faces = hypothesis.interpretations[0]
    rotations, translations = np.empty((most, 3, 3)), np.empty((most, 3))
    found = span_family(
        faces.astype(np.int64),
        kernel_contacts(contacts),
        entry.kernel.model,
        hypothesis.pose.rotation.as_matrix(),
        np.array(hypothesis.pose.translation),
        np.ascontiguousarray(hypothesis.freedoms),
        step,
        rotations,
        translations,
        (nothing_known(len(contacts)), seeking_space(len(contacts), 0)),
    )
    turns = Rotation.from_matrix(rotations[:found])
    return RigidTransform.from_components(translations[:found], turns)
