"""Rows, the only place where anything is linearised: they hold at every true pose of a box."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from helpers.scenes import KINDS, NAMES, Scene, probe
from numpy.typing import NDArray
from oracles.checker import check
from oracles.samples import Sample, direction, draw, rotation_near
from scipy.optimize import linprog
from scipy.spatial.transform import RigidTransform, Rotation

from palpate.recognizer.contacts.support import StableFace
from palpate.recognizer.poses.boxes_kernels import cayley, recentre
from palpate.recognizer.poses.cover import Aims, problem_of
from palpate.recognizer.poses.first_box_kernels import ALL, IMPOSSIBLE, first_boxes
from palpate.recognizer.poses.fits.pose import KernelModel
from palpate.recognizer.poses.known import Surroundings, known_of
from palpate.recognizer.poses.path_kernels import heed_paths
from palpate.recognizer.poses.polytope_kernels import tighten
from palpate.recognizer.poses.rows_kernels import contact_rows, extent, remainder, support_rows
from palpate.recognizer.poses.shape import Shape, Touches, shape_of, touches_of
from palpate.recognizer.poses.shrink_kernels import cut_rows
from palpate.recognizer.poses.work_space import work_space

Floats = NDArray[np.float64]
CASES = 1_500
EXACT = 1e-9
"""Rounding of a row, in radii."""


def turn_by(w: Floats) -> Floats:
    """Cayley's map, from its definition: (1 - W / 2)^-1 (1 + W / 2)."""
    cross = np.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]])
    return np.asarray(np.linalg.solve(np.eye(3) - cross / 2, np.eye(3) + cross / 2), np.float64)


def somewhere(rng: np.random.Generator, half: Floats) -> Floats:
    """In a box, on its sides or at its corners."""
    return half * np.clip(rng.uniform(-1.0, 1.0, len(half)) * rng.choice([1.0, 3.0]), -1.0, 1.0)


def test_what_linearising_leaves_out_is_within_its_bounds_and_comes_near_them() -> None:
    rng = np.random.default_rng(1)
    nearest = []
    for case in range(CASES):
        a, m = rng.normal(size=3) * rng.choice([0.1, 1.0]), direction(rng)
        half = rng.uniform(0.0, rng.choice([0.01, 0.3, 2.0]), 3)
        least, most = remainder(a, m, half)
        left = []
        for _ in range(20):
            w = somewhere(rng, half)
            left.append(m @ turn_by(w) @ a - m @ a - w @ np.cross(a, m))
        assert least - 1e-12 <= min(left), case
        assert max(left) <= most + 1e-12, case
        if half.max() < 0.02:
            nearest.append(max(min(left) / least if least else 1.0, max(left) / max(most, 1e-300)))
    assert np.median(nearest) > 0.5


def test_an_extent_holds_what_every_turn_of_the_box_makes_of_an_arm() -> None:
    rng = np.random.default_rng(2)
    for case in range(CASES):
        a, m = rng.normal(size=3), direction(rng)
        half = rng.uniform(0.0, rng.choice([0.1, 1.0, 4.0]), 3)
        angle = 2.0 * np.arctan(np.linalg.norm(half) / 2.0)
        least, most = extent(a, m, half, angle)
        for _ in range(10):
            assert least - EXACT <= m @ turn_by(somewhere(rng, half)) @ a <= most + EXACT, case


def test_a_box_seen_from_its_own_middle_holds_all_its_rotations() -> None:
    rng = np.random.default_rng(3)
    turn, half, middle, moved = np.empty((3, 3)), np.empty(3), np.empty((3, 3)), np.empty((3, 3))
    for case in range(CASES):
        chart = Rotation.random(rng=rng).as_matrix()
        sides = rng.uniform(0.0, rng.choice([0.01, 0.3, 1.0]), 3)
        centre = rng.uniform(-1.0, 1.0, 3) * (1.0 - sides)
        angle = recentre(chart, centre - sides, centre + sides, turn, half, middle)
        for _ in range(10):
            cayley(centre + somewhere(rng, sides), moved)
            between = Rotation.from_matrix(middle.T @ chart @ moved)
            w = 2.0 * np.tan(between.magnitude() / 2.0) * between.as_rotvec()
            w /= max(between.magnitude(), 1e-300)
            assert (np.abs(w) <= half + EXACT).all(), case
            assert between.magnitude() <= angle + EXACT, case


@cache
def shape_for(test: KernelModel) -> Shape:
    return shape_of(test.features, test.radius)


def read_by_kernels(sample: Sample) -> tuple[Shape, Touches]:
    return shape_for(sample.kernel), touches_of(sample.contacts, sample.kernel.radius)


