"""The parts of the model test and of the search: what each of them claims holds.

Against plain numpy, on contacts whose truth is known: no proof rules the truth out.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from typing import Any, Literal

import numpy as np
import oracles
import pytest
from checker import Oracle, angle_between, check, cone_angles, cone_of, triangle_distances
from numpy.typing import NDArray
from proof_samples import (
    STAND_INS,
    TESTS,
    Sample,
    direction,
    draw,
    hasty,
    motion_to,
    read_at,
    start_near,
    turned,
)
from scipy.spatial.transform import RigidTransform, Rotation
from sensing import (
    CUBE,
    HOLED,
    INCH,
    L_BLOCK,
    SMALL,
    feel,
    forget_normals,
    sense_grid,
    touch_features,
)

from palpate.recognizer import (
    Belief,
    Contacts,
    PairTables,
    Polyhedron,
    Recognizer,
    SearchLimits,
)
from palpate.recognizer.feasibility_kernels import seek_feasible
from palpate.recognizer.features import Features, all_features, face_features
from palpate.recognizer.mask_kernels import narrow, pair_readings
from palpate.recognizer.polygon_kernels import CORNER, EDGE, INSIDE, nearest_in_polygon
from palpate.recognizer.pose import ModelTest, Poses, kernel_contacts
from palpate.recognizer.pose_kernels import settle
from palpate.recognizer.possible_kernels import possible
from palpate.recognizer.proof_kernels import (
    disprove,
    locate,
    motion_allowance,
    plain_margin,
    reach_of,
    workspace,
)
from palpate.recognizer.ranges import pack_tables
from palpate.recognizer.reading_kernels import (
    ARC,
    CONE_END,
    NO_CONE,
    RAY,
    cone_support,
    meets_all,
    nearest_in_cone,
    nearest_on_arc,
    nearest_on_feature,
    worst_on_pieces,
)
from palpate.recognizer.region_kernels import (
    ball_radius,
    invert_symmetric,
    largest_eigenvalue,
    remainder,
    square_root,
    turn_between,
)
from palpate.recognizer.search_pose_kernels import box_stack, search_poses
from palpate.recognizer.symmetry import feature_permutations
from palpate.recognizer.tree import Constraints, prune
from palpate.recognizer.verdict_kernels import BESIDE, FEASIBLE, REJECTED, UNDECIDED, judge

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]
ROWS = ((np.pi / 12, 0.01), (np.pi / 10, 0.01), (np.pi / 8, 0.05), (np.pi / 8, 0.1))
"""Bounds on normals (radians) and positions (inches)."""


# Readings


def cones(rng: np.random.Generator) -> Floats:
    """One normal, an arc of less than half a turn, or a convex spherical polygon, in order."""
    count = int(rng.integers(1, 7))
    middle = direction(rng)
    if count < 3:
        return Rotation.from_rotvec(rng.uniform(0.0, 1.5, (count, 1)) * [direction(rng)]).apply(
            direction(rng)
        )
    around = np.sort(rng.uniform(0.0, 2.0 * np.pi, count)) if count > 3 else np.arange(3) * 2.0
    lean = np.tan(rng.uniform(0.05, 1.3))
    flat = np.column_stack([np.cos(around), np.sin(around), np.full(count, 1.0 / lean)])
    frame = Rotation.align_vectors([middle], [[0.0, 0.0, 1.0]])[0]
    return frame.apply(flat / np.linalg.norm(flat, axis=1, keepdims=True))


def test_the_miss_of_a_cone_is_the_angle_to_the_nearest_of_its_normals() -> None:
    rng = np.random.default_rng(1)
    seen: Counter[int] = Counter()
    for case in range(800):
        cone = cones(rng)
        weights = rng.dirichlet(np.ones(len(cone)))
        u = weights @ cone + rng.normal(size=3) * rng.choice([0.0, 0.3, 10.0])
        u = cone[0] if case % 20 == 0 else u / np.linalg.norm(u)
        away = np.empty(3)
        padded = np.vstack([rng.normal(size=(2, 3)), cone, rng.normal(size=(1, 3))])
        kind, miss = nearest_in_cone(u, padded, 2, 2 + len(cone), away)
        angle = cone_angles(u, cone)
        seen[kind] += 1
        found = np.arcsin(miss) if kind == ARC else 2.0 * np.arcsin(min(1.0, 0.5 * miss))
        assert found == pytest.approx(angle, abs=1e-7)
        samples = rng.dirichlet(np.full(len(cone), 0.7), size=200) @ cone
        samples /= np.linalg.norm(samples, axis=1, keepdims=True)
        assert found <= angle_between(samples, u).min() + 1e-7
        assert cone_support(u, padded, 2, 2 + len(cone)) >= (samples @ u).max() - 1e-12
        assert cone_support(3.0 * u, padded, 2, 2 + len(cone)) == pytest.approx(3 * np.cos(angle))
        if angle > 1e-6:
            assert np.linalg.norm(away) == pytest.approx(1.0)
            # On the way out there is more of every reading the farther the vector is off.
            assert kind != NO_CONE
            assert (samples @ away).max() <= away @ u + 1e-7
    assert min(seen[kind] for kind in (NO_CONE, RAY, ARC, CONE_END)) > 40


def test_the_nearest_place_on_an_arc_is_that_of_a_dense_sampling() -> None:
    rng = np.random.default_rng(2)
    seen: Counter[int] = Counter()
    for _ in range(500):
        first, turn = direction(rng), Rotation.from_rotvec(rng.uniform(0.05, 3.0) * direction(rng))
        last, u = turn.apply(first), direction(rng)
        off, where, axis = nearest_on_arc(u, first, last)
        share = np.linspace(0.0, 1.0, 2001)[:, None]
        angle = angle_between(first, last)
        arc = (np.sin((1 - share) * angle) * first + np.sin(share * angle) * last) / np.sin(angle)
        dots = arc @ u
        assert np.abs(arc @ axis).max() < 1e-9
        assert off == pytest.approx(axis @ u)
        near = (np.sqrt(1.0 - off**2), first @ u, last @ u)[where]
        assert near == pytest.approx(dots.max(), abs=1e-5)
        seen[where] += 1
    assert min(seen.values()) > 50


def convex_polygon(rng: np.random.Generator) -> tuple[Floats, Floats]:
    count = int(rng.integers(3, 9))
    around = np.sort(rng.uniform(0.0, 2.0 * np.pi, count))
    flat = np.column_stack([rng.uniform(0.02, 2.0) * np.cos(around), np.sin(around), 0 * around])
    turn = Rotation.random(rng=rng)
    return turn.apply(flat) + rng.normal(size=3), turn.apply([0.0, 0.0, 1.0])


def test_the_nearest_point_of_a_polygon_is_that_of_its_triangles() -> None:
    rng = np.random.default_rng(18)
    seen = {INSIDE: 0, EDGE: 0, CORNER: 0}
    for case in range(2000):
        polygon, normal = convex_polygon(rng)
        weights = rng.dirichlet(np.ones(len(polygon)))
        point = weights @ polygon + rng.normal(size=3) * rng.choice([0.0, 0.1, 1.0])
        if case % 10 == 0:
            point = polygon[rng.integers(len(polygon))]  # a corner itself
        elif case % 10 == 1:
            point = polygon[:2].mean(axis=0) + rng.normal() * normal  # above an edge
        offset = float(normal @ polygon[0])
        padded = np.vstack([rng.normal(size=(2, 3)), polygon, rng.normal(size=(1, 3))])
        nearest = np.empty(3)
        squared, height, region = nearest_in_polygon(
            point, normal, offset, padded, 2, 2 + len(polygon), nearest
        )
        seen[region] += 1
        fan = np.array([polygon[[0, k, k + 1]] for k in range(1, len(polygon) - 1)])
        expected = triangle_distances(point[None], fan).min()
        assert np.sqrt(squared) == pytest.approx(expected, abs=1e-7)
        assert height == pytest.approx(normal @ point - offset, abs=1e-12)
        assert np.linalg.norm(point - nearest) == pytest.approx(expected, abs=1e-7)
        assert triangle_distances(nearest[None], fan).min() < 1e-7
    assert min(seen.values()) > 200


def test_the_nearest_point_of_an_edge_or_a_vertex_is_that_of_a_segment_or_a_point() -> None:
    rng, nearest, seen = np.random.default_rng(28), np.empty(3), Counter()
    for case in range(2000):
        ends = rng.normal(size=(1 + case % 2, 3))
        normal = np.cross(ends[-1] - ends[0], direction(rng)) if case % 2 else direction(rng)
        normal /= np.linalg.norm(normal)
        point = rng.dirichlet(np.ones(len(ends))) @ ends + rng.normal(size=3)
        squared, height, region = nearest_on_feature(
            point, normal, float(normal @ ends[0]), ends, 0, len(ends), nearest
        )
        seen[len(ends), region] += 1
        expected = triangle_distances(point, ends[None, [0, -1, -1]])[0]
        assert np.sqrt(squared) == pytest.approx(expected, abs=1e-9)
        assert np.linalg.norm(point - nearest) == pytest.approx(expected, abs=1e-9)
        assert height == pytest.approx(normal @ (point - ends[0]), abs=1e-12)
    assert seen.keys() == {(1, CORNER), (2, CORNER), (2, EDGE)}
    assert min(seen.values()) > 200


def test_an_edge_ends_where_it_ends_for_a_point_on_its_line_too() -> None:
    ends, nearest = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]), np.empty(3)
    for beyond in (-2.0, 3.0):
        point, normal = np.array([beyond, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])
        squared, _, _ = nearest_on_feature(point, normal, 0.0, ends, 0, 2, nearest)
        assert squared == pytest.approx(4.0)


def test_two_contacts_farther_apart_than_an_edge_is_long_are_not_both_on_it() -> None:
    features = all_features(CUBE)
    edge = features.face_count
    first, last = features.corners[features.start[edge] : features.start[edge + 1]]
    contacts = Contacts(
        [first, first + 1.5 * (last - first)],
        np.tile(features.normals[edge], (2, 1)),
        position_error=1e-4,
        normal_error=0.02,
    )
    poses = ModelTest(CUBE, features).run(np.full((1, 2), edge, np.int32), contacts)
    assert len(poses) == 0


def test_a_pose_reads_as_the_checker_reads_it() -> None:
    rng = np.random.default_rng(3)
    for _ in range(200):
        sample = draw(rng)
        _, rotation, translation = start_near(sample, rng, rng.choice([0.1, 1.0]))
        work, worst = read_at(sample, rotation, translation)
        count, faces, _, model, contacts = sample.question
        farthest, _ = worst_on_pieces(count, faces, faces, work[3][0], model, contacts, work[0])
        pose = RigidTransform.from_components(translation, Rotation.from_matrix(rotation))
        found = check(sample.model, pose, sample.contacts, sample.faces, features=sample.features)
        shares = found.distances / sample.contacts.position_error
        assert farthest == pytest.approx(shares.max(), rel=1e-6, abs=1e-6)
        assert max(worst, farthest) <= 1.0 or not found.within.all()
        # The hulls of concave faces hold more than the faces do.
        angles, bounds = found.angles, sample.contacts.normal_error
        chords = np.sin(0.5 * angles) / np.sin(0.5 * bounds)
        assert worst <= max(shares.max(), chords.max(), (angles / bounds).max()) * (1.0 + 1e-6)


# Algebra


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
        inside = turned(Rotation.from_rotvec(centre), angle, rng).as_rotvec()
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


# What the search rules out


def test_the_look_ahead_never_drops_the_feature_that_a_further_contact_is_on() -> None:
    rng, near, row, root = np.random.default_rng(12), np.empty(3), np.empty(6), np.empty((3, 3))
    tried, dropped = 0, 0
    for case in range(600):
        sample = draw(rng, 2)
        if case % 2:
            # Known contacts close together, and a further one at a long lever.
            touches, normal = sample.touches, rng.choice([0.003, 0.01, 0.03])
            apart = np.linalg.norm(touches.points - touches.points[0], axis=1)
            touches = touches[apart.argsort()]
            contacts = feel(touches, rng, 0.001 * INCH, normal, at_bounds=case % 4 == 1)
            sample = replace(sample, touches=touches, contacts=contacts)
        known = int(rng.integers(1, len(sample.contacts)))
        if (sample.faces[:known] < 0).all():
            continue
        angle = 0.1 if case % 2 else rng.choice([0.03, 0.3, 1.0])
        ball, rotation, translation = start_near(sample, rng, angle)
        work, _ = read_at(sample, rotation, translation)
        _, faces, _, model, contacts = sample.question
        bound, _ = locate(known, *sample.question[1:], rotation, ball, angle, work)
        square_root(work[1][0], root)
        x, u, pivot = work[3][0], work[3][1], work[5][2]
        for j in range(known, len(sample.contacts)):
            for f in (faces[j], *rng.integers(len(sample.features), size=3)):
                if faces[j] < 0:
                    continue
                fits = possible(
                    *(x[j], u[j], x[j] - pivot, f, contacts[2][j], contacts[3][j], contacts[4][j]),
                    *(model, bound, work[1], root, row, near),
                )
                assert fits or f != faces[j], f"case {case}: the true feature was dropped"
                tried, dropped = tried + 1, dropped + (not fits)
    assert dropped > 0.1 * tried


def contact_on(
    features: Features, f: int, rng: np.random.Generator, reach: float, lean: float
) -> tuple[Floats, Floats]:
    """A contact and a normal, object frame, a distance and an angle from any of a feature's own."""
    corners = features.corners[features.start[f] : features.start[f + 1]]
    cone = features.cone_normals[features.cone_start[f] : features.cone_start[f + 1]]
    place = rng.dirichlet(np.full(len(corners), 0.5)) @ corners
    normal = rng.dirichlet(np.full(len(cone), 0.5)) @ cone
    normal /= np.linalg.norm(normal)
    # Beyond an edge's end, but off its very line: that has a test of its own.
    outwards = place - corners.mean(axis=0) + 1e-5 * direction(rng)
    away = (normal, -normal, outwards, direction(rng))[rng.integers(4)]
    away = away / np.linalg.norm(away)
    axis = np.cross(normal, direction(rng))
    turn = Rotation.from_rotvec(lean * axis / np.linalg.norm(axis))
    return place + reach * away, turn.apply(normal)


