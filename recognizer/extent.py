"""A single pose that is left: is every pose within the bounds as good as the same?

Least squares say how far a fit is off as a rule. That an answer is right needs more: that no pose
which the contacts allow is farther from it than the pose tolerance.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from . import extent_kernels, motion_kernels, polytope_kernels
from .contacts import Contacts
from .hypotheses import Hypothesis, PoseTolerance
from .pose import ModelTest, kernel_contacts
from .simplex_kernels import simplex_space
from .support import StableFace, SupportPlane

Floats = NDArray[np.float64]

ROUNDS = 3
"""Times that the pose is moved to the middle of what is allowed."""
HALVINGS = 6
"""Of the way there, if a pose in the middle breaks a bound."""
WITNESS = 1.0 + 1e-9
"""What a witness's largest reading may be, in bounds."""


def pin_down(
    test: ModelTest,
    hypothesis: Hypothesis,
    contacts: Contacts,
    tolerance: PoseTolerance,
    *,
    movable: bool = True,
    support: SupportPlane | None = None,
    stable: list[StableFace] | None = None,
) -> Hypothesis:
    """Move a pose to the middle of those that its contacts allow; open it if they reach too far.

    All poses are meant that are connected, within the bounds, to the hypothesis's own. The
    motions are linear to first order, and the bounds wider by what that may be off within the
    pose tolerance (see `extent_kernels.contact_rows`): so no such pose is overlooked.

    Args:
        test: of the object.
        hypothesis: one that its least squares say to be determined.
        contacts: what was felt.
        tolerance: which poses count as the same.
        movable: whether the pose may be moved, as nothing else is known that it has to meet.
        support: what the object lies on, if it is known.
        stable: the faces it can stand on, if it rests there.

    Returns:
        The hypothesis, its pose moved if that is still a witness, and with freedoms if some pose
        may be beyond the tolerance of it.
    """
    most_shift = tolerance.distance(2.0 * test.radius, float(contacts.position_error.max()))
    allowed = np.array([tolerance.rotation * test.radius, most_shift])
    axes = _axes(hypothesis.covariance)
    box = np.zeros((6, 2))
    for _ in range(ROUNDS):
        box, alike = _looked_around(
            test, hypothesis, contacts, tolerance.rotation, axes, allowed, support, stable
        )
        if alike:
            return hypothesis
        if not np.isfinite(box).all():
            break
        middle = box.mean(axis=1) @ axes
        moved = _moved(test, hypothesis, contacts, middle) if movable else None
        if moved is None:
            break
        hypothesis = moved
    far = np.abs(box).max(axis=1) / np.repeat(allowed, 3)
    return replace(hypothesis, freedoms=axes[far >= min(1.0, far.max())])


def _axes(covariance: Floats) -> Floats:
    """(6, 6) principal axes of the rotations, then those of the shifts."""
    axes = np.zeros((6, 6))
    for block in (slice(0, 3), slice(3, 6)):
        axes[block, block] = np.linalg.eigh(covariance[block, block])[1].T
    return axes


