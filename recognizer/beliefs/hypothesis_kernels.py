"""Compiled grouping and weighing of poses."""

from __future__ import annotations

import numpy as np

from ..compiling import kernel


@kernel
def group_poses(rotations, centres, symmetries, most_turn, most_shift):
    """Put each pose into the first group whose leader it is close to, or open a new one.

    Poses are close if their centroids are, and if some symmetry of the object brings their
    rotations together.

    Args:
        rotations: (m, 3, 3) object to world, best pose first.
        centres: (m, 3) the object's centroid in the world, metres.
        symmetries: (g, 3, 3) the object's rotations onto itself.
        most_turn: largest angle within a group, radians.
        most_shift: largest shift within a group, metres.

    Returns:
        (m,) group of each pose, numbered by first appearance.
    """
    count = len(rotations)
    groups = np.empty(count, np.int64)
    leaders = np.empty(count, np.int64)
    found = 0
    # A rotation by s has trace 1 + 2 cos s.
    least_trace = 1.0 + 2.0 * np.cos(most_turn)
    for m in range(count):
        groups[m] = -1
        for g in range(found):
            k = leaders[g]
            shift = 0.0
            for i in range(3):
                shift += (centres[m, i] - centres[k, i]) ** 2
            if shift > most_shift * most_shift:
                continue
            between = rotations[k].T @ rotations[m]
            for s in range(len(symmetries)):
                trace = 0.0
                for i in range(3):
                    for j in range(3):
                        trace += between[i, j] * symmetries[s, i, j]
                if trace >= least_trace:
                    groups[m] = g
                    break
            if groups[m] >= 0:
                break
        if groups[m] < 0:
            groups[m] = found
            leaders[found] = m
            found += 1
    return groups


@kernel
def weigh_poses(poses, centre, symmetries, known, most_turn, most_shift, allowed):
    """Group poses, and weigh each group by the volumes of its poses; see `hypotheses.cluster`.

    Args:
        poses: (m, 3, 3) rotations and (m, 3) translations, object to world; (m,) misfits;
            (m, 6, 6) informations; (m,) whether the pose is a witness; (m, 2) reaches, see
            `pose.Poses`.
        centre: (3,) the object's centroid, object frame, metres.
        symmetries: (g, 3, 3) the object's rotations onto itself.
        known: (6,) information about small motions beforehand, inverse square metres.
        most_turn: largest angle within a group, radians.
        most_shift: largest shift within a group, metres.
        allowed: what three standard deviations of a motion may be for it to count as fixed, metres.

    Returns:
        (m,) rows of the poses, group by group, the best of each first; (k + 1,) where each group
        starts among them; of each group the pose of its best member, (k, 4, 4), and its covariance,
        (k, 6, 6); (k,) the logarithm of its weight, not yet normalised; of each row of the poses
        its principal motions, (m, 6, 6), columns, and which of them are open, (m, 6); (k, 2) how
        far the poses that a group stands for can be from that of its best member: the turn,
        radians, and the way of the object's centroid, metres.
    """
    rotations, translations, costs, informations, proven, reaches = poses
    count = len(costs)
    members, starts = _in_groups(
        rotations, translations, costs, proven, centre, symmetries, most_turn, most_shift
    )
    found = len(starts) - 1
    matrices, covariances = np.zeros((found, 4, 4)), np.zeros((found, 6, 6))
    log_weights, far = np.empty(found), np.zeros((found, 2))
    motions, loose = np.empty((count, 6, 6)), np.empty((count, 6), np.bool_)
    shares = np.empty(count)
    prior = np.zeros((6, 6))
    for k in range(6):
        prior[k, k] = known[k]
    for g in range(found):
        for at in range(starts[g], starts[g + 1]):
            row = members[at]
            precisions, motions[row] = np.linalg.eigh(informations[row] + prior)
            shares[at] = np.log(len(symmetries)) - 0.5 * costs[row]
            for k in range(6):
                shares[at] -= 0.5 * np.log(precisions[k])
                loose[row, k] = 3.0 / np.sqrt(precisions[k]) > allowed
            best = members[starts[g]]
            turn, way = _apart(rotations, translations, best, row, centre, symmetries)
            far[g, 0] = max(far[g, 0], turn + reaches[row, 0])
            far[g, 1] = max(far[g, 1], way + reaches[row, 1])
            if at == starts[g]:
                matrices[g, :3, :3], matrices[g, :3, 3] = rotations[row], translations[row]
                matrices[g, 3, 3] = 1.0
                covariances[g] = (motions[row] / precisions) @ motions[row].T
        of_group = shares[starts[g] : starts[g + 1]]
        most = of_group.max()
        log_weights[g] = most + np.log(np.exp(of_group - most).sum())
    return members, starts, matrices, covariances, log_weights, motions, loose, far


@kernel
def _apart(rotations, translations, first, second, centre, symmetries):
    """The turn between two poses, up to a symmetry of the object, and the way of its centroid."""
    if first == second:
        return 0.0, 0.0
    square, most = 0.0, -1.0
    for i in range(3):
        way = translations[second, i] - translations[first, i]
        for j in range(3):
            way += (rotations[second, i, j] - rotations[first, i, j]) * centre[j]
        square += way * way
    between = rotations[first].T @ rotations[second]
    for s in range(len(symmetries)):
        trace = 0.0
        for i in range(3):
            for j in range(3):
                trace += between[i, j] * symmetries[s, i, j]
        most = max(most, 0.5 * (trace - 1.0))
    return np.arccos(min(most, 1.0)), np.sqrt(square)


@kernel
def _in_groups(rotations, translations, costs, proven, centre, symmetries, most_turn, most_shift):
    """Rows of poses group by group, best first, and where each group starts among them."""
    count = len(costs)
    # Witnesses first, then by misfit.
    by_cost = np.argsort(costs, kind="mergesort")
    ranked = np.concatenate((by_cost[proven[by_cost]], by_cost[~proven[by_cost]]))
    turns, centres = rotations[ranked], np.empty((count, 3))
    for at in range(count):
        for i in range(3):
            centres[at, i] = translations[ranked[at], i]
            for j in range(3):
                centres[at, i] += turns[at, i, j] * centre[j]
    # Groups are numbered by their first members, which are their best.
    groups = group_poses(turns, centres, symmetries, most_turn, most_shift)
    starts = np.zeros(groups.max() + 2, np.int64)
    for at in range(count):
        starts[groups[at] + 1] += 1
    starts = np.cumsum(starts)
    after, members = starts.copy(), np.empty(count, np.int64)
    for at in range(count):
        members[after[groups[at]]] = ranked[at]
        after[groups[at]] += 1
    return members, starts
