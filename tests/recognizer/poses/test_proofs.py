"""The parts of the model test: what each of them claims holds.

Against plain numpy, on contacts whose truth is known: no proof rules the truth out.
"""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np
import pytest
from helpers.sensing import HOLED, L_BLOCK, SMALL, feel, touch_features
from numpy.typing import NDArray
from oracles import solids as oracles
from oracles.checker import Oracle, check
from oracles.proof_samples import (
    STAND_INS,
    Sample,
    direction,
    draw,
    hasty,
    motion_to,
    read_at,
    rotation_near,
    start_near,
)
from scipy.spatial.transform import RigidTransform, Rotation

from palpate.recognizer import Contacts
from palpate.recognizer.contacts.reading_kernels import meets_all, worst_on_pieces
from palpate.recognizer.models.features import all_features
from palpate.recognizer.poses.fits.feasibility_kernels import seek_feasible
from palpate.recognizer.poses.fits.pose import ModelTest, Poses
from palpate.recognizer.poses.fits.pose_kernels import settle
from palpate.recognizer.poses.fits.search_pose_kernels import box_stack, search_poses
from palpate.recognizer.poses.fits.verdict_kernels import (
    BESIDE,
    FEASIBLE,
    REJECTED,
    UNDECIDED,
    judge,
)
from palpate.recognizer.poses.proofs.proof_kernels import (
    disprove,
    locate,
    motion_allowance,
    plain_margin,
    reach_of,
    workspace,
)
from palpate.recognizer.poses.proofs.region_kernels import (
    ball_radius,
    invert_symmetric,
    largest_eigenvalue,
    remainder,
    square_root,
    turn_between,
)

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


def test_bounds_are_all_met_where_no_reading_is_above_its_own() -> None:
    rng, met, cases = np.random.default_rng(31), 0, 1500
    for _ in range(cases):
        sample = draw(rng)
        _, rotation, translation = start_near(sample, rng, rng.choice([1e-9, 0.01, 0.3]))
        translation = sample.true_translation + rng.normal(size=3) * rng.choice([0.0, 1e-3])
        work, worst = read_at(sample, rotation, translation)
        count, faces, targets, model, contacts = sample.question
        x, u, spare = work[3][0], work[3][1], np.empty(3)
        exact, _ = worst_on_pieces(count, faces, targets, x, model, contacts, work[0])
        within = meets_all(count, faces, x, u, model, contacts, 1e-9, spare)
        assert within == (max(worst, exact) <= 1.0 + 1e-9)
        met += within
    assert 0.2 * cases < met < 0.8 * cases


def test_the_small_matrix_routines_do_what_numpy_does() -> None:
    rng = np.random.default_rng(4)
    for case in range(1000):
        half = rng.normal(size=(6, 6)) * 10.0 ** rng.uniform(-2, 2, 6)
        matrix, inverse = half @ half.T, np.empty((6, 6))
        slope, root = rng.normal(size=6), np.empty(6)
        assert invert_symmetric(matrix, inverse, np.zeros((6, 6)), slope, root)
        condition = np.linalg.cond(matrix)
        expected = slope @ np.linalg.solve(matrix, slope)
        assert root @ root == pytest.approx(expected, rel=1e-6 + 1e-14 * condition)
        np.testing.assert_array_equal(inverse, inverse.T)
        scale = np.sqrt(np.diag(matrix))
        product = inverse * np.outer(scale, scale) @ (matrix / np.outer(scale, scale))
        allowed = 1e-14 * np.linalg.cond(matrix / np.outer(scale, scale))
        np.testing.assert_allclose(product, np.eye(6), atol=allowed)
        matrix[2, 2] = -1.0
        assert not invert_symmetric(matrix, inverse, np.zeros((6, 6)), slope, root)
        values = np.sort(rng.normal(size=3)) * 10.0 ** rng.integers(-9, 9)
        values[1] = values[case % 3] if case % 2 else values[1]  # two alike
        frame = Rotation.random(rng=rng).as_matrix()
        block = rng.normal(size=(6, 6))  # of a larger matrix the first block counts alone
        block[:3, :3] = frame @ np.diag(values) @ frame.T
        largest = largest_eigenvalue(block)
        assert 0.0 <= (largest - values.max()) / np.abs(values).max() < 1e-6
        rank = case % 4
        thin = rng.normal(size=(3, rank)) @ rng.normal(size=(rank, 3))
        root = np.full((3, 3), np.nan)
        square_root(thin @ thin.T, root)
        np.testing.assert_allclose(root @ root.T, thin @ thin.T, atol=1e-7 * (1 + (thin**2).sum()))
        np.testing.assert_array_equal(root, np.tril(root))


