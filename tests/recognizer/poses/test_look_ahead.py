"""What assigned contacts leave to the later ones: by pairs, by the region of poses, by verdicts.

Against plain numpy, the full model test and a fit of poses, on contacts whose truth is known.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import pytest
from helpers.constraints import NAMES, only
from helpers.sensing import CUBE, HOLED, L_BLOCK, Touches, feel, forget_normals, touch_features
from numpy.typing import NDArray
from oracles import solids as oracles
from oracles.checker import Oracle
from oracles.proof_samples import direction
from scipy.spatial.transform import Rotation

from palpate.recognizer import Contacts, PairTables
from palpate.recognizer.contacts.reading_kernels import RAY
from palpate.recognizer.models.features import all_features
from palpate.recognizer.poses.fits.pose import ModelTest, kernel_contacts
from palpate.recognizer.poses.fits.pose_kernels import start_pose
from palpate.recognizer.poses.fits.verdict_kernels import REJECTED, judge
from palpate.recognizer.poses.motions.align_kernels import middle_translation
from palpate.recognizer.poses.proofs.cone_kernels import (
    add_cones,
    cone_table,
    note_cones,
    raise_cones,
)
from palpate.recognizer.poses.proofs.place_kernels import add_places, raise_places, widen_places
from palpate.recognizer.poses.proofs.proof_kernels import locate, workspace
from palpate.recognizer.poses.proofs.region_kernels import remainder
from palpate.recognizer.poses.search.branch_kernels import INNER_STEPS
from palpate.recognizer.poses.search.look_ahead_kernels import drop_beyond_region, drop_rejected
from palpate.recognizer.poses.search.search_kernels import VAGUE
from palpate.recognizer.tables.ranges import pack_tables
from palpate.recognizer.tree.forward_kernels import check_forward, take_lowest
from palpate.recognizer.tree.mask_kernels import pair_readings

Bools = NDArray[np.bool_]
Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

FLAT = [CUBE, L_BLOCK, HOLED, oracles.model("stapler"), oracles.model("hull-90")]
MODELS = FLAT + FLAT[:4]
TESTS = [ModelTest(m) for m in FLAT] + [ModelTest(m, all_features(m)) for m in FLAT[:4]]
"""Convex and concave, with a hole and without; faces alone and all features, up to three words."""


@cache
def prepared(which: int) -> tuple[Touches, PairTables, Floats]:
    """Places all over a model, much faster to draw from than new ones, and its tables."""
    (model, features), rng = (MODELS[which], TESTS[which].features), np.random.default_rng(which)
    table = PairTables.of(model, features)
    return touch_features(model, features, rng, 200), table, pack_tables(table)


@dataclass(frozen=True, eq=False)
class BranchSample:
    """Contacts whose truth is known, and a branch and a cell of rotations that hold it."""

    which: int
    truth: Ints
    contacts: Contacts
    depth: int
    faces: Ints
    """(n,) what the first contacts are assigned to, -1 for none, and behind them anything."""
    cell: tuple[Floats, float] = (np.eye(3), -1.0)
    """A rotation, object to world, and an angle, radians; below zero for none."""

    @property
    def true(self) -> Bools:
        """(n, f) the true feature of each contact alone."""
        return np.arange(len(TESTS[self.which].features)) == self.truth[:, None]


def draw_branch(rng: np.random.Generator, which: int, in_cell: bool) -> BranchSample:
    """Contacts inside their bounds or on them, the first ones good to more or less than others."""
    touches = prepared(which)[0][rng.integers(200, size=rng.integers(3, 11))]
    count, noise = len(touches), int(rng.integers(3))
    truth, depth, felt = touches.faces.astype(np.int64), int(rng.integers(1, count)), []
    for part in np.split(np.arange(count), [depth]):
        bounds = rng.choice([3e-5, 3e-5, 3e-4, 3e-3]), rng.choice([0.02, 0.1, 0.4, 1.0])
        felt.append(feel(touches[part], rng, *bounds, at_bounds=noise > 0, alike=noise > 1))
    contacts = forget_normals(Contacts.join(felt), rng.random(count) < rng.choice([0.0, 0.0, 0.4]))
    faces = np.where(rng.random(count) < rng.choice([0.0, 0.2]), -1, truth)
    faces[0], faces[depth:] = truth[0], rng.integers(-1, truth.max() + 1, count - depth)
    axis, angle = rng.normal(size=3), rng.choice([0.001, 0.04, 0.4, 1.0])
    off = Rotation.from_rotvec((1.0 - 1e-9) * angle / np.linalg.norm(axis) * axis)
    cell = (touches.T_world_object.rotation * off).as_matrix(), angle if in_cell else -1.0
    return BranchSample(which, truth, contacts, depth, faces, cell)


def as_bits(members: Bools) -> NDArray[np.uint64]:
    """(n, w) the words of sets (n, f)."""
    padded = np.pad(members, ((0, 0), (0, -members.shape[1] % 64)))
    return np.packbits(padded, axis=1, bitorder="little").view(np.uint64)


def members_of(domains: NDArray[np.uint64], features: int) -> Bools:
    """(n, f) the sets of words (n, w)."""
    return np.unpackbits(domains.view(np.uint8), axis=1, bitorder="little")[:, :features] > 0


# Sets and pairs


def test_the_lowest_features_of_a_set_come_out_in_ascending_order() -> None:
    rng = np.random.default_rng(2)
    for features, share in ((1, 0.5), (64, 1.0), (65, 0.5), (128, 1.0), (200, 0.05), (200, 0.5)):
        members = rng.random((1, features)) < share
        left = as_bits(members)[0]
        for feature in np.flatnonzero(members):
            assert take_lowest(left) == feature
            members[0, feature] = False
            np.testing.assert_array_equal(left, as_bits(members)[0])
        assert take_lowest(left) == -1


def faces_that_fit(sample: BranchSample, names: list[str], i: int, j: int, a: int) -> Bools:
    """(f,) which faces contact j can be on if contact i is on ``a``."""
    table, contacts, (rotation, angle) = prepared(sample.which)[1], sample.contacts, sample.cell
    margins = [oracles.pair_margins(table, contacts, i, j, tuple(names))[a]]
    if angle >= 0.0:
        between = contacts.positions[j] - contacts.positions[i]
        slack = 2.0 * np.linalg.norm(between) * np.sin(0.5 * angle)
        slack += contacts.position_error[i] + contacts.position_error[j]
        along = table.normals @ rotation.T @ between
        least, most = table.component_min, table.component_max
        margins += [along[a] + slack - least[a], most[a] - along[a] + slack]
        margins += [slack - along - least[:, a], most[:, a] + along + slack]
    assert np.abs(margins).min() > 1e-13, "rounding decides"
    return np.min(margins, axis=0) >= 0.0


def what_is_read(sample: BranchSample, names: list[str]) -> tuple[Any, Any]:
    """What `check_forward` reads of contacts and model."""
    count, test, contacts = len(sample.truth), TESTS[sample.which], sample.contacts
    readings, errors = np.empty((count, count, 9)), contacts.normal_error
    pair_readings(kernel_contacts(contacts), errors, readings)
    bits = only(names).bits
    between = (contacts.positions - contacts.positions[:, None]) @ sample.cell[0]
    packed, half = prepared(sample.which)[2], test.features.half_angles
    return (packed, half, errors, bits, test.model[0], readings), (between, sample.cell[1])


def test_checking_forward_does_what_a_plain_loop_over_pairs_does() -> None:
    rng, seen = np.random.default_rng(3), Counter()
    for case in range(600):
        in_cell, names = bool(rng.random() < 0.5), [n for n in NAMES if rng.random() < 0.7]
        sample = draw_branch(rng, case % len(FLAT), in_cell)
        count, features = sample.true.shape
        i, room = int(rng.integers(count - 1)), int(rng.integers(3))
        first = int(rng.integers(i + 1, count + 1))
        face = int(rng.choice([sample.truth[i], rng.integers(features), -1], p=[0.6, 0.3, 0.1]))
        members = rng.random((count, features)) < rng.choice([0.03, 0.2, 1.0], (count, 1))
        domains, sizes = as_bits(members), members.sum(axis=1)
        # In place, or into other arrays, of which the rest stays as it was.
        expected = members.copy() if case % 2 else rng.random(members.shape) < 0.5
        kept, kept_sizes = (domains, sizes) if case % 2 else (as_bits(expected), sizes - 7)
        expected_sizes, empty, ways = kept_sizes.copy(), 0, 1.0
        for j in range(first, count):
            fits = faces_that_fit(sample, names, i, j, face) if face >= 0 else True
            expected[j] = members[j] & fits
            expected_sizes[j] = expected[j].sum()
            ways *= max(1, expected_sizes[j])
            empty += expected_sizes[j] == 0
            if empty > room:
                seen["stopped"] += j < count - 1
                break
        known = *what_is_read(sample, names), domains, sizes, kept, kept_sizes
        assert check_forward(i, face, first, room, *known) == (empty, ways), f"case {case}"
        np.testing.assert_array_equal(members_of(kept, features), expected)
        np.testing.assert_array_equal(kept_sizes, expected_sizes)
        seen["some empty"] += 0 < empty <= room
        seen["none", in_cell] += face < 0
        seen["narrowed", in_cell] += 0 < expected[first:].sum() < members[first:].sum()
    assert min(seen.values()) > 20


# Regions and verdicts


def look(sample: BranchSample, kernel: str, members: Bools, certain: bool = False) -> Bools:
    """The sets that a kernel leaves of these, from a pose as the search comes to it.

    By the cell's rotation or by the normals; where it is vague, the search doesn't look ahead.
    """
    test, faces, (rotation, angle) = TESTS[sample.which], sample.faces, sample.cell
    contacts, branch = kernel_contacts(sample.contacts), (sample.depth, faces, faces)
    pose, work = (rotation.copy(), np.empty(3)), workspace(len(faces))
    if angle >= 0.0:
        middle_translation(*branch[:2], contacts[0], test.middles, *pose)
    else:
        half = test.features.half_angles
        angle = start_pose(*branch[:2], contacts, test.model, half, test.middles, *pose)
    if angle > VAGUE:
        return members
    ball, rest = pose[0].copy(), (INNER_STEPS, False, *pose, work)
    verdict, angle, *_ = judge(*branch, contacts, test.model, ball, angle, *rest)
    assert verdict != REJECTED
    angle, _ = locate(*branch, test.model, contacts, pose[0], ball, angle, work)
    assert angle >= 0.0
    domains, sizes = as_bits(members), members.sum(axis=1)
    known = contacts, test.model, *pose, angle, domains, sizes, work
    blank = [np.full(size, np.nan) for size in (6, 3, (3, 3), (3, 3))]
    if kernel == "region":
        drop_beyond_region(sample.depth, *known, tuple(blank[:3]))
    elif kernel == "verdicts":
        tried = sizes[sample.depth :][sizes[sample.depth :] > 1].sum()
        held = np.empty(len(faces), np.int64), *blank[:0:-1]
        assert drop_rejected(*branch[:2], certain, *known, held) == tried
    for i in range(sample.depth if kernel == "pairs" else 0):
        read, sets = what_is_read(sample, list(NAMES)), (domains, sizes)
        check_forward(i, faces[i], sample.depth, len(faces), *read, *sets, *sets)
    left = members_of(domains, members.shape[1])
    np.testing.assert_array_equal(sizes, left.sum(axis=1))
    np.testing.assert_array_equal(left[: sample.depth], members[: sample.depth])
    return left


@pytest.mark.parametrize("in_cell", [False, True])
@pytest.mark.parametrize("kernel", ["pairs", "region", "verdicts"])
def test_looking_ahead_drops_impossible_features_alone(kernel: str, in_cell: bool) -> None:
    rng, seen = np.random.default_rng(5), Counter()
    for case in range(1500 if in_cell else 600):
        sample, certain = draw_branch(rng, case % len(TESTS), in_cell), bool(rng.random() < 0.6)
        members = sample.true | (rng.random(sample.true.shape) < rng.choice([0.0, 0.1, 0.5]))
        left, depth, felt = look(sample, kernel, members, certain), sample.depth, sample.contacts
        assert left[sample.true].all(), f"case {case}: a true feature was dropped"
        seen["dropped"] += (members & ~left).sum()
        rows = np.zeros((0, len(left)), np.int32)
        for j, f in np.argwhere(members & ~left) if not in_cell else ():
            # All that was assigned or, that being certain, as good as assigned; and one more.
            then = np.where(np.arange(len(left))[:, None] < j, left, members)
            single = certain and kernel == "verdicts" and then.sum(axis=1) == 1
            row = np.where(single, then.argmax(axis=1), -1)
            row[:depth], row[j] = sample.faces[:depth], f
            rows = np.vstack([rows, row.astype(np.int32)])
        poses, features = TESTS[sample.which].run(rows, felt), TESTS[sample.which].features
        assert not poses.proven.any(), f"case {case}: {poses.faces} are possible"
        seen["open"] += len(poses)
        for row in rows[: case % 10 == 0]:
            oracle = Oracle(MODELS[sample.which], felt[row >= 0], row[row >= 0], features)
            assert not oracle.finds_a_pose(np.random.default_rng(case), 12, 30), f"{row}"
    # Vague normals far off the end of an edge's cone can be beyond the model test's proofs.
    assert seen["open"] < 0.002 * seen["dropped"]
    assert seen["dropped"] > (10_000 if in_cell else 700)


@pytest.mark.parametrize("choices", [1, 2])
def test_a_contact_that_may_be_on_none_takes_no_truth_away(choices: int) -> None:
    ways = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, 0, 1]])
    right, left, back, top = (CUBE.normals @ ways.T).argmax(axis=0)
    truth = np.array([top, top, top, back, back, right, left])
    points = [[1, 1, 4], [3, 1, 4], [2, 3, 4], [1, 4, 1], [3, 4, 3], [4.5, 2, 2], [0, 2, 2]]
    # The last but one is off its face: it goes with those before, as the last does, not with both.
    bounds = {"position_error": 1e-4, "normal_error": 0.02}
    contacts = Contacts(np.array(points) / 100.0, CUBE.normals[truth], **bounds)
    members = np.ones((7, 6), np.bool_)
    members[5] = np.isin(range(6), [right, top][:choices])
    for certain, expected in ((False, [left]), (True, [])):
        found = look(BranchSample(0, truth, contacts, 5, truth), "verdicts", members, certain)
        assert np.flatnonzero(found[5]).tolist() == [right]
        assert np.flatnonzero(found[6]).tolist() == expected


# Places


def test_places_are_widened_by_the_remainder_of_a_region() -> None:
    rng = np.random.default_rng(7)
    for _ in range(100):
        table, root = place_table(rng), np.tril(rng.normal(size=(3, 3)))
        _, columns, numbers = table
        angle, expected = rng.uniform(0.0, np.pi), numbers.copy()
        for r in range(5):
            way, lever = columns[3:6, r].copy(), columns[6:9, r].copy()
            expected[3, r] = numbers[1, r] + remainder(lever, way, root, angle)
        widen_places(5, table, root, angle)
        np.testing.assert_allclose(numbers, expected, rtol=1e-12)


def test_places_add_the_squares_of_what_motions_leave_of_them() -> None:
    rng = np.random.default_rng(8)
    for _ in range(100):
        rows, _, numbers = table = place_table(rng)
        system, slope = rng.normal(size=(6, 6)), rng.normal(size=6)
        added, steeper = system.copy(), slope.copy()
        allowed = add_places(5, table, added, steeper)
        share, weight = numbers[0, :5] / numbers[3, :5], numbers[2, :5]
        scaled = rows[:5, :6] / numbers[3, :5, None]
        np.testing.assert_allclose(added - system, (scaled.T * weight) @ scaled, atol=1e-12)
        np.testing.assert_allclose(steeper - slope, -(weight * share) @ scaled, atol=1e-12)
        assert allowed == pytest.approx((weight * (1.0 - share**2)).sum())


def test_cones_add_no_more_than_what_turns_leave_of_their_misses() -> None:
    rng, tightest = np.random.default_rng(9), np.inf
    for _ in range(300):
        count, angle = int(rng.integers(1, 9)), rng.choice([0.01, 0.3, 1.0, 3.0])
        u, normals = rng.normal(size=(2, count, 3))
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        u = normals + rng.choice([0.01, 0.3, 1.0]) * u
        u /= np.linalg.norm(u, axis=1, keepdims=True)
        chords, misses = rng.uniform(0.05, 1.0, count), np.linalg.norm(u - normals, axis=1)
        contacts = (normals, u, chords, chords, chords)
        kinds = np.full(count, RAY)
        readings = (normals, chords, chords, kinds, kinds, misses, normals)
        table, faces = cone_table(count), np.arange(count)
        assert note_cones(count, faces, u, normals, contacts, readings, table) == count
        table[2][:] = weights = rng.uniform(0.1, 2.0, count)
        system, slope = np.zeros((6, 6)), np.zeros(6)
        room = add_cones(count, table, angle, system, slope)
        room -= (weights * (1.0 - (misses / chords) ** 2)).sum()
        form = (system + np.tril(system, -1).T)[:3, :3]
        for _ in range(10):
            turn = direction(rng) * angle * rng.choice([1.0, rng.random()])
            turned = Rotation.from_rotvec(-turn).apply(u) - normals
            grown = (weights * ((turned**2).sum(axis=1) - misses**2) / chords**2).sum()
            said = turn @ form @ turn + 2.0 * slope[:3] @ turn - room
            assert said <= grown + 1e-9 * abs(grown) + 1e-9
            tightest = min(tightest, (grown - said) / (abs(grown) + 1e-9))
    assert tightest < 0.01


def test_readings_count_by_how_large_a_motion_leaves_them() -> None:
    rng = np.random.default_rng(10)
    for _ in range(50):
        rows, _, numbers = table = place_table(rng)
        motion, before = rng.normal(size=6), numbers[2].copy()
        raise_places(7, table, motion)
        left = np.abs(numbers[0] - rows @ motion) / numbers[3]
        np.testing.assert_allclose(numbers[2], before * (np.minimum(left, 10.0) + 0.05))
        terms, columns, weights, _ = cone_table(7)
        columns[:], weights[:] = rng.normal(size=(6, 7)), before
        raise_cones(7, (terms, columns, weights, terms[0]), motion)
        moved = columns[:3].T + np.cross(columns[3:].T, motion[:3])
        left = np.linalg.norm(moved, axis=1)
        np.testing.assert_allclose(weights, before * (np.minimum(left, 10.0) + 0.05))


def place_table(rng: np.random.Generator) -> tuple[Floats, Floats, Floats]:
    """A table of seven places as its kernel has it, with levers and directions at random."""
    levers, ways = rng.normal(size=(2, 7, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    columns = np.column_stack([np.cross(levers, ways), ways, levers, (levers * ways).sum(axis=1)]).T
    return columns[:6].T.copy(), columns.copy(), rng.uniform(0.1, 1.0, (6, 7))
