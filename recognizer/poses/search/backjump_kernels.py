"""Compiled backjumping: a whole branch rejected where its leaves have taken long one by one.

Where the normals leave the rotation open, poses aren't asked for within the tree, and thousands of
leaves may be rejected each by a search of its own that would have rejected a few of the contacts
they share. So the boxes that go into the leaves of a branch are counted, and where they come to
more than a search of the branch itself may take, that search is made.

It is sound, as a leaf's bounds contain those of every branch it is on: no pose within the bounds of
a branch's contacts, no pose of any leaf. And it costs no more than the leaves do, up to a constant:
searches of branches are paid for by boxes that leaves have taken before.
"""

from __future__ import annotations

import numpy as np

from ...compiling import borrowing, kernel
from ..fits.pose_kernels import settle, start_pose
from ..fits.verdict_kernels import FEASIBLE, REJECTED
from ..motions.align_kernels import middle_translation

FEWEST = 3
"""Contacts of the shortest branch worth a search: two leave nearly all rotations possible."""
FIRST = 100.0
"""Boxes that the leaves of a branch take together until it is searched, ..."""
AGAIN = 4.0
"""... and how many times as many until it is searched again, if the search stays open."""
LEAST = 200
"""Boxes that a search of a branch may take at least; few of those that end need more."""


@borrowing
def open_branch(depth, spent, due):
    """Begin to count for a new branch of so many contacts."""
    spent[depth] = 0.0
    due[depth] = FIRST


@borrowing
def note_boxes(depth, boxes, spent):
    """Count boxes, and a verdict as one, for all branches that a branch of so many is part of."""
    for k in range(depth):
        spent[k] += boxes + 1.0


@borrowing
def note_witness(depth, due):
    """A pose for so many contacts is one for fewer: none of their branches is searched again."""
    for k in range(depth + 1):
        due[k] = np.inf


@borrowing
def due_branch(start, depth, spent, due):
    """The shortest branch, of at least ``start`` contacts, that is to be searched; -1 if none."""
    for k in range(max(start, FEWEST), depth):
        if spent[k] >= due[k]:
            return k
    return -1


@kernel
def search_branch(
    depth,
    faces,
    contacts,
    model,
    half_angles,
    middles,
    cell,
    most,
    rotation,
    translation,
    work,
    stack,
):
    """`pose_kernels.settle` for the first contacts of an interpretation alone.

    Args:
        depth: how many contacts.
        faces: (n,) the feature of each, -1 for none.
        contacts: see `search_kernels.search_model`.
        model: likewise.
        half_angles: likewise.
        middles: likewise.
        cell: (3, 3) a rotation and an angle, radians, that all rotations asked for are within; the
            normals say so if the angle is below zero.
        most: the most boxes to look at.
        rotation: (3, 3) work space.
        translation: (3,) likewise.
        work: see `proof_kernels.workspace`.
        stack: see `search_pose_kernels.box_stack`.

    Returns:
        REJECTED, FEASIBLE or UNDECIDED, and how many boxes were looked at.
    """
    ball = work[6][1]
    rotation[:], angle = cell
    if angle < 0.0:
        angle = start_pose(
            depth, faces, contacts, model, half_angles, middles, rotation, translation
        )
        if angle < 0.0:
            return REJECTED, 0
    else:
        middle_translation(depth, faces, contacts[0], middles, rotation, translation)
    ball[:] = rotation
    return settle(
        depth, faces, contacts, model, ball, angle, most, rotation, translation, work, stack
    )


@kernel
def back_to(
    start,
    depth,
    faces,
    contacts,
    model,
    half_angles,
    middles,
    cell,
    most,
    effort,
    rotation,
    translation,
    work,
    stack,
):
    """The shortest branch that is rejected, once a leaf is, or the leaf itself.

    Args:
        start: contacts of the shortest branch that may be.
        depth: contacts of the leaf.
        effort: (n + 1,) boxes spent below the branch of each length, and from when on to search it.
        (The others as in `search_branch`.)

    Returns:
        How many contacts the rejected branch has, and how many boxes were looked at.
    """
    spent, due = effort
    boxes = 0
    while True:
        branch = due_branch(start, depth, spent, due)
        if branch < 0 or boxes >= most:
            return depth, boxes
        allowed = min(max(int(spent[branch]), LEAST), most - boxes)
        verdict, looked = search_branch(
            branch,
            faces,
            contacts,
            model,
            half_angles,
            middles,
            cell,
            allowed,
            rotation,
            translation,
            work,
            stack,
        )
        boxes += looked
        if verdict == REJECTED:
            note_boxes(branch, looked, spent)
            depth = branch
        elif verdict == FEASIBLE:
            note_witness(branch, due)
        else:
            due[branch] = AGAIN * spent[branch]