def test_the_turn_between_two_rotations_is_their_rotation_vector() -> None:
    rng, turn = np.random.default_rng(5), np.empty(3)
    for angle in (*rng.uniform(0.0, 3.1, 500), *10.0 ** rng.uniform(-12, -3, 100), 0.0, 3.1415):
        one, vector = Rotation.random(rng=rng), angle * direction(rng)
        other = one * Rotation.from_rotvec(vector)
        length = turn_between(one.as_matrix(), other.as_matrix(), turn)
        assert length == pytest.approx(angle, abs=1e-8)
        np.testing.assert_allclose(turn, vector, atol=1e-8 if angle < 3.1 else 1e-4)


def test_a_ball_of_rotations_fits_into_its_ball_of_rotation_vectors() -> None:
    rng = np.random.default_rng(6)
    closest = np.inf
    for _ in range(2000):
        off, angle = rng.uniform(0.0, 1.7, 2) * rng.choice([0.1, 1.0])
        longest = min(np.pi, off + angle)
        radius = ball_radius(angle, longest)
        centre = off * direction(rng)
        inside = rotation_near(Rotation.from_rotvec(centre), angle, rng).as_rotvec()
        middle = np.zeros(3) if longest >= 0.5 * np.pi else centre
        left = radius - np.linalg.norm(inside - middle)
        assert left > -1e-8
        closest = min(closest, left / radius)
    assert closest < 1e-3


def test_no_turn_of_a_region_bends_a_lever_by_more_than_the_remainder() -> None:
    rng = np.random.default_rng(7)
    tightest = np.inf
    for _ in range(1000):
        sizes = rng.uniform(0.0, rng.choice([0.01, 0.5, 2.0]), 3) * (rng.random(3) < 0.8)
        frame = Rotation.random(rng=rng).as_matrix()
        spread, root = frame @ np.diag(sizes**2) @ frame.T, np.empty((3, 3))
        square_root(spread, root)
        lever, way = rng.normal(size=3), direction(rng)
        bound = remainder(lever, way, root, sizes.max())
        v = np.concatenate([frame.T, rng.normal(size=(30, 3))])
        w = v / np.linalg.norm(v, axis=1, keepdims=True) @ (frame * sizes).T
        moved = Rotation.from_rotvec(-w).apply(lever) - lever + np.cross(w, lever)
        beyond = np.abs(moved @ way)
        assert beyond.max() <= bound * (1.0 + 1e-9) + 1e-9
        if bound > 1e-3:
            tightest = min(tightest, bound / max(beyond.max(), 1e-300))
    assert tightest < 1.5


# Regions and proofs


def assert_region_holds(
    sample: Sample, rotation: Floats, translation: Floats, work: Any, rng: np.random.Generator
) -> Floats:
    """The region in the work space, about a pose, holds the motion to the truth: returned."""
    spread, inverse, centre = work[1][:3]
    z = motion_to(sample, rotation, translation, work[5][2])
    # Any ways, and the one along which the truth is farthest out.
    p = np.vstack([rng.normal(size=(20, 6)), np.linalg.solve(inverse, z - centre)])
    within = np.einsum("ka,ab,kb->k", p, inverse, p)
    assert (((z - centre) @ p.T) ** 2 <= within * (1.0 + 1e-6)).all()
    p = np.vstack([p[:20, :3], np.linalg.pinv(spread) @ z[:3]])
    within = np.einsum("ka,ab,kb->k", p, spread, p)
    assert ((z[:3] @ p.T) ** 2 <= within * (1.0 + 1e-6) + 1e-15).all()
    return z


def off_truth(sample: Sample, rotation: Floats) -> float:
    """By how much a rotation is off the true one, radians."""
    return float(Rotation.from_matrix(rotation.T @ sample.true_rotation).magnitude())