def ask_possible(
    test: ModelTest,
    f: int,
    here: tuple[Floats, Floats, Floats],
    bounds: tuple[float, float],
    motion: Floats,
    share: float,
) -> bool:
    """`possible` for the region of the motions from a share of one to all of it."""
    region, root = workspace(1)[1], np.empty((3, 3))
    half = 0.5 * (1.0 - share) * motion
    region[0][:] = np.outer(motion[:3], motion[:3])
    region[1][:], region[2][:] = np.outer(half, half), motion - half
    square_root(region[0], root)
    x, u, lever = here
    reach, lean = bounds
    angle = float(np.linalg.norm(motion[:3]))
    chord, sine = 2.0 * np.sin(0.5 * lean), np.sin(min(lean, 0.5 * np.pi))
    return possible(
        *(x, u, lever, f, reach, chord, sine, test.model, angle),
        *(region, root, np.empty(6), np.empty(3)),
    )


def test_a_feature_that_a_pose_of_a_region_brings_within_the_bounds_is_possible() -> None:
    rng = np.random.default_rng(26)
    for case in range(2000):
        _, test = TESTS[rng.integers(len(TESTS))]
        f = int(rng.integers(len(test.features)))
        reach, lean = rng.choice([1e-4, 1e-3]), rng.choice([0.02, 0.3, 1.5, 2.5, np.pi])
        hair = 1.0 - 1e-6
        there, normal = contact_on(test.features, f, rng, hair * reach, hair * lean)
        w = direction(rng) * rng.choice([0.0, 1e-3, 0.1, 1.0])
        s = direction(rng) * rng.choice([0.0, 1e-3, 0.03])
        lever = direction(rng) * rng.choice([0.0, 0.01, 0.1])
        # Where the region's own pose has them: x' = exp(-w) a + pivot - s with the lever a.
        turn = Rotation.from_rotvec(w)
        here = there + s - turn.inv().apply(lever) + lever, turn.apply(normal), lever
        motion, share = np.concatenate([w, s]), rng.choice([0.0, 0.5, 1.0])
        assert ask_possible(test, f, here, (reach, lean), motion, share), f"case {case}"


