"""Compiled comparison of what poses predict: which of them a report would leave standing."""

from __future__ import annotations

import numpy as np

from ...recognizer.compiling import borrowing


@borrowing
def likelihoods_left(
    touched, depths, slopes, spreads, normals, same, reach, widths, misses_tell, overlaps, out
):
    """How likely each pose is to be left by a probe's report if another is true.

    Args:
        touched: (a, s) which rays of ``a`` triads each of ``s`` poses says touch, a bit each.
        depths: (a, 3, s) along the ray, metres.
        slopes: (a, 3, s) cosine between ray and normal, without its sign.
        spreads: (a, 3, s) standard deviation of the depth by the pose, metres.
        normals: (a, 3, s, 3) outward unit normals.
        same: (s, s) pairs that need not be told apart.
        reach: bound on positions felt, metres.
        widths: (s, s) chord of the angle between normals up to which one report may fit both.
        misses_tell: whether a ray that touches nothing is evidence.
        overlaps: (k + 2,) share of a cone's reports that another cone holds too, by the distance of
            the axes over ``k`` equal steps of the width; zeros at the end.
        out: (a, s, s) written in place; row the true pose. 1 for pairs in ``same``.
    """
    probes, count = touched.shape
    rays = depths.shape[1]
    steps = np.float32(len(overlaps) - 2)
    zero, one, two, three = np.float32(0.0), np.float32(1.0), np.float32(2.0), np.float32(3.0)
    quarter = np.float32(0.25)
    for a in range(probes):
        for i in range(count):
            mine = touched[a, i]
            for j in range(count):
                if same[i, j]:
                    out[a, i, j] = one
                    continue
                other = touched[a, j]
                missed = mine ^ other if misses_tell else mine & ~other
                if missed:
                    out[a, i, j] = zero
                    continue
                value = one
                for k in range(rays):
                    if not (mine >> k) & 1:
                        continue
                    si, sj, slope = spreads[a, k, i], spreads[a, k, j], slopes[a, k, j]
                    # Across the second pose's face: what it can't explain is the distance to it.
                    gap = abs(depths[a, k, i] - depths[a, k, j]) * slope
                    slack = reach + slope * np.sqrt(si * si + sj * sj)
                    if gap >= two * slack:
                        value = zero
                        break
                    chord = zero
                    for x in range(3):
                        difference = normals[a, k, i, x] - normals[a, k, j, x]
                        chord += difference * difference
                    if chord >= widths[i, j] * widths[i, j]:
                        value = zero
                        break
                    place = steps * np.sqrt(chord) / widths[i, j]
                    step = int(place)
                    share = place - np.float32(step)
                    u = one - gap / slack
                    value *= quarter * (two + three * u - u * u * u)
                    value *= (one - share) * overlaps[step] + share * overlaps[step + 1]
                out[a, i, j] = value


@borrowing
def report_distances(
    touched, depths, slopes, spreads, normals, same, reach, widths, misses_tell, out
):
    """How far the reports of two poses differ, in the largest difference that one report may fit.

    The arguments are those of `likelihoods_left`; ``out`` is infinite between touch and miss, and 0
    for pairs in ``same``.
    """
    probes, count = touched.shape
    rays = depths.shape[1]
    zero, two = np.float32(0.0), np.float32(2.0)
    for a in range(probes):
        for i in range(count):
            mine = touched[a, i]
            for j in range(count):
                if same[i, j]:
                    out[a, i, j] = zero
                    continue
                other = touched[a, j]
                missed = mine ^ other if misses_tell else mine & ~other
                if missed:
                    out[a, i, j] = np.inf
                    continue
                value = zero
                for k in range(rays):
                    if not (mine >> k) & 1:
                        continue
                    si, sj, slope = spreads[a, k, i], spreads[a, k, j], slopes[a, k, j]
                    gap = abs(depths[a, k, i] - depths[a, k, j]) * slope
                    value = max(value, gap / (two * (reach + slope * np.sqrt(si * si + sj * sj))))
                    chord = zero
                    for x in range(3):
                        difference = normals[a, k, i, x] - normals[a, k, j, x]
                        chord += difference * difference
                    value = max(value, np.sqrt(chord) / widths[i, j])
                out[a, i, j] = value