def test_the_region_of_poses_holds_the_truth() -> None:
    rng, cut, sample = np.random.default_rng(8), 0, None
    for case in range(1500):
        if sample is None or case % 3 == 0:
            sample = draw(rng)
        if (sample.faces < 0).all():
            continue
        angle = rng.choice([0.03, 0.3, 1.0, np.pi, rng.uniform(0.0, np.pi)])
        off = rng.choice([0.0, 0.1, rng.uniform(0.0, np.pi)])
        ball, rotation, translation = start_near(sample, rng, angle, off)
        work, _ = read_at(sample, rotation, translation)
        bound, about = locate(*sample.question, rotation, ball, angle, work)
        assert bound >= 0.0, f"case {case}: the region is empty"
        z = assert_region_holds(sample, rotation, translation, work, rng)
        assert np.linalg.norm(z[:3]) <= bound + 1e-8
        *_, model, contacts = sample.question
        assert np.linalg.norm(z[3:]) <= reach_of(model, contacts, work[5][2])
        middle = rotation @ Rotation.from_rotvec(work[1][2][:3]).as_matrix()
        assert off_truth(sample, middle) <= about + 1e-8
        cut += bound < 0.8 * min(np.pi, off + angle)
    assert cut > 150  # contacts say more than the ball does


def test_the_ball_and_the_region_that_a_verdict_leaves_hold_the_truth() -> None:
    rng, seen, shrunk, sample = np.random.default_rng(23), Counter(), 0, None
    for case in range(3600):
        if sample is None or case % 3 == 0:
            sample = draw(rng)
        count, faces, _, model, contacts = sample.question
        given = rng.choice([0.03, 0.3, 1.0, np.pi])
        ball, rotation, translation = start_near(sample, rng, given, rng.choice([0.0, 0.1]))
        work = workspace(count)
        work[3][3][:] = rng.exponential(size=(count, 2))
        verdict, angle, worst, where = judge(
            *(count, faces, faces, contacts, model, ball, given),
            *(int(rng.integers(8)), bool(case % 2), rotation, translation, work),
        )
        assert verdict != REJECTED, f"case {case}"
        assert off_truth(sample, ball) <= angle + 1e-8
        seen[verdict] += 1
        shrunk += angle < 0.9 * given
        if verdict == UNDECIDED:
            assert worst > 1.0
            if (faces >= 0).any():
                # A search goes on from here: the region has to be about this very pose.
                assert_region_holds(sample, rotation, translation, work, rng)
            continue
        pose = RigidTransform.from_components(translation, Rotation.from_matrix(rotation))
        found = check(sample.model, pose, sample.contacts, faces, features=sample.features)
        shares = found.distances / sample.contacts.position_error
        assert found.passed == (verdict == FEASIBLE)
        assert worst == pytest.approx(shares.max(), rel=1e-6, abs=1e-6)
        # A search goes on with the pieces of this contact's face.
        assert verdict != BESIDE or shares[where] == shares.max() > 1.0
    assert seen[UNDECIDED] > 100
    assert seen[FEASIBLE] > 200
    assert seen[BESIDE] > 0
    assert shrunk > 100


def verdict_of(
    name: str, sample: Sample, angle: float, rotation: Floats, translation: Floats, boxes: int = 30
) -> int:
    """What one of four kernels says; the pose is moved in place."""
    count, faces, _, model, contacts = sample.question
    ball, work = rotation.copy(), workspace(count)
    rest = rotation, translation, work
    if name == "judge":
        return judge(count, faces, faces, contacts, model, ball, angle, 6, False, *rest)[0]
    if name == "seek":
        return seek_feasible(count, faces, faces, contacts, model, 60, True, ball, angle, *rest)
    if name == "settle":
        ball = rotation.copy()
        stack = box_stack(count)
        return settle(count, faces, contacts, model, ball, angle, boxes, *rest, stack)[0]
    # The search wants a region about its pose, where that isn't vague.
    work, _ = read_at(sample, rotation, translation)
    locate(*sample.question, rotation, ball, angle, work)
    rest = rotation, translation, work
    return search_poses(count, faces, contacts, model, angle, boxes, *rest, box_stack(count))[0]


