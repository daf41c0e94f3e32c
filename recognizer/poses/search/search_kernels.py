"""Compiled search of the interpretation tree with poses in it, depth first.

Every assignment narrows the features left to later contacts, first by pairs (forward checking on
bit sets), then, where many completions are left, by the pose that the assigned contacts allow: none
ends the branch, and where there is one, features of later contacts are ruled out one by one (see
`branch_kernels`). A leaf gets a verdict that is a pose or a proof.
"""

from __future__ import annotations

import numpy as np

from ...compiling import borrowing, kernel
from ...tree.cell_search_kernels import passing_cells, view_cell
from ...tree.leaf_kernels import found_space, place_of, table_of, with_room
from ...tree.mask_kernels import pair_readings
from ...tree.prefix_kernels import begin, face_cell, known_of
from ...tree.room_kernels import DIRECTIONS, feature_slabs, view_ways
from ..fits.pose_kernels import finish, settle
from ..fits.verdict_kernels import FEASIBLE, REJECTED
from ..proofs.lean_kernels import lean_space, leans
from .backjump_kernels import back_to, due_branch, note_boxes, note_witness, open_branch
from .branch_kernels import (
    BOXES,
    COUNTS,
    CUT,
    LEAVES_TRIED,
    NODES,
    branch_poses,
    branch_space,
    narrow_rest,
    next_feature,
    open_level,
    pose_branch,
    pose_space,
    start_branch,
)

VAGUE = 1.2
"""An angle (radians) of rotations too wide for a verdict within the tree to be worth its time."""
FEWEST = 3
"""Contacts of the shortest branch that is asked for a pose: two leave nearly all rotations open."""
SPARING, SCARCE = 100, 2.0 / 3.0
"""Boxes for a leaf once less than so much of the pool is left: most that are rejected at all take
fewer, and a few that take many do not leave thousands undecided."""


@borrowing
def share_of(most_boxes, pool, whole):
    """How many boxes a leaf may look at, of a pool that was larger once."""
    return min(most_boxes if pool >= SCARCE * whole else SPARING, most_boxes, pool)


@kernel
def try_leaf(
    start, n, faces, problem, cell, angle, most, pool, effort, rotation, translation, spare, space
):
    """The verdict on a leaf, and the shortest branch that is rejected with it.

    Args:
        start: contacts of the shortest branch that may be.
        n: contacts of the leaf.
        faces: (n,) their features, -1 for none.
        problem: see `branch_kernels.start_branch`.
        cell: likewise.
        angle: an angle that no rotation within the bounds is farther from the given one, radians.
        most: the most boxes of rotations to look at for the leaf.
        pool: the same for the branches as well.
        effort: see `backjump_kernels.back_to`.
        rotation: (3, 3) object to world, moved in place: a witness, or the least bad pose met.
        translation: (3,) likewise.
        spare: (3, 3) and (3,) work space.
        space: see `branch_kernels.pose_space`.

    Returns:
        REJECTED, FEASIBLE or UNDECIDED; how many contacts the rejected branch has, n if it is the
        leaf alone or none; how many boxes were looked at.
    """
    contacts, model, half_angles, middles = problem
    work, stack, _, _, _ = space
    spent, due = effort
    ball = work[6][1]
    ball[:] = rotation
    verdict, looked = settle(
        n, faces, contacts, model, ball, angle, most, rotation, translation, work, stack
    )
    if verdict == FEASIBLE:
        note_witness(n, due)
        return verdict, n, looked
    note_boxes(n, looked, spent)
    if due_branch(start, n, spent, due) < 0:
        return verdict, n, looked
    branch, more = back_to(
        start,
        n,
        faces,
        contacts,
        model,
        half_angles,
        middles,
        cell,
        pool - looked,
        effort,
        spare[0],
        spare[1],
        work,
        stack,
    )
    return verdict, branch, looked + more


