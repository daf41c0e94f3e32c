"""Compiled branches of the interpretation tree: what is left to try below each, and its poses.

A branch assigns a feature to each of the first contacts. Every assignment narrows the features left
to later contacts by pairs (forward checking); where many completions are left, so does the pose
that the assigned contacts allow, and where there is none, the branch ends.
"""

from __future__ import annotations

import numpy as np

from ...compiling import borrowing, kernel
from ...tree.forward_kernels import check_forward, take_lowest
from ...tree.room_kernels import DIRECTIONS, enter
from ..fits.pose_kernels import start_pose
from ..fits.search_pose_kernels import box_stack
from ..fits.verdict_kernels import REJECTED, judge
from ..motions.align_kernels import align, middle_translation
from ..motions.motion_kernels import copy_pose, copy_rotation
from ..proofs.proof_kernels import locate, workspace
from .backjump_kernels import note_boxes
from .look_ahead_kernels import drop_beyond_region, drop_rejected, shrink_ball

NARROW = 0.2
"""An angle (radians) of rotations so narrow that normals alone rule out no more."""
FEW = 8
"""Completions of a branch that are tried one by one: looking ahead would cost as many verdicts."""
PATIENCE = 16
"""Leaves of a model that are tried before it is looked ahead: most models have fewer in all."""
INNER_STEPS = 1
"""Steps of a verdict within the tree, where it may stay open."""
NODES, VERDICTS, INNER_REJECTED, BOXES, CUT, LEAVES_TRIED = 0, 1, 2, 3, 4, 5
COUNTS = 6
"""Places of the counts that a search returns."""


@kernel
def branch_space(n, words, features):
    """What is kept of the branch at each depth while a search goes down and up.

    Returns:
        (n + 1, n, w) bit sets of the features left to each contact, and how many, (n + 1, n); of
        the contact that comes next, the features still to be tried, (n, w), and whether none at all
        is, (n,); (n + 1,) how many contacts are on none; (n + 1, d, 2) room of the contacts' middle
        (see `room_kernels`).
    """
    return (
        np.zeros((n + 1, n, words), np.uint64),
        np.full((n + 1, n), features),
        np.zeros((n, words), np.uint64),
        np.zeros(n, np.bool_),
        np.zeros(n + 1, np.int64),
        np.empty((n + 1, len(DIRECTIONS), 2)),
    )


@kernel
def branch_poses(n):
    """Of the branch at each depth, (n + 1, ...), the last depth that has a pose, -1 if none, and
    there a rotation, a translation, and an angle that no rotation within the bounds is farther."""
    return (
        np.full(n + 1, -1, np.int64),
        np.empty((n + 1, 3, 3)),
        np.empty((n + 1, 3)),
        np.empty(n + 1),
    )


@kernel
def pose_space(n):
    """Work space for the poses of branches and leaves.

    See `proof_kernels.workspace` and `search_pose_kernels.box_stack`; beside them vectors and a
    matrix, a box with a step and a pose, features with two rotations and a shift.
    """
    return (
        workspace(n),
        box_stack(n),
        (np.empty(6), np.empty(3), np.empty((3, 3))),
        (np.empty((3, 3)), np.empty(3), np.empty(3), np.empty(6), np.empty((3, 3)), np.empty(3)),
        (np.empty(n, np.int64), np.empty((3, 3)), np.empty((3, 3)), np.empty(3)),
    )


@borrowing
def open_level(depth, spare, branches):
    """Have all features that are left to the next contact tried."""
    left, _, untried, null_left, nulls, _ = branches
    for w in range(untried.shape[1]):
        untried[depth, w] = left[depth, depth, w]
    null_left[depth] = nulls[depth] < spare


@borrowing
def next_feature(level, faces, branches):
    """Assign the next feature to a contact, or none at all; returns whether there was a next."""
    _, _, untried, null_left, _, _ = branches
    face = take_lowest(untried[level])
    if face < 0:
        if not null_left[level]:
            return False
        null_left[level] = False
    faces[level] = face
    return True


@borrowing
def narrow_rest(level, faces, spare, pairs, cell, ways, slabs, branches):
    """Narrow what is left to later contacts by what one has been assigned.

    Args:
        level: the contact.
        faces: (n,) the features assigned, -1 for none.
        spare: how many contacts may be on none.
        pairs: see `forward_kernels.check_forward`.
        cell: likewise.
        ways: see `room_kernels.view_ways`; only looked at in a cell.
        slabs: see `room_kernels.feature_slabs`.
        branches: see `branch_space`; written in place.

    Returns:
        In how many ways later contacts can be assigned, taken each by itself; -1 if in none.
    """
    left, sizes, _, _, nulls, rooms = branches
    face, depth = faces[level], level + 1
    nulls[depth] = nulls[level] + (1 if face < 0 else 0)
    if face < 0:
        for k in range(rooms.shape[1]):
            rooms[depth, k, 0], rooms[depth, k, 1] = rooms[level, k, 0], rooms[level, k, 1]
    elif cell[1] >= 0.0 and not enter(ways[level], slabs[face], rooms[level], rooms[depth]):
        return -1.0
    empty, completions = check_forward(
        level,
        face,
        depth,
        spare - nulls[depth],
        pairs,
        cell,
        left[level],
        sizes[level],
        left[depth],
        sizes[depth],
    )
    return completions if nulls[depth] + empty <= spare else -1.0


