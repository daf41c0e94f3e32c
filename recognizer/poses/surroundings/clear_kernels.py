"""Compiled test of poses against what else is known: free space, support plane, approaches.

A pose found for an interpretation may let the object reach into a free path, below its support, or
show the finger a face from behind. What it breaks cuts the poses: it is added to the interpretation
as one more reading, see `slot_kernels`, and the model test runs again. Where a cut leaves a choice,
each is tried in its turn, depth first. The answer is a pose that breaks nothing, or a proof that
there is none: every reading added holds at every pose that breaks nothing.
"""

from __future__ import annotations

import numpy as np

from ...compiling import kernel
from ..fits.pose_kernels import settle, weigh
from ..fits.search_pose_kernels import box_stack
from ..fits.verdict_kernels import FEASIBLE, REJECTED, UNDECIDED
from ..motions.align_kernels import align
from ..proofs.proof_kernels import workspace
from .cut_kernels import CUT, NOTHING, cut_pose
from .slot_kernels import (
    CUTS,
    PATH,
    cut_levels,
    set_slab,
)

TRIALS = 60
"""Model tests of one interpretation with cuts; a case that needs more stays undecided."""
BOXES = 4000
"""Boxes of rotations that they may look at together, ..."""
TIGHT_BOXES = 4
"""... and one that has something to spare, and so proves nothing."""


@kernel
def clear_pose(
    count,
    faces,
    contacts,
    model,
    solid_faces,
    features,
    bound,
    paths,
    support,
    approaches,
    anchor,
    anchor_angle,
    boxes,
    rotation,
    translation,
    work,
    stack,
    levels,
    space,
):
    """Find a pose of an interpretation that breaks nothing that is known, or prove there is none.

    Args:
        count: how many contacts there are.
        faces: (count + CUTS,) the feature of each contact, -1 for none; then the cuts' own.
        contacts: see `pose.kernel_contacts`, with ``CUTS`` rows to spare.
        model: likewise, with slots for cuts behind its own features: see `surroundings.with_slots`.
        solid_faces: how many of the features are faces of the solid.
        features: how many features there are besides the slots.
        bound: radius about the centroid that holds the solid.
        paths: starts and ends (m, 3), world frame; clearances and grains (m,), metres.
        support: corners (v, 3), object frame, signs (v,): 1 if the corner is to be above its limit,
            -1 below; limits (v,), heights along ``up`` (3,), world frame.
        approaches: unit directions (count, 3), world frame, and the least cosine (count,) between
            one's opposite and the contact's normal, -1 if unknown.
        anchor: (3, 3) a rotation, object to world, that only those no farther are asked about ...
        anchor_angle: ... than this angle, radians.
        boxes: the most boxes of rotations that all model tests together may look at.
        rotation: (3, 3) a pose that meets all readings of the contacts, moved in place.
        translation: (3,) likewise.
        work: see `proof_kernels.workspace`, for ``count + CUTS`` contacts.
        stack: see `search_pose_kernels.box_stack`, likewise.
        levels: see `slot_kernels.cut_levels`.
        space: eleven (3,) arrays to work in.

    Returns:
        REJECTED, FEASIBLE or UNDECIDED, and how many boxes are left.
    """
    reaches = contacts[2]
    kinds, margins, left, choices, ends, places, sizes, turns, shifts, angles = levels
    pose = (rotation, translation)
    faces[count:] = -1
    ball = np.empty((3, 3))
    undecided = False
    fresh = True
    trials = 0
    depth = 0
    while True:
        if fresh:
            # The pose at hand meets all readings so far.
            fresh = False
            answer = cut_pose(
                count,
                depth,
                faces,
                contacts,
                model,
                solid_faces,
                features,
                bound,
                paths,
                support,
                approaches,
                anchor,
                anchor_angle,
                pose,
                work,
                levels,
                space,
            )
            if answer == NOTHING:
                return FEASIBLE, boxes
            if answer == CUT:
                depth += 1
            else:
                undecided = True
        if depth == 0:
            return (UNDECIDED if undecided else REJECTED), boxes
        level = depth - 1
        row = count + level
        if left[level] == 0:
            faces[row] = -1
            depth = level
            continue
        if trials == TRIALS or boxes <= 0:
            return UNDECIDED, boxes
        trials += 1
        left[level] -= 1
        faces[row] = choices[level, left[level]]
        if kinds[level] == PATH:
            low, high = ends[level, left[level]]
            set_slab(
                features + level, faces[row], model, places[level], low, high, sizes[level] + 1e-9
            )
            faces[row] = features + level
            reaches[row] = 0.5 * (high - low) + 1e-9 * bound
        # First with something to spare, so that the pose breaks nothing for certain.
        loose = reaches[row]
        verdict, looked = REJECTED, 0
        for spare in (margins[level], 0.0):
            if spare >= loose:
                continue
            reaches[row] = loose - spare
            rotation[:], translation[:] = turns[level], shifts[level]
            most = TIGHT_BOXES if spare > 0.0 else boxes
            near = angles[level] < anchor_angle
            ball[:] = turns[level] if near else anchor
            verdict, looked = settle(
                depth + count,
                faces,
                contacts,
                model,
                ball,
                min(angles[level], anchor_angle),
                most,
                rotation,
                translation,
                work,
                stack,
            )
            if verdict == FEASIBLE or spare == 0.0:
                break
        boxes -= looked
        reaches[row] = loose
        fresh = verdict == FEASIBLE
        undecided |= verdict == UNDECIDED


