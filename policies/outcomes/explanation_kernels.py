"""Compiled search for faces that explain what another pose predicts to be felt."""

from __future__ import annotations

import numpy as np

from ...recognizer.compiling import vectorised
from ...recognizer.models.polygon_kernels import foot_in_polygon

ENOUGH = 0.9
"""A face that explains this share of reports is as good as one that explains all."""
EXPLAINED = 0.1
"""A face that explains this share of reports is the one; no other one explains many more."""


@vectorised
def _share_within(distance):
    """How likely a point off by noise is still explained by a plane.

    Noise is uniform in a ball about a point that is ``distance`` of its radii, 0 to 2, from the
    plane; what is felt is explained within one radius.
    """
    t = 1.0 - distance
    return 0.25 * (2.0 + 3.0 * t - t * t * t)


@vectorised
def likelihoods_explained(compared, overlaps, points, poses, pose_spreads, faces, space, out):
    """As `outcome_kernels.likelihoods_left`, but any face of a pose may explain a touch.

    What the face that the same ray meets explains well enough isn't looked at again. All in one
    function, as handing arrays on takes longer than what would be done with them.

    Args:
        compared: the arguments of `likelihoods_left` before ``overlaps``.
        overlaps: likewise.
        points: (a, 3, s, 3) where each pose says a ray touches, world, metres.
        poses: (s,) first face of each pose's model, (s,) one past its last, (s, 3, 3) rotations,
            (s, 3) positions, (s, 3) centroids in the world.
        pose_spreads: (s,) standard deviations of shift, metres, and (s,) of turn, radians.
        faces: normals, offsets, polygons of faces, corners of polygons, corners, and (8, f) normals
            and offsets again, centres and radii of balls around the faces, a row a coordinate; of
            all models.
        space: (3,) a vector, (f,) numbers of faces, and twice (f,) numbers.
        out: (a, s, s) as `likelihoods_left` writes it; changed in place.
    """
    touched, depths, slopes, spreads, felt, _, reach, widths, misses_tell = compared
    first_face, last_face, rotations, positions, centres = poses
    shift_spread, turn_spread = pose_spreads
    normals, offsets, first, start, corners, planes = faces
    x, near, shares, lowest = space
    probes, count = touched.shape
    steps = len(overlaps) - 2
    for a in range(probes):
        for i in range(count):
            mine = touched[a, i]
            for j in range(count):
                before = out[a, i, j]
                if before >= EXPLAINED:
                    continue
                other = touched[a, j]
                value = 1.0
                if misses_tell and other & ~mine:
                    value = 0.0
                for k in range(depths.shape[1]):
                    if value <= before:
                        break
                    if not (mine >> k) & 1:
                        continue
                    arm = 0.0
                    for b in range(3):
                        arm += (points[a, k, i, b] - centres[j, b]) ** 2
                    along = spreads[a, k, i] * slopes[a, k, i]
                    slack = reach + np.sqrt(
                        along * along + shift_spread[j] ** 2 + arm * turn_spread[j] ** 2
                    )
                    nearer = depths[a, k, i] - depths[a, k, j]
                    if misses_tell and (other >> k) & 1 and nearer * slopes[a, k, j] > 2.0 * slack:
                        # The ray would have met the second pose on its way.
                        value = 0.0
                        break
                    p0 = points[a, k, i, 0] - positions[j, 0]
                    p1 = points[a, k, i, 1] - positions[j, 1]
                    p2 = points[a, k, i, 2] - positions[j, 2]
                    n0, n1, n2 = felt[a, k, i, 0], felt[a, k, i, 1], felt[a, k, i, 2]
                    x0 = rotations[j, 0, 0] * p0 + rotations[j, 1, 0] * p1 + rotations[j, 2, 0] * p2
                    x1 = rotations[j, 0, 1] * p0 + rotations[j, 1, 1] * p1 + rotations[j, 2, 1] * p2
                    x2 = rotations[j, 0, 2] * p0 + rotations[j, 1, 2] * p1 + rotations[j, 2, 2] * p2
                    u0 = rotations[j, 0, 0] * n0 + rotations[j, 1, 0] * n1 + rotations[j, 2, 0] * n2
                    u1 = rotations[j, 0, 1] * n0 + rotations[j, 1, 1] * n1 + rotations[j, 2, 1] * n2
                    u2 = rotations[j, 0, 2] * n0 + rotations[j, 1, 2] * n1 + rotations[j, 2, 2] * n2
                    # Two points felt within a bound are within two; two normals likewise.
                    far, width = 2.0 * slack, widths[i, j]
                    by_chord, by_height = 1.0 / (width * width), 1.0 / far
                    for f in range(first_face[j], last_face[j]):
                        along = u0 * planes[0, f] + u1 * planes[1, f] + u2 * planes[2, f]
                        height = x0 * planes[0, f] + x1 * planes[1, f] + x2 * planes[2, f]
                        height -= planes[3, f]
                        y0, y1, y2 = x0 - planes[4, f], x1 - planes[5, f], x2 - planes[6, f]
                        away = np.sqrt(y0 * y0 + y1 * y1 + y2 * y2) - planes[7, f]
                        lowest[f] = max(abs(height), away)
                        shares[f] = max((2.0 - 2.0 * along) * by_chord, lowest[f] * by_height)
                    found = 0
                    for f in range(first_face[j], last_face[j]):
                        near[found] = f
                        found += 1 if shares[f] < 1.0 else 0
                    x[0], x[1], x[2] = x0, x1, x2
                    best = 0.0
                    for place in range(found):
                        f = near[place]
                        along = u0 * planes[0, f] + u1 * planes[1, f] + u2 * planes[2, f]
                        at = steps * np.sqrt(max(2.0 - 2.0 * along, 0.0)) / width
                        step = min(int(at), steps)
                        facing = overlaps[step] + (at - step) * (
                            overlaps[step + 1] - overlaps[step]
                        )
                        # No nearer than its plane and the ball around it: so much at most.
                        if _share_within(lowest[f] / slack) * facing <= best:
                            continue
                        squared = far * far
                        for p in range(first[f], first[f + 1]):
                            gap, _, _, _ = foot_in_polygon(
                                x, normals[f], offsets[f], corners, start[p], start[p + 1]
                            )
                            squared = min(squared, gap)
                        best = max(best, _share_within(np.sqrt(squared) / slack) * facing)
                        if best >= ENOUGH:
                            break
                    value *= best
                out[a, i, j] = max(before, np.float32(value))