def rows_about(
    sample: Sample, middle: Floats, half: Floats, low: Floats, high: Floats
) -> list[Floats]:
    """Of each contact that is on something, the rows (r, 7) of the true features in a box."""
    shape, touches = read_by_kernels(sample)
    work = work_space(100, 3, np.zeros(3))
    work.middle[:], work.half[:], work.low[:], work.high[:] = middle, half, low, high
    found = []
    for i, feature in enumerate(sample.faces):
        if feature < 0:
            continue
        used = contact_rows(i, feature, feature, shape, touches, work, 0)
        found.append(work.columns[:, :used].T.copy())
    return found


def true_place(sample: Sample) -> tuple[Floats, Floats]:
    """The true pose as the kernels have it: world to object, and the contacts' mean in radii."""
    touches = read_by_kernels(sample)[1]
    inverse = sample.true_rotation.T
    return inverse, inverse @ (touches.mean - sample.true_translation) / (
        sample.model.diameter / 2.0
    )


def test_all_rows_of_a_box_hold_at_the_truth_in_it() -> None:
    rng = np.random.default_rng(4)
    slacks, without = [], 0
    for case in range(CASES):
        sample = draw(rng, fewest=1, most=8)
        inverse, shift = true_place(sample)
        middle = rotation_near(Rotation.from_matrix(inverse), rng.choice([0.01, 0.3, 1.5]), rng)
        between = middle.inv() * Rotation.from_matrix(inverse)
        angle = between.magnitude()
        w = 2.0 * np.tan(angle / 2.0) / max(angle, 1e-300) * between.as_rotvec()
        half = np.abs(w) * rng.uniform(1.0, 2.0, 3) + 1e-6
        room = rng.uniform(1e-6, rng.choice([0.01, 0.5]), 3)
        aside = rng.uniform(-1.0, 1.0, 3) * room
        low = np.concatenate([-half, shift + aside - room])
        high = np.concatenate([half, shift + aside + room])
        z = np.concatenate([w, shift])
        for rows in rows_about(sample, middle.as_matrix(), half, low, high):
            over = rows[:, :6] @ z - rows[:, 6]
            assert (over <= EXACT).all(), f"case {case}: a row loses the truth"
            slacks += (-over).tolist()
        # Had the rows given up nothing, they would have lost it.
        for rows in rows_about(sample, middle.as_matrix(), np.zeros(3), low, high):
            without += int((rows[:, :6] @ z - rows[:, 6] > EXACT).any())
    assert np.quantile(slacks, 0.01) < 1e-3
    assert without > CASES / 20


def test_a_pose_well_outside_its_bounds_breaks_a_row_of_a_small_box() -> None:
    rng = np.random.default_rng(5)
    broken = 0
    for case in range(CASES):
        sample = draw(rng, fewest=3, most=8)
        if not sample.on_convex_features or not (sample.faces >= 0).any():
            continue
        off = Rotation.from_rotvec(direction(rng) * rng.uniform(0.1, 1.0))
        inverse, shift = true_place(sample)
        turned = (off * Rotation.from_matrix(inverse)).as_matrix()
        half = np.full(3, 1e-7)
        pose = np.concatenate([np.zeros(3), shift])
        low, high = pose - 1e-7, pose + 1e-7
        radius = sample.model.diameter / 2.0
        translation = sample.contacts.positions.mean(axis=0) - turned.T @ shift * radius
        _, worst = _readings(sample, turned.T, translation)
        if worst < 2.0:
            continue
        broken += 1
        rows = np.concatenate(rows_about(sample, turned, half, low, high))
        assert (rows[:, :6] @ pose - rows[:, 6] > 0.0).any(), case
    assert broken > CASES / 10


