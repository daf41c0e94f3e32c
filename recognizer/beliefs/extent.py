"""A single pose that is left: is every pose within the bounds as good as the same?

Least squares say how far a fit is off as a rule. That an answer is right needs more: that no pose
which the contacts allow is farther from it than the pose tolerance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..contacts.contacts import Contacts
from ..contacts.support import StableFace, SupportPlane
from ..poses.fits.pose import KernelModel, kernel_contacts
from . import extent_kernels
from .hypotheses import Hypothesis, PoseTolerance

Floats = NDArray[np.float64]

ROUNDS = 3
"""Times that the pose is moved to the middle of what is allowed."""


def pin_down(
    test: KernelModel,
    hypothesis: Hypothesis,
    contacts: Contacts,
    tolerance: PoseTolerance,
    *,
    movable: bool = True,
    support: SupportPlane | None = None,
    stable: list[StableFace] | None = None,
    held: Sequence[int] = (),
) -> Hypothesis:
    """Move a pose to the middle of those that its contacts allow; open it if they reach too far.

    The motions are linear to first order, and the bounds wider by what that may be off as far as
    the hypothesis says that its poses reach (see `extent_kernels.contact_rows`): so none of them is
    overlooked, whatever way they are connected.

    Args:
        test: of the object.
        hypothesis: one that its least squares say to be determined.
        contacts: what was felt.
        tolerance: which poses count as the same.
        movable: whether the pose may be moved, as nothing else is known that it has to meet.
        support: what the object lies on, if it is known.
        stable: the faces it can stand on, if it rests there.
        held: which of the six small motions there are none.

    Returns:
        The hypothesis, its pose moved if that is still a witness, and with freedoms if some pose
        may be beyond the tolerance of it.
    """
    most_shift = tolerance.distance(2.0 * test.radius, float(contacts.position_error.max()))
    allowed = np.array([tolerance.rotation * test.radius, most_shift])
    axes = _axes(hypothesis.covariance)
    kernel = kernel_contacts(contacts)
    box = np.zeros((6, 2))
    turn, shift = hypothesis.farthest_turn, hypothesis.farthest_shift
    for _ in range(ROUNDS):
        if turn * test.radius > extent_kernels.WIDEST * allowed.max() or (
            shift > extent_kernels.WIDEST * allowed.max()
        ):
            return replace(hypothesis, freedoms=axes[2:3])
        turn = max(turn, tolerance.rotation)
        box, alike = extent_kernels.look_around(
            np.ascontiguousarray(hypothesis.interpretations),
            kernel,
            contacts.normal_error,
            test.model,
            test.features.half_angles,
            hypothesis.T_world_object,
            turn,
            axes,
            allowed,
            *_more_rows(held, *_support_rows(test, hypothesis, turn, support, stable)),
        )
        if alike:
            return replace(
                hypothesis,
                farthest_turn=min(hypothesis.farthest_turn, tolerance.rotation),
                farthest_shift=min(hypothesis.farthest_shift, most_shift),
            )
        if not (movable and np.isfinite(box).all()):
            break
        middle = box.mean(axis=1)
        moved, share = extent_kernels.move_within(
            np.ascontiguousarray(hypothesis.interpretations[0]),
            kernel,
            test.model,
            hypothesis.T_world_object,
            middle @ axes,
        )
        if not share:
            break
        step = share * middle @ axes
        turn += float(np.linalg.norm(step[:3])) / test.radius
        shift += float(np.linalg.norm(step[3:]))
        hypothesis = replace(
            hypothesis, T_world_object=moved, farthest_turn=turn, farthest_shift=shift
        )
        box -= share * middle[:, None]
        # Wider than twice what is allowed: from wherever, something is beyond it.
        if (np.ptp(box, axis=1) > 2.0 * np.repeat(allowed, 3)).any():
            break
    far = np.abs(box).max(axis=1) / np.repeat(allowed, 3)
    return replace(hypothesis, freedoms=axes[far >= min(1.0, far.max())])


def _more_rows(held: Sequence[int], rows: Floats, limits: Floats) -> tuple[Floats, Floats]:
    """The rows and, before them, that some motions are none; see `extent_kernels.contact_rows`."""
    none = np.eye(6)[list(held)]
    rows = np.concatenate([none, -none, rows])
    return rows, np.concatenate([np.zeros(2 * len(none)), limits])


def _axes(covariance: Floats) -> Floats:
    """(6, 6) principal axes of the rotations, then those of the shifts."""
    axes = np.zeros((6, 6))
    for block in (slice(0, 3), slice(3, 6)):
        axes[block, block] = np.linalg.eigh(covariance[block, block])[1].T
    return axes


def _support_rows(
    test: KernelModel,
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