def test_no_verdict_rejects_the_truth() -> None:
    rng, seen, cases = np.random.default_rng(9), Counter(), 400
    for case in range(cases):
        sample = draw(rng)
        angle = rng.choice([0.03, 0.3, 1.0, 1.6, np.pi])
        _, rotation, translation = start_near(sample, rng, angle)
        for name in ("judge", "seek", "settle", "search"):
            pose = rotation.copy(), translation.copy()
            verdict = verdict_of(name, sample, angle, *pose)
            assert verdict != REJECTED, f"case {case}: rejected by {name}"
            seen[name, verdict == FEASIBLE] += 1
            # The interior-point method knows hulls of concave faces alone.
            if verdict == FEASIBLE and (name != "seek" or sample.on_convex_features):
                assert case % 4 or sample.passes(*pose)
    assert seen["settle", False] < 0.05 * cases
    assert seen["search", False] < 0.2 * cases
    assert seen["judge", True] > 0.3 * cases
    assert seen["seek", True] > 0.3 * cases


def test_the_model_test_keeps_the_truth_wherever_it_was_touched() -> None:
    rng, proven, cases = np.random.default_rng(22), 0, 500
    for case in range(cases):
        sample = draw(rng)
        poses = sample.test.run(sample.touches.faces[None], sample.contacts)
        assert len(poses) == 1, f"case {case}"
        proven += poses.proven[0]
        assert (
            case % 5
            or not poses.proven[0]
            or sample.passes(poses.rotations[0], poses.translations[0])
        )
    assert proven > 0.95 * cases


def test_no_weights_disprove_the_truth() -> None:
    rng, sample = np.random.default_rng(17), None
    for case in range(1500):
        if sample is None or case % 3 == 0:
            sample = draw(rng)
        ball, rotation, translation = start_near(sample, rng, rng.choice([0.03, 0.3, 1.0]), 0.3)
        angle = off_truth(sample, ball) + 1e-9
        work, _ = read_at(sample, rotation, translation)
        work[3][3][:] = rng.exponential(size=work[3][3].shape) ** rng.choice([0.0, 1.0, 3.0])
        proved, bound = disprove(*sample.question, rotation, ball, angle, True, work)
        assert not proved, f"case {case}"
        assert off_truth(sample, rotation) <= bound + 1e-8


def test_no_multipliers_ask_for_more_than_bounds_and_motions_allow() -> None:
    # A proof asks for more than that; so none may, where a pose within the bounds exists.
    rng, sample, tightest, positive = np.random.default_rng(24), None, 0.0, 0
    for case in range(1500):
        if sample is None or case % 3 == 0:
            sample = draw(rng, 1, 8)
        ball, rotation, translation = start_near(sample, rng, rng.choice([0.03, 0.3, 1.0]), 0.3)
        angle = off_truth(sample, ball) + 1e-9
        work, _ = read_at(sample, rotation, translation)
        bound, _ = locate(*sample.question, rotation, ball, angle, work)
        count, faces, _, model, contacts = sample.question
        readings, region, forms, (x, u, levers, _), *_, proof, _ = work
        pulls, twists, slope, form = proof
        # What pulls a contact may be anything. At the truth its own gap asks for most. A normal is
        # twisted along its own miss.
        truly = read_at(sample, sample.true_rotation, sample.true_translation)[0][0]
        ways = (readings[0], truly[0], rng.normal(size=pulls.shape))[case % 3]
        sizes = rng.exponential(size=(2, count, 1)) ** rng.choice([0.0, 3.0])
        pulls[:] = sizes[0] * ways
        twists[:] = sizes[1] * readings[6] * rng.choice([0.0, 1e-3, 0.1])
        margin, _ = plain_margin(
            count, faces, faces, x, u, levers, model, contacts, readings, proof
        )
        off = np.linalg.norm(region[4][2])
        radius = ball_radius(angle, min(np.pi, off + angle))
        reach = reach_of(model, contacts, work[5][2])
        allowance = motion_allowance(slope, form, bound, radius, reach, region, *forms)
        scale = sizes.max() * model[6]
        assert margin <= allowance + 1e-9 * scale, f"case {case}"
        if margin > 1e-3 * scale:
            positive += 1
            tightest = max(tightest, margin / allowance)
    assert positive > 200
    assert tightest > 0.9


