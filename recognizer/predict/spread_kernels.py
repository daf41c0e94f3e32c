"""Compiled samples of the poses that an interpretation allows: few, and far apart.

Each starts with a jump from a known pose along the open motions, as long as the family is wide; the
search for a witness brings it back inside all bounds (see `witness_kernels`), and if it can't, the
sample before is gone on from. That may be the rim, so hit-and-run steps follow (Smith 1984): along
a random line, to a point drawn from what of it is inside the bounds, found by drawing and shrinking
(Neal 2003, slice sampling, Section 4.1). Lines are drawn by the local information of the contacts,
so that they lie along what these leave open.
"""

from __future__ import annotations

import numpy as np

from ..compiling import borrowing, kernel
from ..contacts.reading_kernels import UNKNOWN_NORMAL, carry, meets_all
from ..poses.motions.motion_kernels import add_row, copy_pose, move, slope_row
from ..poses.witness_kernels import EXACT, WITNESS, seek_witness

LINES = 8
"""Hit-and-run steps after a jump."""
DRAWS = 10
"""The most points drawn on a line."""
WIDTH = 6.0
"""The part of a line that is looked at, in standard deviations: more than what bounds leave."""


@borrowing
def _allowed(count, faces, contacts, model, rotation, translation, work):
    """Whether a pose meets all bounds."""
    x, u, spare = work[1], work[2], work[10]
    carry(count, contacts[0], contacts[1], rotation, translation, x, u)
    return meets_all(count, faces, x, u, model, contacts, EXACT, spare)


@borrowing
def _draw_line(count, faces, contacts, model, rotation, translation, normal, line, space, work):
    """A motion drawn from the local normal law of the pose: ``L^-T normal``, into (6,) ``line``."""
    points, measured, reaches, chords, _ = contacts
    normals, centre, radius = model[0], model[5], model[6]
    x, u = work[1], work[2]
    system, factor, row, gradient, arm, turn = space
    carry(count, points, measured, rotation, translation, x, u)
    system[:] = 0.0
    for a in range(6):
        # Half a turn and half a diameter are known beforehand.
        system[a, a] = 1.0 / (radius * radius * (np.pi * np.pi if a < 3 else 1.0))
    for i in range(count):
        f = faces[i]
        if f < 0:
            continue
        m = normals[f]
        for k in range(3):
            arm[k] = x[i, k] - centre[k]
        slope_row(m, arm, radius, turn, row)
        add_row(row, 0.0, 3.0 / (reaches[i] * reaches[i]), system, gradient)
        if chords[i] < UNKNOWN_NORMAL:
            weight = 4.0 / (chords[i] * chords[i] * radius * radius)
            for a in range(3):
                system[a, a] += weight
                for b in range(a + 1):
                    system[a, b] -= weight * m[a] * m[b]
    for a in range(6):
        for b in range(a + 1):
            value = system[a, b]
            for k in range(b):
                value -= factor[a, k] * factor[b, k]
            factor[a, b] = np.sqrt(max(value, 1e-300)) if a == b else value / factor[b, b]
    for a in range(5, -1, -1):
        value = normal[a]
        for k in range(a + 1, 6):
            value -= factor[k, a] * line[k]
        line[a] = value / factor[a, a]


@borrowing
def _walk(count, faces, contacts, model, draws, rotation, translation, poses, space, work):
    """Hit-and-run steps from a pose inside the bounds, in place.

    Args:
        count: how many contacts there are.
        faces: (n,) the feature of each contact, -1 for none.
        contacts: see `pose.kernel_contacts`.
        model: likewise.
        draws: (LINES, 7 + DRAWS) six normal numbers a line, then uniform ones.
        rotation: (3, 3) of the pose.
        translation: (3,) likewise.
        poses: (3, 3) and (3,) work space.
        space: of `_draw_line`, and the line (6,) and a part of it (6,).
        work: see `work_space.seeking_space`.
    """
    centre, radius = model[5], model[6]
    turned, shifted = poses
    line, part = space[6], space[7]
    for step in range(len(draws)):
        _draw_line(
            *(count, faces, contacts, model, rotation, translation, draws[step], line, space[:6]),
            work,
        )
        low = -WIDTH * draws[step, 6]
        high = low + WIDTH
        for trial in range(DRAWS):
            at = low + (high - low) * draws[step, 7 + trial]
            for a in range(6):
                part[a] = at * line[a]
            move(rotation, translation, part, centre, radius, turned, shifted)
            if _allowed(count, faces, contacts, model, turned, shifted, work):
                copy_pose(turned, shifted, rotation, translation)
                break
            if at < 0.0:
                low = at
            else:
                high = at


@kernel
def spread_over_families(
    faces, contacts, model, starts, motions, counts, jumps, draws, rotations, translations, seeking
):
    """Poses that meet all bounds, spread over what each of some interpretations leaves open.

    Args:
        faces: (h, n) the features of the contacts, -1 for none, in each interpretation.
        contacts: see `pose.kernel_contacts`.
        model: likewise.
        starts: (h, 3, 3) and (h, 3) a pose of each, the first of its samples.
        motions: (h, 6, 6) unit small motions (see `motion_kernels`), zero where there are fewer.
        counts: (h,) how many samples each has.
        jumps: (k, 6) how far to go along them for each sample, metres; k is the sum of counts.
        draws: (k, LINES, 7 + DRAWS) random numbers, see `_walk`.
        rotations: (k, 3, 3) written in place.
        translations: (k, 3) likewise.
        seeking: that nothing else is known, and work space, see `witness_kernels.seek_witness`.
    """
    count = faces.shape[1]
    nothing, work = seeking
    along, turned, shifted = np.empty(6), np.empty((3, 3)), np.empty(3)
    poses = np.empty((3, 3)), np.empty(3)
    vectors = np.empty(6), np.empty(6), np.empty(3), np.empty(3), np.empty(6), np.empty(6)
    space = (np.empty((6, 6)), np.empty((6, 6)), *vectors)
    row = 0
    for h in range(len(faces)):
        rotation, translation = starts[0][h], starts[1][h]
        copy_pose(rotation, translation, rotations[row], translations[row])
        sound = _allowed(count, faces[h], contacts, model, rotation, translation, work)
        for _ in range(1, counts[h]):
            row += 1
            for a in range(6):
                along[a] = 0.0
                for k in range(6):
                    along[a] += jumps[row, k] * motions[h, k, a]
            move(rotation, translation, along, model[5], model[6], turned, shifted)
            found = seek_witness(
                *(faces[h], faces[h], contacts, model, nothing, False, turned, shifted, work)
            )
            if found != WITNESS:
                copy_pose(rotations[row - 1], translations[row - 1], turned, shifted)
            if sound:
                _walk(
                    *(count, faces[h], contacts, model, draws[row], turned, shifted, poses, space),
                    work,
                )
            copy_pose(turned, shifted, rotations[row], translations[row])
        row += 1