@borrowing
def count_ways(depth, sizes):
    """How many later contacts have no feature left, and how many ways the others have together."""
    empty = 0
    completions = 1.0
    for j in range(depth, len(sizes)):
        if sizes[j] == 0:
            empty += 1
        completions *= max(sizes[j], 1)
    return empty, completions


@kernel
def start_branch(depth, faces, problem, cell, poses, rotation, translation, aligned):
    """Where the poses of a branch are: about that of a shorter one, or as the normals have it.

    Args:
        depth: how many contacts are assigned.
        faces: (n,) their features, -1 for none.
        problem: contacts, model, half angles and middles, see `search_kernels.search_model`.
        cell: (3, 3) the rotation of a cell and its angle, below zero if there is no cell.
        poses: see `branch_poses`.
        rotation: (3, 3) object to world, written in place.
        translation: (3,) likewise.
        aligned: (3, 3) work space.

    Returns:
        An angle that no rotation within the bounds is farther from that one; -1 if there is none.
    """
    contacts, model, half_angles, middles = problem
    posed, turns, shifts, angles = poses
    last = posed[depth]
    if last >= 0:
        copy_pose(turns[last], shifts[last], rotation, translation)
        # All normals together may say more than the shorter branch's poses.
        if (
            angles[last] > NARROW
            and cell[1] < 0.0
            and align(depth, faces, model, half_angles, contacts, aligned) < 0.0
        ):
            return -1.0
        return angles[last]
    if cell[1] >= 0.0:
        copy_rotation(cell[0], rotation)
        middle_translation(depth, faces, contacts[0], middles, rotation, translation)
        return cell[1]
    return start_pose(depth, faces, contacts, model, half_angles, middles, rotation, translation)


@borrowing
def pose_branch(
    depth,
    faces,
    spare,
    problem,
    angle,
    branches,
    poses,
    rotation,
    translation,
    counts,
    spent,
    space,
):
    """Ask for the pose of a branch, and narrow what is left to later contacts by it.

    Args:
        depth: how many contacts are assigned.
        faces: (n,) their features, -1 for none.
        spare: how many contacts may be on none.
        problem: see `start_branch`.
        angle: an angle that no rotation within the bounds is farther from the given one, radians.
        branches: see `branch_space`; written in place.
        poses: see `branch_poses`; likewise.
        rotation: (3, 3) object to world, moved in place.
        translation: (3,) likewise.
        counts: see `NODES`; added to in place.
        spent: see `backjump_kernels.note_boxes`.
        space: see `pose_space`.

    Returns:
        Whether the branch lives.
    """
    contacts, model, _, _ = problem
    left, sizes, _, _, nulls, _ = branches
    posed, turns, shifts, angles = poses
    work, stack, vectors, box, held = space
    ball = work[6][1]
    counts[VERDICTS] += 1
    copy_rotation(rotation, ball)
    verdict, angle, _, _ = judge(
        depth,
        faces,
        faces,
        contacts,
        model,
        ball,
        angle,
        INNER_STEPS,
        False,
        rotation,
        translation,
        work,
    )
    if verdict != REJECTED:
        angle, _ = locate(depth, faces, faces, model, contacts, rotation, ball, angle, work)
    if verdict == REJECTED or angle < 0.0:
        counts[INNER_REJECTED] += 1
        note_boxes(depth, 0, spent)
        return False
    posed[depth] = depth
    copy_pose(rotation, translation, turns[depth], shifts[depth])
    angles[depth] = angle
    drop_beyond_region(
        depth,
        contacts,
        model,
        rotation,
        translation,
        angle,
        left[depth],
        sizes[depth],
        work,
        vectors,
    )
    empty, completions = count_ways(depth, sizes[depth])
    if nulls[depth] + empty <= spare and completions > FEW and counts[LEAVES_TRIED] >= PATIENCE:
        # The tighter the ball, the more of these verdicts are rejections.
        angle = shrink_ball(
            depth, faces, model, contacts, angle, turns[depth], shifts[depth], work, stack, box
        )
        if angle < 0.0:
            counts[INNER_REJECTED] += 1
            note_boxes(depth, 0, spent)
            return False
        angles[depth] = angle
        counts[VERDICTS] += drop_rejected(
            depth,
            faces,
            nulls[depth] == spare,
            contacts,
            model,
            turns[depth],
            shifts[depth],
            angle,
            left[depth],
            sizes[depth],
            work,
            held,
        )
        empty, _ = count_ways(depth, sizes[depth])
    if nulls[depth] + empty > spare:
        counts[INNER_REJECTED] += 1
        return False
    return True
