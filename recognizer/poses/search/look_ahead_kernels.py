"""Compiled look ahead: what later contacts can be on, given where the assigned ones put the object.

First feature by feature, by the region of poses alone; then, where many completions are left, by a
verdict on the assigned contacts and one more. A feature that such a verdict rejects is rejected for
the whole branch, at the price of one leaf.
"""

from __future__ import annotations

import numpy as np

from ...compiling import borrowing
from ...contacts.reading_kernels import carry
from ...tree.mask_kernels import bit_index
from ..fits.verdict_kernels import REJECTED, judge
from ..motions.motion_kernels import copy_pose, copy_rotation, move
from ..proofs.possible_kernels import possible
from ..proofs.region_kernels import square_root
from ..proofs.shrink_kernels import box_region, shrink_box

_ONE = np.uint64(1)
_NONE = np.uint64(0)
STEPS = 3
"""Steps of a verdict on one more contact."""


@borrowing
def drop_beyond_region(
    depth, contacts, model, rotation, translation, angle, domains, sizes, work, space
):
    """Drop features of later contacts that no pose of a region puts them on.

    Args:
        depth: how many contacts are assigned.
        contacts: see `search_kernels.search_model`.
        model: likewise.
        rotation: (3, 3) object to world, of the pose that the region in the work space is about.
        translation: (3,) likewise.
        angle: bounds every rotation of the region, radians.
        domains: (n, w) bit sets of the features left to each contact, narrowed in place.
        sizes: (n,) how many, written in place from ``depth`` on.
        work: see `proof_kernels.workspace`.
        space: (6,), (3,) and (3, 3) work space.
    """
    row, near, root = space
    n, words = domains.shape
    region, pivot = work[1], work[5][2]
    x, u, levers, _ = work[3]
    square_root(region[0], root)
    carry(n, contacts[0], contacts[1], rotation, translation, x, u)
    for j in range(depth, n):
        for k in range(3):
            levers[j, k] = x[j, k] - pivot[k]
        sizes[j] = 0
        for w in range(words):
            bits = domains[j, w]
            while bits != _NONE:
                lowest = bits & (~bits + _ONE)
                bits ^= lowest
                if possible(
                    x[j],
                    u[j],
                    levers[j],
                    w * 64 + bit_index(lowest),
                    contacts[2][j],
                    contacts[3][j],
                    contacts[4][j],
                    model,
                    angle,
                    region,
                    root,
                    row,
                    near,
                ):
                    sizes[j] += 1
                else:
                    domains[j, w] ^= lowest


@borrowing
def shrink_ball(depth, faces, model, contacts, angle, rotation, translation, work, stack, space):
    """Shrink the ball of rotations about a branch's pose, which goes to the ball's middle.

    Args:
        depth: how many contacts are assigned.
        faces: (n,) their features, -1 for none.
        model: see `search_kernels.search_model`.
        contacts: likewise.
        angle: bounds every rotation within the bounds from the pose, radians.
        rotation: (3, 3) object to world, of the pose that the region in the work space is about,
            and that has been read; moved in place.
        translation: (3,) likewise.
        work: see `proof_kernels.workspace`.
        stack: see `search_pose_kernels.box_stack`.
        space: axes (3, 3), centre (3,) and half sides (3,) of a box, a step (6,), a pose (3, 3)
            and (3,).

    Returns:
        The angle of the ball about the pose now, radians; -1 if no pose is left.
    """
    axes, centre, half, step, turned, shifted = space
    x, u, levers, _ = work[3]
    region, pivot = work[1], work[5][2]
    box_region(region, axes, centre, half, turned)
    if not shrink_box(
        *(depth, faces, faces, x, levers, u, model, contacts, region, axes, centre, half, stack[9])
    ):
        return -1.0
    square = 0.0
    for a in range(3):
        square += half[a] ** 2
        step[a], step[3 + a] = 0.0, 0.0
        for k in range(3):
            step[a] += axes[a, k] * centre[k]
    # Two turns exp(v) and exp(w) are at most |v - w| apart.
    if np.sqrt(square) >= angle:
        return angle
    move(rotation, translation, step, pivot, 1.0, turned, shifted)
    copy_pose(turned, shifted, rotation, translation)
    return np.sqrt(square)


@borrowing
def drop_rejected(
    depth, faces, certain, contacts, model, rotation, translation, angle, domains, sizes, work, held
):
    """Drop features of later contacts that no pose allows together with the assigned ones.

    Contacts with one feature left count as assigned if no more may be on none.

    Args:
        depth: how many contacts are assigned.
        faces: (n,) their features, -1 for none.
        certain: whether every later contact is on some feature.
        contacts: see `search_kernels.search_model`.
        model: likewise.
        rotation: (3, 3) object to world, of a pose that ...
        translation: (3,) likewise.
        angle: ... no rotation within the bounds is farther from than this, radians.
        domains: (n, w) bit sets of the features left to each contact, narrowed in place.
        sizes: (n,) how many, likewise.
        work: see `proof_kernels.workspace`.
        held: (n,) features, (3, 3), (3, 3) and (3,) work space.

    Returns:
        How many verdicts it took.
    """
    trial, ball, turned, shifted = held
    n, words = domains.shape
    verdicts = 0
    for i in range(n):
        trial[i] = faces[i] if i < depth else -1
        if i >= depth and certain and sizes[i] == 1:
            trial[i] = _only(domains[i])
    for j in range(depth, n):
        if sizes[j] < 2:
            continue
        for w in range(words):
            bits = domains[j, w]
            while bits != _NONE:
                lowest = bits & (~bits + _ONE)
                bits ^= lowest
                trial[j] = w * 64 + bit_index(lowest)
                copy_pose(rotation, translation, turned, shifted)
                copy_rotation(rotation, ball)
                verdicts += 1
                verdict, _, _, _ = judge(
                    n,
                    trial,
                    trial,
                    contacts,
                    model,
                    ball,
                    angle,
                    STEPS,
                    False,
                    turned,
                    shifted,
                    work,
                )
                if verdict == REJECTED:
                    domains[j, w] ^= lowest
                    sizes[j] -= 1
        trial[j] = _only(domains[j]) if certain and sizes[j] == 1 else -1
        if certain and sizes[j] == 0:
            break
    return verdicts


@borrowing
def _only(domain):
    """The only member of a bit set."""
    for w in range(len(domain)):
        if domain[w] != _NONE:
            return w * 64 + bit_index(domain[w])
    return -1