def test_a_search_of_nearly_all_rotations_holds_those_at_its_edge() -> None:
    rng = np.random.default_rng(18)
    tests = [ModelTest(model) for model in (L_BLOCK, HOLED, STAND_INS["stapler"])]
    for case in range(500):
        model = (L_BLOCK, HOLED, STAND_INS["stapler"])[which := rng.integers(3)]
        test = tests[which]
        touches = touch_features(model, test.features, rng, int(rng.integers(7, 10)))
        contacts = feel(touches, rng, 3e-4, rng.choice([1.2, 1.5, 2.0]), at_bounds=True)
        sample = Sample(test, model, touches, contacts)
        angle = rng.uniform(1.5, 2.6)
        axis = rng.permutation([1.0, 0.0, 0.0]) * (1.0 - 1e-9) * angle
        rotation = (sample.truth.rotation * Rotation.from_rotvec(axis)).as_matrix().copy()
        translation = sample.truth.translation + 0.01 * rng.normal(size=3)
        verdict = verdict_of("settle", sample, angle, rotation, translation, 1000)
        assert verdict != REJECTED, f"case {case}"


def test_contacts_good_to_a_millionth_of_the_object_lose_no_truth() -> None:
    rng = np.random.default_rng(19)
    model = STAND_INS["stapler"]
    test = ModelTest(model)
    for case in range(800):
        touches = touch_features(model, test.features, rng, int(rng.integers(2, 6)))
        contacts = feel(touches, rng, rng.choice([1e-7, 1e-6]), 1e-3)
        assert len(test.run(touches.faces[None], contacts)) == 1, f"case {case}"


def near_misses(sample: Sample, rng: np.random.Generator) -> tuple[Contacts, Poses, Ints]:
    """Interpretations near the line between possible and not.

    Returns:
        Contacts; the interpretations that a pose is known for, with it; those that are rejected.
    """
    # Pulled apart or together a little, so that even the truth may have become impossible.
    contacts, middle = sample.contacts, sample.contacts.positions.mean(axis=0)
    stretched = Contacts(
        middle + rng.uniform(0.85, 1.2) * (contacts.positions - middle),
        contacts.normals,
        position_error=contacts.position_error,
        normal_error=contacts.normal_error,
    )
    rows = np.repeat(sample.touches.faces[None], 60, axis=0)
    for row in rows[1:]:
        changed = rng.choice(len(row), 2, replace=False)
        row[changed] = rng.integers(len(sample.features), size=2)
    poses = sample.test.run(rows, stretched)
    kept = oracles.as_set(poses.faces)
    rejected = np.array([row for row in rows if tuple(row.tolist()) not in kept])
    return stretched, poses.take(poses.proven), rejected


@pytest.mark.parametrize("name", ["L-block", "holed"])
def test_no_pose_is_found_for_what_is_rejected_on_edges_and_vertices_too(name: str) -> None:
    model, rng = SMALL[name], np.random.default_rng(10)
    features = all_features(model)
    test, found = hasty(model, features), Counter()
    for _ in range(3):
        touches = touch_features(model, features, rng, int(rng.integers(3, 6)))
        sample = Sample(test, model, touches, feel(touches, rng, 0.0025, 0.35))
        contacts, poses, rejected = near_misses(sample, rng)
        for row in rejected[:1]:
            met = Oracle(model, contacts, row, features).finds_a_pose(rng)
            assert not met, f"{row} was rejected, and a pose meets its bounds"
        for row in poses.faces[:1]:
            found[Oracle(model, contacts, row, features).finds_a_pose(rng)] += 1
    assert found[True] > 4 * found[False]  # the oracle is no straw man


def test_a_pose_that_is_found_meets_every_bound() -> None:
    rng, seen = np.random.default_rng(11), 0
    for _ in range(25):
        sample = draw(rng, 3, 8)
        contacts, poses, _ = near_misses(sample, rng)
        for row in range(min(4, len(poses))):
            pose = RigidTransform.from_components(
                poses.translations[row], Rotation.from_matrix(poses.rotations[row])
            )
            faces, known = poses.faces[row], sample.features
            assert check(sample.model, pose, contacts, faces, features=known).passed
            seen += 1
    assert seen > 12