def _looked_around(
    test: ModelTest,
    hypothesis: Hypothesis,
    contacts: Contacts,
    turn: float,
    axes: Floats,
    allowed: Floats,
    support: SupportPlane | None,
    stable: list[StableFace] | None,
) -> tuple[Floats, bool]:
    """(6, 2) how far poses of all interpretations reach; whether all are as near as is allowed."""
    kernel = kernel_contacts(contacts)
    rotation = np.ascontiguousarray(hypothesis.T_world_object[:3, :3])
    translation = np.ascontiguousarray(hypothesis.T_world_object[:3, 3])
    x, u = np.empty((2, len(contacts), 3))
    motion_kernels.to_object(kernel[0], kernel[1], rotation, translation, x, u)
    corners = int(np.diff(test.features.start).max())
    extra, extra_limits = _support_rows(test, hypothesis, turn, support, stable)
    size = len(contacts) * (extent_kernels.ROWS_OF_ONE + corners) + len(extra)
    rows, limits = np.empty((size, 6)), np.empty(size)
    columns, space = np.empty((7, size)), simplex_space(size)
    widest = np.full(6, 4.0 * float(allowed.max()))
    boxes, alike = [], True
    for faces in hypothesis.interpretations:
        count = extent_kernels.contact_rows(
            faces.astype(np.int64),
            kernel,
            contacts.normal_error,
            test.model,
            test.features.half_angles,
            x,
            u,
            turn,
            rows,
            limits,
            tuple(np.empty((5, 3))),
        )
        rows[count : count + len(extra)], limits[count : count + len(extra)] = extra, extra_limits
        count = polytope_kernels.take_needed(
            rows, limits, count + len(extra), -widest, widest, columns
        )
        known = (columns, count, -widest, widest, space)
        box = polytope_kernels.box_of(axes, *known)
        if not np.isfinite(box).all():
            continue  # none of its poses is near: those of a symmetry are
        boxes.append(box)
        for first, most_allowed in zip((0, 3), allowed, strict=True):
            part = slice(first, first + 3)
            alike = alike and polytope_kernels.all_within(
                first, axes[part, part].copy(), box[part], most_allowed, *known
            )
    if not boxes:
        return np.tile([-np.inf, np.inf], (6, 1)), False
    least, most_of = np.min(boxes, axis=0)[:, 0], np.max(boxes, axis=0)[:, 1]
    return np.stack([least, most_of], axis=1), alike


def _support_rows(
    test: ModelTest,
    hypothesis: Hypothesis,
    turn: float,
    support: SupportPlane | None,
    stable: list[StableFace] | None,
) -> tuple[Floats, Floats]:
    """What a plane that the object lies on allows, as `extent_kernels.contact_rows` has it."""
    if support is None:
        return np.zeros((0, 6)), np.zeros(0)
    centre, radius = test.model[5], test.radius
    pose = hypothesis.T_world_object
    up = pose[:3, :3].T @ support.up
    corners, signs = [test.model[4]], [-1.0]
    standing = [face for face in stable or () if _stands(face, pose, support)]
    if support.resting and len(standing) == 1:
        corners.append(standing[0].corners)
        signs.append(1.0)
    rows, limits = [], []
    for points, sign in zip(corners, signs, strict=True):
        arms = points - centre
        heights = points @ up + pose[:3, 3] @ support.up - support.height
        # A corner goes to c + T (arm + s), with a shift of no more than the radius' own turn.
        lengths = np.linalg.norm(arms, axis=1)
        margin = support.error + 0.5 * turn**2 * lengths + turn**2 * radius
        slopes = np.hstack([np.cross(arms, up) / radius, np.tile(up, (len(points), 1))])
        rows.append(sign * slopes)
        limits.append(margin - sign * heights)
    return np.concatenate(rows), np.concatenate(limits)


def _stands(face: StableFace, pose: Floats, support: SupportPlane) -> bool:
    """Whether all corners of a face are about on the support."""
    heights = (face.corners @ pose[:3, :3].T + pose[:3, 3]) @ support.up - support.height
    return bool((np.abs(heights) <= 2.0 * support.error).all())


def _moved(
    test: ModelTest, hypothesis: Hypothesis, contacts: Contacts, step: Floats
) -> Hypothesis | None:
    """The hypothesis moved by a step, or less of it, to a pose within all bounds; None if none."""
    faces = hypothesis.interpretations[0].astype(np.int64)
    kernel = kernel_contacts(contacts)
    pose = hypothesis.T_world_object
    rotation, translation = pose[:3, :3].copy(), pose[:3, 3].copy()
    matrix = np.eye(4)
    share = 1.0
    for _ in range(HALVINGS):
        turned, shifted = np.empty((3, 3)), np.empty(3)
        motion_kernels.move(
            rotation, translation, share * step, test.model[5], test.radius, turned, shifted
        )
        if extent_kernels.strain(faces, kernel, test.model, turned, shifted) <= WITNESS:
            matrix[:3, :3], matrix[:3, 3] = turned, shifted
            return replace(hypothesis, T_world_object=matrix)
        share *= 0.5
    return None