@pytest.mark.parametrize("kind", ["free", "plane", "standing"])
def test_what_free_paths_and_a_support_ask_holds_at_the_truth(kind: str) -> None:
    rng = np.random.default_rng([8, list(KINDS).index(kind)])
    asked, ruled_out, slacks = 0, 0, []
    for case in range(CASES // 5):
        scene = probe(NAMES[case % 3], rng, **KINDS[kind])
        entry = scene.recognizer.library.solid(scene.model.name)
        feet = [] if kind != "standing" else _stood_on(entry.stable_faces, scene)
        surroundings = Surroundings.of(scene.free_space, scene.support)
        known = known_of(entry, scene.contacts, surroundings, np.eye(3), feet)
        aims = Aims(0, 0.1, 0, 0.05, 0.05)
        problem = problem_of(
            *(entry.shape, entry.kernel.model, entry.packed, scene.contacts, 0, aims), known
        )
        work = work_space(len(scene.contacts), 3, problem.touches.mean, known)
        inverse, radius = scene.pose.rotation.inv(), entry.shape.radius
        shift = inverse.apply(problem.touches.mean - scene.pose.translation) / radius
        for truth in (True, False):
            size = rng.choice([0.002, 0.02, 0.2])
            middle = rotation_near(inverse, size, rng)
            between = middle.inv() * inverse
            angle = max(between.magnitude(), 1e-300)
            w = 2.0 * np.tan(angle / 2.0) / angle * between.as_rotvec()
            room = rng.uniform(0.1, 1.0, 3) * size
            aside = rng.uniform(-1.0, 1.0, 3) * room
            if not truth:
                # A box far from the truth may be ruled out; if none ever were, nothing was asked.
                aside += rng.normal(size=3)
            work.middle[:], work.half[:] = middle.as_matrix(), np.abs(w) * 1.2 + 1e-6
            work.low[:3], work.high[:3] = -work.half, work.half
            work.low[3:], work.high[3:] = shift + aside - room, shift + aside + room
            work.rotation[:] = middle.inv().as_matrix()
            work.translation[:] = problem.touches.mean - radius * middle.inv().apply(shift + aside)
            work.cut_count[0] = 0
            used = support_rows(-1, known, radius, work, 0) if scene.support else 0
            possible = heed_paths(problem, work)
            used = cut_rows(used, work)
            if not truth:
                ruled_out += not possible
                continue
            assert possible, f"case {case}: paths rule out the truth"
            over = work.columns[:6, :used].T @ np.concatenate([w, shift]) - work.columns[6, :used]
            assert (over <= 1e-8).all(), f"case {case}: a row loses the truth"
            asked += used
            slacks += (-over).tolist()
    assert asked > 50
    assert np.min(slacks) < 0.01
    assert ruled_out > 20


def _stood_on(faces: list[StableFace], scene: Scene) -> list[StableFace]:
    """The face that a solid of a scene stands on."""
    assert scene.support is not None
    down = -scene.pose.rotation.inv().apply(scene.support.up)
    return [max(faces, key=lambda face: float(face.normal @ down))]


def _readings(sample: Sample, rotation: Floats, translation: Floats) -> tuple[Floats, float]:
    """How far each place is from its feature, in bounds, by the oracle; and the farthest."""
    pose = RigidTransform.from_components(translation, Rotation.from_matrix(rotation))
    shares = check(
        sample.model, pose, sample.contacts, sample.faces, features=sample.features
    ).distances
    shares = shares / sample.contacts.position_error
    return shares, float(shares.max(initial=0.0))


def test_the_first_boxes_hold_the_true_rotation() -> None:
    rng = np.random.default_rng(6)
    counts = np.zeros(2, np.int64)
    work = work_space(12, 3, np.zeros(3))
    for case in range(CASES):
        sample = draw(rng, fewest=1, most=12)
        shape, touches = read_by_kernels(sample)
        turns = first_boxes(sample.faces, shape, touches, work)
        assert turns != IMPOSSIBLE, f"case {case}: the truth was excluded"
        if turns == ALL:
            continue
        counts[turns] += 1
        between = Rotation.from_matrix(work.charts.transpose(0, 2, 1) @ sample.true_rotation.T)
        angles = np.maximum(between.magnitude(), 1e-300)[:, None]
        gibbs = np.tan(angles / 2.0) * between.as_rotvec() / angles
        inside = (np.abs(gibbs) <= work.sides + EXACT).all(axis=1)
        assert inside[: turns + 1].any(), case
    assert (counts > CASES / 10).all()


@pytest.mark.parametrize("axis", range(6))
def test_a_tightened_box_reaches_as_far_as_scipys_linear_program_says(axis: int) -> None:
    rng = np.random.default_rng([7, axis])
    work = work_space(1, 3, np.zeros(3))
    empty = 0
    for case in range(200):
        count = int(rng.integers(1, 25))
        rows = rng.normal(size=(count, 6))
        limits = rows @ rng.uniform(-0.5, 0.5, 6) + rng.uniform(-0.3, 0.5, count)
        work.low[:], work.high[:] = -1.0, 1.0
        work.columns[:6, :count], work.columns[6, :count] = rows.T, limits
        share = tighten(axis, axis + 1, count, work)
        for side, reach in ((-1.0, work.low[axis]), (1.0, work.high[axis])):
            best = linprog(-side * np.eye(6)[axis], rows, limits, bounds=[(-1.0, 1.0)] * 6)
            if best.status == 2:
                empty += 1
                continue
            assert share >= 0.0, f"case {case}: called empty"
            # Nothing is cut off, and no more is left than what spares a program.
            assert side * reach >= -best.fun - 1e-7, case
            assert side * reach <= -best.fun + 0.1 * 2.0 + 1e-7, case
        if best.status == 2:
            assert share < 0.0, f"case {case}: not seen to be empty"
    assert 20 < empty < 380
