"""Recognition in the plane, for one outline: contacts in, weighted hypotheses out.

The memo's first experiments (Section 4.1): three degrees of freedom, x, y and a rotation. The tree
is that of space, over edges instead of faces.
"""

from __future__ import annotations

from dataclasses import dataclass
from time import perf_counter

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import RigidTransform

from ..contacts.contacts import Contacts
from ..models.polygon import Polygon
from ..poses.planar.pose import PlanarModelTest
from ..tables.planar_ranges import PlanarTables
from ..tree.limits import SearchLimits
from ..tree.tree import Constraints, InterpretationTree, root
from .hypotheses import Hypothesis, PoseTolerance
from .planar_hypotheses import cluster_planar
from .search import Search


@dataclass(frozen=True, eq=False)
class PlanarEntry:
    """An outline of a library, with all that is built of it once."""

    model: Polygon
    tables: PlanarTables
    test: PlanarModelTest

    @classmethod
    def of(cls, polygon: Polygon) -> PlanarEntry:
        """Build tables and test of an outline."""
        return cls(polygon, PlanarTables.of(polygon), PlanarModelTest(polygon))


def search_polygon(
    entry: PlanarEntry,
    contacts: Contacts,
    constraints: Constraints,
    tolerance: PoseTolerance,
    limits: SearchLimits,
) -> tuple[list[Hypothesis], NDArray[np.float64], Search]:
    """Tree and model tests in turn, then groups of poses, for one outline.

    Args:
        entry: the outline.
        contacts: at least one contact of the plane, in the order of the search.
        constraints: which constraints prune the tree.
        tolerance: which poses count as the same.
        limits: how far the search goes.

    Returns:
        Hypotheses; (h,) the logarithms of their weights, not yet normalised; and what was done.
    """
    contacts = _widened(entry.model, contacts)
    tree = InterpretationTree(entry.tables, contacts, constraints)
    faces, complete, tree_seconds, pose_seconds = _grow(tree, entry.test, limits)
    started = perf_counter()
    poses = entry.test.run(faces, contacts)
    pose_seconds += perf_counter() - started
    started = perf_counter()
    largest = float(contacts.position_error.max())
    hypotheses, log_weights = cluster_planar(entry.model, poses, tolerance, largest)
    search = Search(
        object_name=entry.model.name,
        nodes=int(tree.nodes.sum()),
        tried=len(faces),
        tested=poses.interpretations,
        hypotheses=len(hypotheses),
        complete=complete,
        search_seconds=tree_seconds + pose_seconds,
        cluster_seconds=perf_counter() - started,
    )
    return hypotheses, log_weights, search


def span_polygon(
    entry: PlanarEntry,
    hypothesis: Hypothesis,
    contacts: Contacts,
    tolerance: PoseTolerance,
    most: int,
) -> RigidTransform:
    """Poses that span a hypothesis: its own and, along the freedoms it leaves open, others.

    Neighbours are half a pose tolerance apart, over the family that the hypothesis's best
    interpretation allows, outwards from its own pose as far as ``most`` reach.

    Args:
        entry: the outline that the hypothesis is of.
        hypothesis: of a belief about these contacts.
        contacts: what was felt.
        tolerance: which poses count as the same.
        most: the most poses.

    Returns:
        A stack of poses, object to world, the hypothesis's own first.
    """
    if hypothesis.determined:
        return RigidTransform.from_matrix(hypothesis.pose.as_matrix()[None])
    contacts = _widened(entry.model, contacts)
    largest = float(contacts.position_error.max())
    diameter = entry.model.diameter
    step = 0.5 * min(tolerance.distance(diameter, largest), tolerance.rotation * diameter / 2.0)
    faces = hypothesis.interpretations[0]
    return entry.test.span(faces, contacts, hypothesis.pose, hypothesis.freedoms, step, most)


def _widened(polygon: Polygon, contacts: Contacts) -> Contacts:
    """The contacts as contacts with the outline's edges, off which its own points may lie."""
    if polygon.straightness == 0.0:
        return contacts
    return Contacts(
        contacts.positions,
        contacts.normals,
        position_error=contacts.position_error + polygon.straightness,
        normal_error=contacts.normal_error,
    )


def _grow(
    tree: InterpretationTree, test: PlanarModelTest, limits: SearchLimits
) -> tuple[NDArray[np.int32], bool, float, float]:
    """Grow the tree in stages, with model tests between; for the limits see `SearchLimits`.

    Returns:
        (m, n) interpretations, whether they are all there are, and seconds for tree and tests.
    """
    count = len(tree.contacts)
    faces, complete = root(), True
    tree_seconds = pose_seconds = 0.0
    step = limits.first_stage
    while len(faces) and faces.shape[1] < count:
        start = faces.shape[1]
        started = perf_counter()
        stop = min(count, start + step)
        cap = min(limits.flood, limits.budget) if stop > start + 1 else limits.budget
        grown, whole = tree.extend(faces, stop, cap)
        if not whole and stop > start + 1:
            grown, whole = tree.extend(faces, start + 1, limits.budget)
        faces = grown
        complete &= whole
        tree_seconds += perf_counter() - started
        if len(faces) > limits.few and faces.shape[1] < count:
            # Rejecting part of an interpretation rejects every way to complete it.
            started = perf_counter()
            faces = test.prune(faces, tree.contacts[: faces.shape[1]])
            pose_seconds += perf_counter() - started
        step = limits.stage if len(faces) <= limits.few else 1
    if not len(faces):
        faces = np.zeros((0, count), np.int32)
    return faces, complete, tree_seconds, pose_seconds
