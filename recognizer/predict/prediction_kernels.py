"""Compiled ray casting of many rays at many poses, for predictions.

A solid is cast as its faces, each the union of convex polygons: a ray meets the plane of a face
once, whatever the face's shape. Rays are taken in blocks that look about the same way. For a face
that some of them come to from outside, one loop over the block, free of branches so that it becomes
vector instructions, says which rays meet the box around the face before anything met so far; these
few are then held against the face's edges.

Which face is met first is found in single precision, about the point of the ray nearest to the
centroid, so that it is good to a millionth of the solid's radius: less than a tenth of a micrometre
for what a hand can hold. How deep the ray meets that face is computed in double precision.

Only faces that a ray comes to from outside count: the first face that a ray from outside a closed
solid meets is one of these.
"""

from __future__ import annotations

import numpy as np

from ..compiling import vectorised

BLOCK = 128
"""Rays in a block: its rows stay in the first cache."""
ROWS = 12
"""Rows of work space a block."""
SLACK = 1e-6
"""How far outside an edge a ray still meets a face, as a share of the solid's radius: above
rounding, so that no ray slips between two faces, and far below what can be felt."""
GRAZING = np.float32(1e-6)
"""Cosine to a face's normal from which on a ray meets the face; one less steep passes along it."""
ONE, NONE, FAR = np.float32(1.0), np.float32(0.0), np.float32(1e30)


@vectorised
def _gather(rays, centre, radius, near, middles):
    """The rays that come near a solid before they meet the plane.

    Args:
        rays: see `predict_rays`.
        centre: (3,) of a ball around the solid, world.
        radius: of that ball, and of what goes along the rays.
        near: (r,) written in place: their numbers, in the order of the rays.
        middles: (r,) written in place: the depth at which each is nearest to the centre.

    Returns:
        How many there are.
    """
    starts, directions, order, plane = rays
    count = 0
    squared = radius * radius
    for k in range(len(order)):
        r = order[k]
        x = centre[0] - starts[r, 0]
        y = centre[1] - starts[r, 1]
        z = centre[2] - starts[r, 2]
        along = x * directions[r, 0] + y * directions[r, 1] + z * directions[r, 2]
        room = squared - (x * x + y * y + z * z - along * along)
        behind = along - plane[r]
        meets = room > 0.0
        meets &= (behind < 0.0) | (behind * behind < room)
        meets &= (along > 0.0) | (along * along < room)
        near[count] = r
        middles[count] = along
        count += 1 if meets else 0
    return count


@vectorised
def _cast_block(count, faces, boxes, edges, slack, tip, work, chosen, met):
    """First faces of a block of rays in the object's frame.

    Args:
        count: how many rays.
        faces: see `predict_rays`.
        boxes: likewise.
        edges: likewise.
        slack: how far outside an edge still is inside, metres.
        tip: radius of what goes along the rays.
        work: (ROWS, BLOCK); rows 0 to 2 are points of the rays, 3 to 5 directions, 6 the least
            depth from that point and 7 the largest at which anything is met; row 7 is lowered.
        chosen: (BLOCK,) work space.
        met: (BLOCK,) written in place: the face, -1 for none.
    """
    normals, offsets, axes, first, start = faces
    least, best, depths, across, up = work[6], work[7], work[8], work[9], work[10]
    takes = work[11]
    l0, l1, l2, h0, h1, h2 = FAR, FAR, FAR, -FAR, -FAR, -FAR
    for j in range(count):
        met[j] = -1
        l0, h0 = min(l0, work[3, j]), max(h0, work[3, j])
        l1, h1 = min(l1, work[4, j]), max(h1, work[4, j])
        l2, h2 = min(l2, work[5, j]), max(h2, work[5, j])
    for f in range(len(offsets)):
        n0, n1, n2 = normals[f, 0], normals[f, 1], normals[f, 2]
        steepest = min(n0 * l0, n0 * h0) + min(n1 * l1, n1 * h1) + min(n2 * l2, n2 * h2)
        if steepest > -GRAZING:
            continue
        offset = offsets[f]
        middle_x, middle_y, half_x, half_y = boxes[f, 0], boxes[f, 1], boxes[f, 2], boxes[f, 3]
        x, y = work[axes[f, 0]], work[axes[f, 1]]
        dx, dy = work[3 + axes[f, 0]], work[3 + axes[f, 1]]
        for j in range(count):
            cosine = n0 * work[3, j] + n1 * work[4, j] + n2 * work[5, j]
            front = cosine < -GRAZING
            # No NaN: where a ray doesn't come to the face, one is divided by.
            inverse = ONE / (cosine if front else -ONE)
            height = n0 * work[0, j] + n1 * work[1, j] + n2 * work[2, j] - offset
            depth = -height * inverse
            # A ball's centre is where its surface meets the plane of the face.
            centred = depth + tip * inverse
            g = x[j] + depth * dx[j] - middle_x
            h = y[j] + depth * dy[j] - middle_y
            inside = (abs(g) <= half_x) & (abs(h) <= half_y)
            depths[j] = centred
            across[j] = g
            up[j] = h
            good = front & inside & (centred < best[j]) & (depth >= least[j])
            takes[j] = ONE if good else NONE
        some = 0
        for j in range(count):
            chosen[some] = j
            some += 1 if takes[j] > NONE else 0
        for k in range(some):
            j = chosen[k]
            g, h = across[j], up[j]
            for p in range(first[f], first[f + 1]):
                inside = True
                for e in range(start[p], start[p + 1]):
                    inside &= edges[e, 0] * g + edges[e, 1] * h + edges[e, 2] >= -slack
                if inside:
                    best[j] = depths[j]
                    met[j] = f
                    break