def test_at_one_pose_those_features_are_possible_whose_bounds_are_met() -> None:
    rng, seen = np.random.default_rng(27), Counter()
    for _ in range(1500):
        _, test = TESTS[rng.integers(len(TESTS))]
        features, f = test.features, int(rng.integers(len(test.features)))
        reach, lean = 1e-3, rng.choice([0.02, 0.3, 1.5, 2.5, np.pi])
        off, leaning = rng.uniform(0.5, 1.5, 2) if rng.random() < 0.5 else rng.uniform(0, 50, 2)
        x, u = contact_on(features, f, rng, off * reach, min(np.pi, leaning * lean))
        hull = features.corners[features.start[f] : features.start[f + 1]]
        cone = features.cone_normals[features.cone_start[f] : features.cone_start[f + 1]]
        fan = [hull[[0, k, min(k + 1, len(hull) - 1)]] for k in range(max(1, len(hull) - 1))]
        distance, angle = triangle_distances(x[None], np.array(fan)).min(), cone_angles(u, cone)
        expected = bool(distance <= reach and angle <= lean)
        if min(abs(distance / reach - 1.0), abs(angle / lean - 1.0)) > 1e-6:
            here = x, u, direction(rng)
            assert ask_possible(test, f, here, (reach, lean), np.zeros(6), 1.0) == expected
            seen[expected] += 1
    assert min(seen.values()) > 150