@kernel
def search_model(
    contacts,
    errors,
    model,
    half_angles,
    middles,
    packed,
    prefixes,
    domains,
    spare,
    switches,
    crowd,
    most_nodes,
    most_leaves,
    most_boxes,
    pool,
    finest,
    most_cells,
):
    """All interpretations that some pose allows, each with such a pose.

    Args:
        contacts: positions (n, 3), metres, and unit normals (n, 3), world frame; bounds on
            distances (n,), metres, on chords between normals (n,; 2 if unknown) and on sines of
            the angle between them (n,; 1 if it may be a right angle).
        errors: (n,) bounds on normals, radians.
        model: normals (f, 3) and offsets (f,) of the features' planes; (f + 1,) the first convex
            piece of each feature; (p + 1,) the first corner of each polygon, of which the first f
            are the features' hulls and the rest their pieces; corners (c, 3); centroid (3,);
            radius, metres; (f + 1,) the first normal of each feature's cone; normals (k, 3).
        half_angles: (f,) how far a feature's normals lean from its middle one, radians.
        middles: (f, 3) a point inside each feature's hull.
        packed: see `ranges.pack_tables`.
        prefixes: (m, k) interpretations of the first k contacts to extend; (1, 0) is the root.
        domains: (n, w) bit sets, the features that each contact may be on.
        spare: how many contacts may be on none (-1).
        switches: bits, which constraints on pairs to apply.
        crowd: completions of a branch from which poses are asked within the tree.
        most_nodes: budget of branches.
        most_leaves: budget of interpretations.
        most_boxes: the most boxes of rotations to look at for a leaf.
        pool: the same for all leaves together.
        finest: the angle of cells of rotations to search one by one, radians; none if it is zero,
            and the normals have to say where to look.
        most_cells: the most cells to look at on the way there.

    Returns:
        (m, n) interpretations; (m, 3, 3) rotations, (m, 3) translations, (m,) least-squares
        misfits, (m, 6, 6) informations about small motions (see `motion_kernels`), (m,) whether
        the pose is a witness; (n,) branches at each level; counts (see
        `branch_kernels.NODES`).
    """
    points = contacts[0]
    n, words, start = len(points), domains.shape[1], prefixes.shape[1]
    readings = np.empty((n, n, 9))
    pair_readings(contacts, errors, readings)
    pairs = (packed, half_angles, errors, switches, model[0], readings)
    problem = (contacts, model, half_angles, middles)
    branches, poses = branch_space(n, words, packed.shape[2]), branch_poses(n)
    left, sizes, nulls, rooms, posed = branches[0], branches[1], branches[4], branches[5], poses[0]
    faces = np.full(n, -1, np.int64)
    rotation, translation = np.empty((3, 3)), np.empty(3)
    space, lean_work = pose_space(n), lean_space(n)
    work, near = space[0], space[2][1]
    beside = (np.empty((3, 3)), np.empty(3))
    effort = (np.zeros(n + 1), np.zeros(n + 1))
    spent, due = effort
    nodes, counts = np.zeros(n, np.int64), np.zeros(COUNTS, np.int64)
    found, kept, found_before = 0, found_space(16, n), np.zeros(n + 1, np.int64)
    place, slots = 0, table_of(kept[0], 0)
    in_cell = finest > 0.0
    # A leaf in a cell mostly takes more than a sparing share, so that would be wasted on it.
    whole = 0 if in_cell else pool
    between, facings = np.empty((n, n, 3)), np.empty((n, 3))
    known, allowed = domains.copy(), domains.copy()
    allowed_sizes = np.full(n, packed.shape[2])
    slabs, ways = feature_slabs(model), np.empty((n, len(DIRECTIONS), 2))
    cells, cell_angles, firsts = np.empty((1, 3, 3)), np.full(1, -1.0), domains[:1].copy()
    if in_cell:
        known_of(prefixes, known)
        cells, cell_angles, firsts = passing_cells(
            contacts,
            errors,
            model,
            half_angles,
            packed,
            known,
            spare,
            switches,
            readings,
            slabs,
            finest,
            most_cells,
        )
    for turn in range(len(cells)):
        cell, seen = (cells[turn], cell_angles[turn]), (between, cell_angles[turn])
        if in_cell:
            view_cell(cells[turn], points, contacts[1], between, facings)
            view_ways(points, contacts[2], cells[turn], cell_angles[turn], ways)
            allowed[:] = known
            allowed[0] = firsts[turn]
            face_cell(contacts, model, facings, cell_angles[turn], allowed, allowed_sizes, near)
        for m in range(len(prefixes)):
            nulls[start] = begin(
                prefixes[m],
                pairs,
                seen,
                ways,
                slabs,
                allowed,
                allowed_sizes,
                faces,
                left[start],
                sizes[start],
                rooms[start],
            )
            if nulls[start] < 0:
                continue
            posed[start] = -1
            for k in range(start + 1):
                open_branch(k, spent, due)
                found_before[k] = found
            level = start
            open_level(level, spare, branches)
            while level >= start:
                if not next_feature(level, faces, branches):
                    level -= 1
                    continue
                if counts[NODES] == most_nodes or found == most_leaves:
                    counts[CUT] = 1
                    break
                counts[NODES] += 1
                nodes[level] += 1
                depth = level + 1
                open_branch(depth, spent, due)
                found_before[depth] = found
                completions = narrow_rest(level, faces, spare, pairs, seen, ways, slabs, branches)
                if completions < 0.0:
                    continue
                posed[depth] = posed[level]
                leaf = depth == n
                if not leaf and (depth < FEWEST or completions <= crowd):
                    level = depth
                    open_level(level, spare, branches)
                    continue
                angle = start_branch(
                    depth, faces, problem, cell, poses, rotation, translation, beside[0]
                )
                if angle < 0.0:
                    continue
                if not leaf:
                    if angle > VAGUE or pose_branch(
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
                        level = depth
                        open_level(level, spare, branches)
                    continue
                if not leans(n, faces, contacts, errors, model, half_angles, *cell, lean_work):
                    continue
                # A pose may be in several cells.
                same = found
                if in_cell:
                    place = place_of(faces, kept[0], slots)
                    if slots[place] >= 0:
                        same = slots[place]
                        if kept[5][same]:
                            continue
                counts[LEAVES_TRIED] += 1
                verdict, branch, looked = try_leaf(
                    start,
                    n,
                    faces,
                    problem,
                    cell,
                    angle,
                    share_of(most_boxes, pool, whole),
                    pool,
                    effort,
                    rotation,
                    translation,
                    beside,
                    space,
                )
                pool -= looked
                counts[BOXES] += looked
                if branch < n:
                    level = branch - 1
                    if not in_cell:
                        # What stayed undecided there is rejected with it.
                        found = found_before[branch]
                    continue
                if verdict == REJECTED or (same < found and verdict != FEASIBLE):
                    continue
                if found == len(kept[0]):
                    kept = with_room(kept)
                    if in_cell:
                        slots = table_of(kept[0], found)
                        place = place_of(faces, kept[0], slots)
                if in_cell:
                    slots[place] = same
                kept[3][same] = finish(
                    n, faces, contacts, model, rotation, translation, work, kept[4][same]
                )
                kept[0][same], kept[1][same], kept[2][same] = faces, rotation, translation
                kept[5][same] = verdict == FEASIBLE
                found += same == found
            if counts[CUT]:
                break
        if counts[CUT]:
            break
    return (
        kept[0][:found],
        kept[1][:found],
        kept[2][:found],
        kept[3][:found],
        kept[4][:found],
        kept[5][:found],
        nodes,
        counts,
    )