@vectorised
def predict_rays(rays, exact, faces, boxes, edges, solid, tip, rows, poses, predictions, space):
    """What rays meet on one solid at a number of poses.

    Args:
        rays: starts (r, 3), unit directions (r, 3), the order to take them in (r,), depths of the
            plane (r,) as the tip's centre has it; world, metres.
        exact: normals (f, 3) and offsets (f,) of the faces.
        faces: the same about the centroid, in single precision; the two axes that each is looked at
            along (f, 2), its first polygon (f + 1,), the first edge of each polygon (p + 1,).
        boxes: (f, 4) middle and half the sides of the box around each face in these axes.
        edges: (e, 3) of each edge ``a, b, c`` so that ``a x + b y + c`` is above zero inside, from
            the box's middle.
        solid: centroid (3,), object frame, and the radius about it that holds the solid.
        tip: radius of what goes along the rays, metres.
        rows: (k,) the poses that this solid is at.
        poses: positions (s, 3), rotations (s, 3, 3) model to world, standard deviations of shift
            (s,) and turn (s,).
        predictions: outcomes (s, r), depths (s, r), normals (s, r, 3), spread (s, r); what the
            plane has in them is overwritten where the solid is met first.
        space: work space: (ROWS, BLOCK) single precision, (BLOCK,) and (BLOCK,) integers, (r,)
            integers, (r,) and (3,) numbers.
    """
    starts, directions, _, plane = rays
    positions, rotations, position_spread, rotation_spread = poses
    outcomes, depths, normals, spread = predictions
    centroid, radius = solid
    work, chosen, met, near, middles, centre = space
    slack = np.float32(SLACK * radius)
    small_tip = np.float32(tip)
    for k in range(len(rows)):
        s = rows[k]
        turn = rotations[s]
        for i in range(3):
            centre[i] = positions[s, i]
            for m in range(3):
                centre[i] += turn[i, m] * centroid[m]
        count = _gather(rays, centre, radius + tip, near, middles)
        moves, turns = position_spread[s] ** 2, rotation_spread[s] ** 2
        for begin in range(0, count, BLOCK):
            size = min(BLOCK, count - begin)
            for j in range(size):
                r, middle = near[begin + j], middles[begin + j]
                d0, d1, d2 = directions[r, 0], directions[r, 1], directions[r, 2]
                x = starts[r, 0] + middle * d0 - centre[0]
                y = starts[r, 1] + middle * d1 - centre[1]
                z = starts[r, 2] + middle * d2 - centre[2]
                for i in range(3):
                    work[i, j] = turn[0, i] * x + turn[1, i] * y + turn[2, i] * z
                    work[3 + i, j] = turn[0, i] * d0 + turn[1, i] * d1 + turn[2, i] * d2
                work[6, j] = -middle
                work[7, j] = plane[r] - middle
            _cast_block(size, faces, boxes, edges, slack, small_tip, work, chosen, met)
            for j in range(size):
                f = met[j]
                if f < 0:
                    continue
                r = near[begin + j]
                a0, a1, a2 = exact[0][f, 0], exact[0][f, 1], exact[0][f, 2]
                n0 = turn[0, 0] * a0 + turn[0, 1] * a1 + turn[0, 2] * a2
                n1 = turn[1, 0] * a0 + turn[1, 1] * a1 + turn[1, 2] * a2
                n2 = turn[2, 0] * a0 + turn[2, 1] * a1 + turn[2, 2] * a2
                d0, d1, d2 = directions[r, 0], directions[r, 1], directions[r, 2]
                x = starts[r, 0] - positions[s, 0]
                y = starts[r, 1] - positions[s, 1]
                z = starts[r, 2] - positions[s, 2]
                cosine = n0 * d0 + n1 * d1 + n2 * d2
                depth = (exact[1][f] + tip - (n0 * x + n1 * y + n2 * z)) / cosine
                # Where the solid is touched, about its centroid.
                a0 = starts[r, 0] + depth * d0 - tip * n0 - centre[0]
                a1 = starts[r, 1] + depth * d1 - tip * n1 - centre[1]
                a2 = starts[r, 2] + depth * d2 - tip * n2 - centre[2]
                l0, l1, l2 = a1 * n2 - a2 * n1, a2 * n0 - a0 * n2, a0 * n1 - a1 * n0
                lever = l0 * l0 + l1 * l1 + l2 * l2
                outcomes[s, r] = 1
                depths[s, r] = depth
                spread[s, r] = np.sqrt(moves + lever * turns) / -cosine
                normals[s, r, 0], normals[s, r, 1], normals[s, r, 2] = n0, n1, n2
