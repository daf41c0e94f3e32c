"""Compiled cuts: what a pose breaks becomes one more reading of its interpretation."""

from __future__ import annotations

import numpy as np

from ...compiling import kernel
from ...contacts.reading_kernels import carry, read
from ...models.distance_kernels import signed_distance
from ..proofs.proof_kernels import locate
from .breach_kernels import below_support, move_inside, pierced_paths, seen_from_behind
from .slot_kernels import (
    CUTS,
    cut_approach,
    cut_path,
    cut_support,
    list_exits,
)

PLACES = 8
"""Places of a path that breaks its bound that are looked at for a cut."""
NOTHING, CUT, STUCK = 0, 1, 2
"""What came of a pose: it breaks nothing, it gave a cut, or it breaks what gives none."""


@kernel
def _cut_paths(
    row,
    depth,
    faces,
    farthest,
    solid_faces,
    contacts,
    model,
    paths,
    broken,
    worst_places,
    pose,
    angle,
    work,
    levels,
    space,
):
    """Cut at the place of a broken path with the fewest ways out; returns whether there is any."""
    rotation, translation = pose
    starts, ends, clearances, grains = paths
    place, nearest, near, trial = space[6], space[7], space[8], space[9]
    best = space[10]
    choices = np.empty(solid_faces, np.int64)
    heights = np.empty((solid_faces, 2))
    fewest, reach = solid_faces + 1, 0.0
    for b in range(len(broken)):
        s = broken[b]
        for part in range(PLACES + 1):
            if part == 0:
                place[:] = worst_places[b]
            else:
                share = (part - 0.5) / PLACES
                for k in range(3):
                    place[k] = 0.0
                    for i in range(3):
                        along = starts[s, i] + share * (ends[s, i] - starts[s, i])
                        place[k] += rotation[i, k] * (along - translation[i])
                depth_here = signed_distance(place, model, solid_faces, nearest, near)
                if depth_here >= min(clearances[s], 0.0) - grains[s]:
                    continue
            clearance = move_inside(place, clearances[s], model, solid_faces, nearest, near, trial)
            if clearance > 0.0:
                continue
            found, away = list_exits(
                place,
                clearance,
                row,
                faces,
                farthest,
                fewest,
                solid_faces,
                contacts,
                model,
                work,
                angle,
                (choices, heights),
            )
            if found >= fewest:
                continue
            fewest, reach = found, away
            best[:] = place
            levels[1][depth] = 2.0 * grains[s]
            levels[3][depth, :found] = choices[:found]
            levels[4][depth, :found] = heights[:found]
            if found == 0:
                break
        if fewest == 0:
            break
    if fewest > solid_faces:
        return False
    cut_path(depth, row, best, fewest, reach, contacts, model, pose, levels)
    return True


@kernel
def cut_pose(
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
):
    """Note what the pose at hand breaks as a cut, if it breaks anything and another cut is allowed.

    Arguments as in `clear_pose`.
    """
    corners, signs, limits, up = support
    directions, leasts = approaches
    near = space[8]
    broken, worst_places = np.empty(len(paths[0]), np.int64), np.empty((len(paths[0]), 3))
    behind, pierced = -1, 0
    corner = below_support(pose, corners, signs, limits, up, model[6])
    if corner < 0:
        behind = seen_from_behind(count, faces, pose, directions, leasts, model, near)
    if corner < 0 and behind < 0:
        pierced = pierced_paths(paths, pose, bound, model, solid_faces, broken, worst_places, space)
        if pierced == 0:
            return NOTHING
    if depth == CUTS:
        return STUCK
    row = count + depth
    rotation, translation = pose
    x, u = work[3][0], work[3][1]
    carry(row, contacts[0], contacts[1], rotation, translation, x, u)
    read(row, faces, faces, x, u, model, contacts, work[0])
    angle, _ = locate(row, faces, faces, model, contacts, rotation, anchor, anchor_angle, work)
    if angle < 0.0:
        # By rounding alone: this pose is within the bounds.
        return STUCK
    levels[7][depth], levels[8][depth], levels[9][depth] = rotation, translation, angle
    # Both ways there lead over a contact: neither end is farther from it than the object is wide.
    farthest = 8.0 * bound + 2.0 * contacts[2][:row].max()
    if corner >= 0:
        slot = features + CUTS + depth
        cut_support(
            depth,
            row,
            faces,
            slot,
            corners[corner],
            signs[corner],
            limits[corner],
            up,
            farthest,
            contacts,
            model,
            pose,
            work,
            levels,
        )
    elif behind >= 0:
        cut_approach(
            depth, row, behind, faces[behind], directions[behind], leasts[behind], contacts, levels
        )
    elif not _cut_paths(
        row,
        depth,
        faces,
        farthest,
        solid_faces,
        contacts,
        model,
        paths,
        broken[:pierced],
        worst_places,
        pose,
        angle,
        work,
        levels,
        space,
    ):
        # The paths are too near by less than their test is strict.
        return STUCK
    return CUT
