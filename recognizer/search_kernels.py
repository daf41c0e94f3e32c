"""Compiled search of the interpretation tree with poses in it, depth first.

Every assignment narrows the features left to later contacts, first by pairs (forward checking on
bit sets), then, where many completions are left, by the pose that the assigned contacts allow: none
ends the branch, and where there is one, features of later contacts are ruled out one by one (see
`look_ahead_kernels`). A leaf gets a verdict that is a pose or a proof.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from .align_kernels import align, middle_translation
from .backjump_kernels import back_to, due_branch, note_boxes, note_witness, open_branch
from .cell_search_kernels import passing_cells, view_cell
from .compiling import borrowing
from .forward_kernels import check_forward, take_lowest
from .leaf_kernels import place_of, table_of
from .lean_kernels import lean_space, leans
from .look_ahead_kernels import drop_beyond_region, drop_rejected, shrink_ball
from .mask_kernels import pair_readings
from .pose_kernels import finish, settle, start_pose
from .prefix_kernels import begin, face_cell
from .proof_kernels import locate, workspace
from .room_kernels import DIRECTIONS, enter, feature_slabs, view_ways
from .search_pose_kernels import box_stack
from .verdict_kernels import FEASIBLE, REJECTED, judge

_ONE = np.uint64(1)
_NONE = np.uint64(0)
VAGUE = 1.2
"""An angle (radians) of rotations too wide for a verdict within the tree to be worth its time."""
NARROW = 0.2
"""An angle (radians) of rotations so narrow that normals alone rule out no more."""
SPARING, SCARCE = 100, 2.0 / 3.0
"""Boxes for a leaf once less than so much of the pool is left: most that are rejected at all take
fewer, and a few that take many do not leave thousands undecided."""
FEW = 8
"""Completions of a branch that are tried one by one: looking ahead would cost as many verdicts."""
PATIENCE = 16
"""Leaves of a model that are tried before it is looked ahead: most models have fewer in all."""
INNER_STEPS = 1
"""Steps of a verdict within the tree, where it may stay open."""
NODES, VERDICTS, INNER_REJECTED, BOXES, CUT, LEAVES_TRIED = 0, 1, 2, 3, 4, 5
COUNTS = 6
"""Places of the counts that a search returns."""


@njit(cache=True)
def _larger(array, size):
    grown = np.empty((size,) + array.shape[1:], array.dtype)
    grown[: len(array)] = array
    return grown


@borrowing
def share_of(most_boxes, pool, whole):
    """How many boxes a leaf may look at, of a pool that was larger once."""
    return min(most_boxes if pool >= SCARCE * whole else SPARING, most_boxes, pool)


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


@njit(cache=True)
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
        the pose is a witness; (n,) branches at each level; counts (see `NODES`).
    """
    points = contacts[0]
    n, features, words = len(points), packed.shape[2], domains.shape[1]
    start = prefixes.shape[1]
    readings = np.empty((n, n, 9))
    pair_readings(contacts, errors, readings)
    left = np.zeros((n + 1, n, words), np.uint64)
    sizes = np.full((n + 1, n), features)
    untried = np.zeros((n, words), np.uint64)
    null_left = np.zeros(n, np.bool_)
    faces = np.full(n, -1, np.int64)
    nulls = np.zeros(n + 1, np.int64)
    posed = np.full(n + 1, -1, np.int64)
    turns = np.empty((n + 1, 3, 3))
    shifts = np.empty((n + 1, 3))
    angles = np.empty(n + 1)
    rotation, translation = np.empty((3, 3)), np.empty(3)
    # A leaf in a cell mostly takes more than a sparing share, so that would be wasted on it.
    whole = 0 if finest > 0.0 else pool
    work = workspace(n)
    stack = box_stack(n)
    row, near, root = np.empty(6), np.empty(3), np.empty((3, 3))
    spent, due = np.zeros(n + 1), np.zeros(n + 1)
    found_before = np.zeros(n + 1, np.int64)
    aligned, branch_turn, branch_shift = np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
    held = (np.empty(n, np.int64), np.empty((3, 3)), np.empty((3, 3)), np.empty(3))
    ball = work[6][1]
    tight = (np.empty((3, 3)), np.empty(3), np.empty(3), np.empty(6), np.empty((3, 3)), np.empty(3))
    nodes = np.zeros(n, np.int64)
    counts = np.zeros(COUNTS, np.int64)
    found = 0
    found_faces = np.empty((16, n), np.int32)
    found_turns = np.empty((16, 3, 3))
    found_shifts = np.empty((16, 3))
    found_costs = np.empty(16)
    found_informations = np.empty((16, 6, 6))
    found_proven = np.empty(16, np.bool_)
    place, slots = 0, table_of(found_faces, 0)
    between = np.empty((n, n, 3))
    facings = np.empty((n, 3))
    pairs = (packed, half_angles, errors, switches, model[0], readings)
    in_cell = finest > 0.0
    known, allowed = domains.copy(), domains.copy()
    allowed_sizes = np.full(n, features)
    slabs = feature_slabs(model)
    lean_work = lean_space(n)
    rooms = np.empty((n + 1, len(DIRECTIONS), 2))
    ways = np.empty((n, len(DIRECTIONS), 2))
    cells, cell_angles, firsts = np.empty((1, 3, 3)), np.zeros(1), domains[:1].copy()
    if in_cell:
        # What is known of the first contacts says where to look.
        known[:start] = _NONE
        for m in range(len(prefixes)):
            for i in range(start):
                f = prefixes[m, i]
                if f >= 0:
                    known[i, f >> 6] |= _ONE << np.uint64(f & 63)
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
        cell_angle = -1.0
        if in_cell:
            cell_angle = cell_angles[turn]
            view_cell(cells[turn], points, contacts[1], between, facings)
            view_ways(points, contacts[2], cells[turn], cell_angle, ways)
            allowed[:] = known
            allowed[0] = firsts[turn]
            face_cell(contacts, model, facings, cell_angle, allowed, allowed_sizes, near)
        for m in range(len(prefixes)):
            nulls[start] = begin(
                prefixes[m],
                pairs,
                (between, cell_angle),
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
            level = start
            for k in range(start + 1):
                open_branch(k, spent, due)
                found_before[k] = found
            untried[level] = left[level, level]
            null_left[level] = nulls[level] < spare
            while level >= start:
                # The next feature of this contact, or none at all.
                face = take_lowest(untried[level])
                if face < 0:
                    if not null_left[level]:
                        level -= 1
                        continue
                    null_left[level] = False
                faces[level] = face
                depth = level + 1
                nulls[depth] = nulls[level] + (1 if face < 0 else 0)
                if counts[NODES] == most_nodes or found == most_leaves:
                    counts[CUT] = 1
                    level = -1
                    break
                counts[NODES] += 1
                nodes[level] += 1
                open_branch(depth, spent, due)
                found_before[depth] = found
                if face < 0:
                    rooms[depth] = rooms[level]
                elif in_cell and not enter(ways[level], slabs[face], rooms[level], rooms[depth]):
                    continue
                empty, completions = check_forward(
                    level,
                    face,
                    depth,
                    spare - nulls[depth],
                    pairs,
                    (between, cell_angle),
                    left[level],
                    sizes[level],
                    left[depth],
                    sizes[depth],
                )
                if nulls[depth] + empty > spare:
                    continue
                posed[depth] = posed[level]
                last = posed[depth]
                leaf = depth == n
                if not leaf and (depth < 3 or completions <= crowd):
                    level = depth
                    untried[level] = left[level, level]
                    null_left[level] = nulls[level] < spare
                    continue
                # Where the pose can be: about that of a shorter branch, or as the normals have it.
                if last >= 0:
                    rotation[:], translation[:] = turns[last], shifts[last]
                    angle = angles[last]
                    # All normals together may say more than the shorter branch's poses.
                    if (
                        angle > NARROW
                        and not in_cell
                        and align(depth, faces, model, half_angles, contacts, aligned) < 0.0
                    ):
                        continue
                elif in_cell:
                    rotation[:] = cells[turn]
                    middle_translation(depth, faces, points, middles, rotation, translation)
                    angle = cell_angle
                else:
                    angle = start_pose(
                        depth, faces, contacts, model, half_angles, middles, rotation, translation
                    )
                    if angle < 0.0:
                        continue
                if not leaf:
                    if angle > VAGUE:
                        level = depth
                        untried[level] = left[level, level]
                        null_left[level] = nulls[level] < spare
                        continue
                    counts[VERDICTS] += 1
                    ball[:] = rotation
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
                        angle, _ = locate(
                            depth, faces, faces, model, contacts, rotation, ball, angle, work
                        )
                    if verdict == REJECTED or angle < 0.0:
                        counts[INNER_REJECTED] += 1
                        note_boxes(depth, 0, spent)
                        continue
                    posed[depth] = depth
                    turns[depth], shifts[depth], angles[depth] = rotation, translation, angle
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
                        (row, near, root),
                    )
                    empty, completions = count_ways(depth, sizes[depth])
                    if (
                        nulls[depth] + empty <= spare
                        and completions > FEW
                        and counts[LEAVES_TRIED] >= PATIENCE
                    ):
                        # The tighter the ball, the more of these verdicts are rejections.
                        angle = shrink_ball(
                            depth,
                            faces,
                            model,
                            contacts,
                            angle,
                            turns[depth],
                            shifts[depth],
                            work,
                            stack,
                            tight,
                        )
                        if angle < 0.0:
                            counts[INNER_REJECTED] += 1
                            note_boxes(depth, 0, spent)
                            continue
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
                        continue
                    level = depth
                    untried[level] = left[level, level]
                    null_left[level] = nulls[level] < spare
                    continue
                # A pose may be in several cells.
                same = found
                if not leans(
                    n,
                    faces,
                    contacts,
                    errors,
                    model,
                    half_angles,
                    cells[turn],
                    cell_angle,
                    lean_work,
                ):
                    continue
                if in_cell:
                    place = place_of(faces, found_faces, slots)
                    if slots[place] >= 0:
                        same = slots[place]
                        if found_proven[same]:
                            continue
                counts[LEAVES_TRIED] += 1
                ball[:] = rotation
                verdict, looked = settle(
                    n,
                    faces,
                    contacts,
                    model,
                    ball,
                    angle,
                    share_of(most_boxes, pool, whole),
                    rotation,
                    translation,
                    work,
                    stack,
                )
                pool -= looked
                counts[BOXES] += looked
                if verdict == FEASIBLE:
                    note_witness(n, due)
                else:
                    note_boxes(n, looked, spent)
                    branch = n
                    if due_branch(start, n, spent, due) >= 0:
                        branch, looked = back_to(
                            start,
                            n,
                            faces,
                            contacts,
                            model,
                            half_angles,
                            middles,
                            (cells[turn], cell_angle),
                            pool,
                            (spent, due),
                            branch_turn,
                            branch_shift,
                            work,
                            stack,
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
                if found == len(found_costs):
                    found_faces = _larger(found_faces, 2 * found)
                    found_turns = _larger(found_turns, 2 * found)
                    found_shifts = _larger(found_shifts, 2 * found)
                    found_costs = _larger(found_costs, 2 * found)
                    found_informations = _larger(found_informations, 2 * found)
                    found_proven = _larger(found_proven, 2 * found)
                    if in_cell:
                        slots = table_of(found_faces, found)
                        place = place_of(faces, found_faces, slots)
                if in_cell:
                    slots[place] = same
                found_costs[same] = finish(
                    n, faces, contacts, model, rotation, translation, work, found_informations[same]
                )
                found_faces[same] = faces
                found_turns[same] = rotation
                found_shifts[same] = translation
                found_proven[same] = verdict == FEASIBLE
                found += same == found
            if counts[CUT]:
                break
        if counts[CUT]:
            break
    return (
        found_faces[:found],
        found_turns[:found],
        found_shifts[:found],
        found_costs[:found],
        found_informations[:found],
        found_proven[:found],
        nodes,
        counts,
    )
