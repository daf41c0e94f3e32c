"""Compiled search for faces that explain what another pose predicts to be felt."""

from __future__ import annotations

import numpy as np

from ..recognizer.compiling import borrowing
from ..recognizer.polygon_kernels import foot_in_polygon

ENOUGH = 0.9
"""A face that explains this share of reports is as good as one that explains all."""
EXPLAINED = 0.1
"""A face that explains this share of reports is the one; no other one explains many more."""


@borrowing
def _share_within(distance):
    """How likely a point off by noise is still explained by a plane.

    Noise is uniform in a ball about a point that is ``distance`` of its radii, 0 to 2, from the
    plane; what is felt is explained within one radius.
    """
    t = 1.0 - distance
    return 0.25 * (2.0 + 3.0 * t - t * t * t)


@borrowing
def _best_explanation(
    point, normal, first_face, last_face, faces, slack, width, overlaps, x, u, rotation, position
):
    """How likely a touch is to be explained by some face of a pose: the largest of its faces'.

    Args:
        point: (3,) the point touched, world, metres.
        normal: (3,) of the face touched, world.
        first_face: the first face of the pose's model among all models'.
        last_face: one past its last.
        faces: normals, offsets, polygons of faces, corners of polygons, corners; of all models.
        slack: bound on how far a point felt may be off, metres.
        width: chord of the angle between normals up to which one report may fit both.
        overlaps: see `outcome_kernels.likelihoods_left`.
        x: (3,) work space.
        u: (3,) likewise.
        rotation: (3, 3) model to world.
        position: (3,) likewise, metres.
    """
    normals, offsets, first, start, corners = faces
    for a in range(3):
        x[a] = 0.0
        u[a] = 0.0
        for b in range(3):
            x[a] += rotation[b, a] * (point[b] - position[b])
            u[a] += rotation[b, a] * normal[b]
    steps = len(overlaps) - 2
    best = 0.0
    far = 2.0 * slack
    for f in range(first_face, last_face):
        n = normals[f]
        chord = 2.0 - 2.0 * (u[0] * n[0] + u[1] * n[1] + u[2] * n[2])
        if chord >= width * width:
            continue
        height = n[0] * x[0] + n[1] * x[1] + n[2] * x[2] - offsets[f]
        if abs(height) >= far:
            continue
        place = steps * np.sqrt(max(chord, 0.0)) / width
        step = int(place)
        facing = overlaps[step] + (place - step) * (overlaps[step + 1] - overlaps[step])
        # The face is no nearer than its plane, so that much at most.
        if _share_within(abs(height) / slack) * facing <= best:
            continue
        squared = far * far
        for p in range(first[f], first[f + 1]):
            gap, _, _, _ = foot_in_polygon(x, n, offsets[f], corners, start[p], start[p + 1])
            squared = min(squared, gap)
        value = _share_within(np.sqrt(squared) / slack) * facing
        best = max(best, value)
        if best >= ENOUGH:
            break
    return best


@borrowing
def likelihoods_explained(compared, overlaps, points, poses, pose_spreads, faces, space, out):
    """As `outcome_kernels.likelihoods_left`, but any face of a pose may explain a touch.

    What the face that the same ray meets explains well enough isn't looked at again.

    Args:
        compared: the arguments of `likelihoods_left` before ``overlaps``.
        overlaps: likewise.
        points: (a, 3, s, 3) where each pose says a ray touches, world, metres.
        poses: (s,) first face of each pose's model, (s,) one past its last, (s, 3, 3) rotations,
            (s, 3) positions, (s, 3) centroids in the world.
        pose_spreads: (s,) standard deviations of shift, metres, and (s,) of turn, radians.
        faces: normals, offsets, polygons of faces, corners of polygons, corners; of all models.
        space: two (3,) vectors.
        out: (a, s, s) as `likelihoods_left` writes it; changed in place.
    """
    touched, depths, slopes, spreads, normals, _, reach, widths, misses_tell = compared
    first_face, last_face, rotations, positions, centres = poses
    shift_spread, turn_spread = pose_spreads
    x, u = space
    probes, count = touched.shape
    for a in range(probes):
        for i in range(count):
            mine = touched[a, i]
            for j in range(count):
                if out[a, i, j] >= EXPLAINED:
                    continue
                other = touched[a, j]
                before = out[a, i, j]
                value = 1.0
                if misses_tell and other & ~mine:
                    value = 0.0
                for k in range(depths.shape[1]):
                    if value == 0.0:
                        break
                    if not (mine >> k) & 1:
                        continue
                    point = points[a, k, i]
                    arm = 0.0
                    for b in range(3):
                        arm += (point[b] - centres[j, b]) ** 2
                    along = spreads[a, k, i] * slopes[a, k, i]
                    slack = reach + np.sqrt(
                        along * along + shift_spread[j] ** 2 + arm * turn_spread[j] ** 2
                    )
                    nearer = depths[a, k, i] - depths[a, k, j]
                    if misses_tell and (other >> k) & 1 and nearer * slopes[a, k, j] > 2.0 * slack:
                        # The ray would have met the second pose on its way.
                        value = 0.0
                        break
                    value *= _best_explanation(
                        point,
                        normals[a, k, i],
                        first_face[j],
                        last_face[j],
                        faces,
                        slack,
                        widths[i, j],
                        overlaps,
                        x,
                        u,
                        rotations[j],
                        positions[j],
                    )
                out[a, i, j] = max(before, np.float32(value))