@kernel
def clear_poses(
    interpretations,
    proven,
    contacts,
    model,
    half_angles,
    solid_faces,
    features,
    bound,
    paths,
    support,
    approaches,
    pool,
    rotations,
    translations,
    costs,
    informations,
):
    """`clear_pose` for interpretations one by one; poses, misfits, informations changed in place.

    Args:
        interpretations: (m, n) a feature for each contact, -1 for none.
        proven: (m,) whether its pose meets all readings; others are left as they are.
        half_angles: (f,) how far a feature's normals lean from its middle one, radians.
        pool: the most boxes of rotations for all interpretations together.
        costs: (m,) least-squares misfits.
        informations: (m, 6, 6) about small motions.
        (The others as in `clear_pose`; rotations (m, 3, 3), translations (m, 3).)

    Returns:
        (m,) verdicts.
    """
    size, count = interpretations.shape
    verdicts = np.full(size, UNDECIDED, np.int8)
    faces = np.full(count + CUTS, -1, np.int64)
    work = workspace(count + CUTS)
    stack = box_stack(count + CUTS)
    levels = cut_levels(solid_faces)
    space = (
        np.empty(3),
        np.empty(3),
        np.empty(3),
        np.empty(3),
        np.empty(3),
        np.empty(3),
        np.empty(3),
        np.empty(3),
        np.empty(3),
        np.empty(3),
        np.empty(3),
    )
    rotation, translation, anchor = np.empty((3, 3)), np.empty(3), np.empty((3, 3))
    for m in range(size):
        if not proven[m]:
            continue
        faces[:count] = interpretations[m]
        if faces[:count].max() < 0:
            # On no contact at all, the object may be anywhere: nothing bounds how far.
            continue
        contacts[2][count:] = 1e-12
        rotation[:], translation[:] = rotations[m], translations[m]
        anchor_angle = align(count, faces, model, half_angles, contacts, anchor)
        if anchor_angle < 0.0:
            continue
        allowed = min(BOXES, pool)
        verdicts[m], remaining = clear_pose(
            count,
            faces,
            contacts,
            model,
            solid_faces,
            features,
            bound,
            paths,
            support,
            approaches,
            anchor,
            anchor_angle,
            allowed,
            rotation,
            translation,
            work,
            stack,
            levels,
            space,
        )
        pool -= allowed - remaining
        if verdicts[m] != FEASIBLE:
            continue
        if np.all(rotation == rotations[m]) and np.all(translation == translations[m]):
            continue
        rotations[m], translations[m] = rotation, translation
        costs[m] = weigh(
            count, faces, contacts, model, rotation, translation, work, informations[m]
        )
    return verdicts