def fitting(
    features: Features, tables: Floats, contacts: Contacts, pair: tuple[int, int], switches: int
) -> NDArray[np.bool_]:
    """(f, f) which features of two contacts `narrow` lets go together."""
    count, words = len(features), -(-len(features) // 64)
    errors, readings = contacts.normal_error, np.empty((len(contacts), len(contacts), 9))
    pair_readings(kernel_contacts(contacts), errors, readings)
    kept, everything = np.empty(words, np.uint64), np.zeros(64 * words, np.uint8)
    everything[:count] = 1
    domain = np.packbits(everything, bitorder="little").view(np.uint64)
    found = np.empty((count, count), bool)
    for a in range(count):
        half, (one, other) = features.half_angles[a], pair
        bounds = errors[one], errors[other]
        size = narrow(a, tables, half, readings[pair], *bounds, switches, domain, kept)
        found[a] = np.unpackbits(kept.view(np.uint8), bitorder="little")[:count]
        assert size == found[a].sum()
    return found


CONSTRAINTS = ("distance", "angle", "component", "tilt")


@pytest.mark.parametrize("name", ["L-block", "holed", "housing", "complex-hand"])
def test_pairs_of_faces_go_together_as_the_memo_has_it(name: str) -> None:
    model, rng = (SMALL | STAND_INS)[name], np.random.default_rng(13)
    features, tables = face_features(model), PairTables.of(model)
    packed, both = pack_tables(tables), Counter()
    for case in range(12):
        contacts, _ = oracles.random_contacts(
            model,
            oracles.random_pose(rng, 1.0),
            2,
            rng,
            position_error=rng.uniform(0.0, 0.003, 2) + 1e-6,
            normal_error=rng.choice([0.02, 0.3, 1.5, np.pi], 2),
            awkward=True,
            at_bounds=case % 2 == 0,
        )
        for chosen in (*((name,) for name in CONSTRAINTS), CONSTRAINTS[:3], CONSTRAINTS):
            switches = Constraints(**{name: name in chosen for name in CONSTRAINTS}).bits
            found = fitting(features, packed, contacts, (0, 1), switches)
            margins = oracles.pair_margins(tables, contacts, 0, 1, chosen)
            sure = np.abs(margins) > 1e-9
            np.testing.assert_array_equal(found[sure], margins[sure] >= 0.0)
            both.update(found.ravel().tolist())
    assert min(both.values()) > 100


def test_pairs_of_edges_and_vertices_that_were_touched_go_together() -> None:
    rng, rest = np.random.default_rng(14), []
    packed = [pack_tables(PairTables.of(model, test.features)) for model, test in TESTS]
    tests = [test for _, test in TESTS]
    for _ in range(60):
        sample = draw(rng, 2, 6)
        tables = packed[tests.index(sample.test)]
        for chosen in (*((name,) for name in CONSTRAINTS), CONSTRAINTS):
            switches = Constraints(**{name: name in chosen for name in CONSTRAINTS}).bits
            found = fitting(sample.features, tables, sample.contacts, (0, 1), switches)
            if (sample.faces[:2] >= 0).all():
                assert found[tuple(sample.faces[:2])]
                rest.append(found.mean())
    assert np.mean(rest) < 0.8


def recognized(
    model: Polyhedron, contacts: Contacts, crowd: int, features: Literal["faces", "all"] = "faces"
) -> tuple[set[tuple[int, ...]], Belief]:
    limits = SearchLimits(crowd=crowd)
    belief = Recognizer([model], features=features, limits=limits).recognize(contacts)
    assert belief.complete
    return {tuple(row) for h in belief.hypotheses for row in h.interpretations.tolist()}, belief


@pytest.mark.parametrize("name", [*SMALL, "stapler", "housing"])
def test_the_search_finds_what_the_tree_and_the_model_test_find(name: str) -> None:
    # Of the cube it looks at one of the symmetric copies only; of the others, at poses early.
    model, rng = (SMALL | STAND_INS)[name], np.random.default_rng(15)
    tables, test = PairTables.of(model), ModelTest(model)
    for case in range(2):
        touches = (
            sense_grid(model, rng, 5, 16)
            if name in STAND_INS
            else touch_features(model, test.features, rng, int(rng.integers(3, 7)))
        )
        row = ROWS[case % 2]
        contacts = feel(touches, rng, row[1] * INCH, row[0], at_bounds=case == 0)
        leaves = prune(tables, contacts, budget=200_000)
        assert leaves.complete
        poses = test.run(leaves.faces, contacts)
        expected = oracles.as_set(poses.faces)
        assert tuple(touches.faces.tolist()) in expected
        for crowd in (1, 16, 10**6):
            found, belief = recognized(model, contacts, crowd)
            assert found == expected
            for hypothesis in belief.hypotheses:
                first = hypothesis.interpretations[0]
                passed = check(model, hypothesis.pose, contacts, first).passed
                assert passed or not poses.proven.all()


@pytest.mark.parametrize(("name", "count", "crowd"), [("cube", 3, 10**6), ("L-block", 5, 1)])
def test_a_search_over_edges_and_vertices_finds_what_trying_all_of_them_finds(
    name: str, count: int, crowd: int
) -> None:
    model, rng = SMALL[name], np.random.default_rng(16)
    features = all_features(model)
    packed = pack_tables(PairTables.of(model, features))
    test = ModelTest(model, features, boxes=5, pool=10**7)
    touches = touch_features(model, features, rng, count)
    contacts = feel(touches, rng, 0.0002, 0.02)
    rows = np.zeros((1, 0), np.int32)
    for j in range(count):
        more = np.tile(np.arange(len(features), dtype=np.int32), len(rows))
        rows = np.column_stack([np.repeat(rows, len(features), axis=0), more])
        for i in range(j):
            fits = fitting(features, packed, contacts, (i, j), 7)
            rows = rows[fits[rows[:, i], rows[:, j]]]
    poses = test.run(np.ascontiguousarray(rows), contacts)
    expected = oracles.as_set(poses.faces[poses.proven]) | {tuple(touches.faces.tolist())}
    assert expected <= recognized(model, contacts, crowd, "all")[0]


@pytest.mark.parametrize(("name", "crowd"), [("cube", 10**6), ("L-block", 1)])
def test_a_search_without_normals_finds_what_the_tree_and_the_model_test_find(
    name: str, crowd: int
) -> None:
    model, rng = SMALL[name], np.random.default_rng(21)
    tables, test = PairTables.of(model), ModelTest(model, boxes=5, pool=10**7)
    touches = touch_features(model, test.features, rng, 5)
    contacts = forget_normals(feel(touches, rng, 0.0005, 0.1), np.arange(5) != 0)
    poses = test.run(prune(tables, contacts).faces, contacts)
    expected = oracles.as_set(poses.faces[poses.proven]) | {tuple(touches.faces.tolist())}
    assert expected <= recognized(model, contacts, crowd)[0]


# Features and symmetries


def winding(model: Polyhedron, point: Floats) -> float:
    """1 inside the solid and 0 outside: the solid angles of its triangles (van Oosterom)."""
    a, b, c = (model.vertices[model.triangles] - point).transpose(1, 0, 2)
    la, lb, lc = (np.linalg.norm(arm, axis=1) for arm in (a, b, c))
    dots = [(one * other).sum(axis=1) for one, other in ((a, b), (b, c), (c, a))]
    across = (a * np.cross(b, c)).sum(axis=1)
    below = la * lb * lc + dots[0] * lc + dots[1] * la + dots[2] * lb
    return float(np.arctan2(across, below).sum() / (2.0 * np.pi))


@pytest.mark.parametrize(
    ("name", "edges", "vertices"),
    [
        ("cube", 12, 8),
        ("tetrahedron", 6, 4),
        ("l-block", 17, 10),
        ("hull-20", 30, 12),
        ("pocketed", 16, 8),
    ],
)
def test_convex_edges_and_vertices_are_counted_and_concave_ones_are_not(
    name: str, edges: int, vertices: int
) -> None:
    model = oracles.model(name)
    features = all_features(model)
    kinds = Counter(features.kind(f) for f in range(len(features)))
    assert kinds == {"face": model.face_count, "edge": edges, "vertex": vertices}
    for f in range(model.face_count, len(features)):
        cone = cone_of(model, f, features)
        inwards = 1e-3 * model.diameter * cone.mean(axis=0)
        assert winding(model, features.middles[f] + inwards) == pytest.approx(0.0, abs=1e-6)
        assert winding(model, features.middles[f] - inwards) == pytest.approx(1.0, abs=1e-6)
        assert np.arccos(cone @ features.normals[f]).max() == pytest.approx(features.half_angles[f])


def test_the_normals_of_a_cubes_vertex_are_those_of_its_three_faces() -> None:
    features = all_features(CUBE)
    for f in range(len(features)):
        cone, at = cone_of(CUBE, f, features), features.middles[f]
        faces = np.abs(CUBE.normals @ at - CUBE.offsets) < 1e-12
        assert len(cone) == faces.sum() == {"face": 1, "edge": 2, "vertex": 3}[features.kind(f)]
        assert all(
            np.abs(cone - normal).sum(axis=1).min() < 1e-12 for normal in CUBE.normals[faces]
        )


@pytest.mark.parametrize("name", ["tetrahedron", "hull-20", "hull-90"])
def test_the_cones_of_a_convex_solid_share_all_directions_among_them(name: str) -> None:
    model, rng = oracles.model(name), np.random.default_rng(20)
    features = all_features(model)
    vertices = [f for f in range(len(features)) if features.kind(f) == "vertex"]
    ways = np.array([direction(rng) for _ in range(300)])
    inside = np.array([cone_angles(ways, cone_of(model, f, features)) for f in vertices]) < 1e-9
    # A vertex is met from exactly those directions in which no other lies farther out.
    farthest = np.argmax(features.middles[vertices] @ ways.T, axis=0)
    np.testing.assert_array_equal(inside, np.arange(len(vertices))[:, None] == farthest)


@pytest.mark.parametrize(
    ("name", "size"), [("cube", 24), ("prism", 12), ("tetrahedron", 12), ("holed", 4)]
)
def test_symmetries_take_features_to_features(name: str, size: int) -> None:
    model = Polyhedron.from_mesh(oracles.prism(6, 0.7)) if name == "prism" else oracles.model(name)
    if name == "holed":
        model = HOLED
    for features in (face_features(model), all_features(model)):
        images, missed = feature_permutations(model, features)
        assert missed < 1e-9
        assert images.shape == (size, len(features))
        assert len(np.unique(images, axis=0)) == size
        np.testing.assert_array_equal(images[0], np.arange(len(features)))
        for turn, image in zip(model.symmetries, images, strict=True):
            np.testing.assert_array_equal(np.sort(image), np.arange(len(features)))
            for f, g in enumerate(image):
                assert features.kind(f) == features.kind(g)
                for corners in (corners_at(features, f) - model.centroid,):
                    moved = corners @ turn.T + model.centroid
                    apart = np.linalg.norm(moved[:, None] - corners_at(features, g), axis=2)
                    assert apart.min(axis=1).max() < 1e-9
                cones = cone_of(model, f, features) @ turn.T, cone_of(model, g, features)
                assert np.linalg.norm(cones[0][:, None] - cones[1], axis=2).min(axis=1).max() < 1e-9


def corners_at(features: Features, f: int) -> Floats:
    return features.corners[features.start[f] : features.start[f + 1]]
