"""Boxes of rotations shrunk by linear programs: what they lose holds no pose within the bounds."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from oracles.proof_samples import Sample, direction, draw, motion_to, read_at, start_near
from scipy.optimize import linprog
from scipy.spatial.transform import Rotation

from palpate.recognizer.poses.proofs.inequality_kernels import add_contact, least_bend
from palpate.recognizer.poses.proofs.proof_kernels import locate
from palpate.recognizer.poses.proofs.shrink_kernels import box_region, shrink_box, shrink_space
from palpate.recognizer.poses.proofs.simplex_kernels import farthest, simplex_space

Floats = NDArray[np.float64]


def _square(low: Floats, high: Floats) -> float:
    return float(np.maximum(low[:3] ** 2, high[:3] ** 2).sum())


def test_a_turn_in_a_box_bends_a_lever_no_less_than_is_said() -> None:
    rng, tightest = np.random.default_rng(1), np.inf
    for _ in range(1000):
        lever, way = rng.normal(size=3), direction(rng)
        middle = rng.normal(size=3) * rng.choice([0.0, 0.1, 0.5])
        half = rng.uniform(0.0, rng.choice([0.01, 0.5, 1.0]), 3)
        low, high = (np.append(middle + sign * half, np.zeros(3)) for sign in (-1.0, 1.0))
        bound = least_bend(lever, way, (low, high, _square(low, high)))
        corners = np.array(np.meshgrid(*np.stack([low, high])[:, :3].T)).reshape(3, -1).T
        w = np.vstack([corners, rng.uniform(low[:3], high[:3], (60, 3))])
        moved = Rotation.from_rotvec(-w).apply(lever) - lever + np.cross(w, lever)
        beyond = moved @ way
        assert beyond.min() >= bound - 1e-12
        if bound < -1e-3:
            tightest = min(tightest, bound / beyond.min())
    assert tightest < 1.2


def _boxed(sample: Sample, rng: np.random.Generator) -> tuple[Any, Any, Floats]:
    """A box about a pose near the truth, as a search starts with it: arguments, box, true motion.

    The motion is along the box's axes, its shift in radii.
    """
    angle = rng.choice([0.03, 0.2, 0.6, 1.2])
    ball, rotation, translation = start_near(sample, rng, angle)
    work, _ = read_at(sample, rotation, translation)
    locate(*sample.question, rotation, ball, angle, work)
    axes, form = np.empty((2, 3, 3))
    centre, half = np.empty((2, 3))
    box_region(work[1], axes, centre, half, form)
    x, u, levers, _ = work[3]
    count, faces, targets, model, contacts = sample.question
    arguments = (count, faces, targets, x, levers, u, model, contacts, work[1])
    z = motion_to(sample, rotation, translation, work[5][2])
    return arguments, (axes, centre, half), np.append(z[:3] @ axes, z[3:] @ axes / model[6])


def _shrunk(arguments: Any, *box: Floats) -> bool:
    shrink: Any = shrink_box  # its types are numba's
    return shrink(*arguments, *box, shrink_space(arguments[0]))


def test_a_shrunk_box_holds_the_truth() -> None:
    rng, shares = np.random.default_rng(2), []
    for case in range(2500):
        sample = draw(rng)
        if (sample.faces < 0).all():
            continue
        arguments, (axes, centre, half), z = _boxed(sample, rng)
        before = half.copy()
        assert np.linalg.det(axes) == pytest.approx(1.0)
        assert (np.abs(z[:3] - centre) <= half + 1e-8).all()
        left = _shrunk(arguments, axes, centre, half)
        assert left, f"case {case}: no pose is said to be left"
        assert (np.abs(z[:3] - centre) <= half + 1e-8).all(), f"case {case}"
        assert (half <= before * (1.0 + 1e-9) + 1e-12).all()
        shares.append(np.prod(half / np.maximum(before, 1e-12)))
    assert np.quantile(shares, 0.3) < 0.1  # many samples are of few contacts, or of vague ones


def _inequalities(arguments: Any, axes: Floats, low: Floats, high: Floats) -> tuple[Floats, Floats]:
    count, faces, targets, x, levers, u, model, contacts, _ = arguments
    table, _, _, vectors = shrink_space(count)
    used = 0
    for i in np.flatnonzero(faces >= 0):
        used = add_contact(
            *((x[i], levers[i], u[i]), faces[i], targets[i], model),
            *((contacts[2][i], contacts[3][i], contacts[4][i]), axes),
            *((low, high, _square(low, high)), used, table, vectors),
        )
    return table[:6, :used].T, table[6, :used]


def test_the_truth_meets_every_inequality_of_a_box_that_holds_it() -> None:
    rng, asked = np.random.default_rng(3), 0
    for case in range(1500):
        sample = draw(rng)
        if (sample.faces < 0).all():
            continue
        arguments, (axes, _, _), z = _boxed(sample, rng)
        # The truth anywhere in the box, on its rim too.
        side = np.repeat(rng.choice([0.01, 0.1, 0.5, 1.0], 2), 3)
        low = z - side * rng.choice([0.0, 0.5, 1.0, rng.random()], 6)
        rows, limits = _inequalities(arguments, axes, low, low + side)
        assert (rows @ z <= limits + 1e-8).all()
        asked += len(rows)
        if case % 20 == 0:
            ways = rng.normal(size=6)
            polytope = np.vstack([rows.T, limits]), len(rows), low, low + side
            reach = farthest(ways, *polytope, simplex_space(len(rows)))
            box = np.column_stack([low, low + side])
            solved = linprog(-ways, A_ub=rows, b_ub=limits, bounds=box)
            assert reach == pytest.approx(-solved.fun, abs=1e-5)
    assert asked > 10_000


def test_boxes_far_from_the_truth_are_often_said_to_be_empty() -> None:
    rng, empty, cases = np.random.default_rng(4), 0, 0
    for _ in range(300):
        sample = draw(rng, 8, 20)
        if (sample.faces < 0).any():
            continue
        arguments, (axes, centre, half), z = _boxed(sample, rng)
        if (half < 0.02).any():
            continue
        # The half of the box without the truth.
        centre[0] += 0.55 * half[0] * (-1.0 if z[0] > centre[0] else 1.0)
        half[0] *= 0.4
        if abs(z[0] - centre[0]) <= half[0]:
            continue
        cases += 1
        empty += not _shrunk(arguments, axes, centre, half)
    assert cases > 30
    assert empty > 0.2 * cases
