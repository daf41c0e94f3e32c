"""Table V of the memo: what errors of a pose are, and how rows of means are judged."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from palpate.assets.memo import PoseErrorRow, table5
from palpate.envs.probe_env import INCH
from palpate.scripts.memo.errors.judge import judge, neighbours
from palpate.scripts.memo.errors.trials import METHODS, Errors, pose_errors


def about(axis: Sequence[float], degrees: float) -> RigidTransform:
    unit = np.array(axis, float) / np.linalg.norm(axis)
    return RigidTransform.from_rotation(Rotation.from_rotvec(np.radians(degrees) * unit))


def test_errors_of_a_pose_have_their_closed_forms():
    tilted = [math.sin(0.1), 0.0, math.cos(0.1)]
    found = pose_errors(about(tilted, 95.0), about([0, 0, 1], 90.0))
    np.testing.assert_allclose(found[:2], [math.degrees(0.1), 5.0], atol=1e-9)
    shifted = RigidTransform.from_translation([0.0, 3.0 * INCH, 4.0 * INCH]) * about([0, 0, 1], 90)
    np.testing.assert_allclose(
        pose_errors(shifted, about([0, 0, 1], 90.0)), [0, 0, 0, 5], atol=1e-6
    )


def test_just_before_and_just_after_half_a_turn_are_near_one_another():
    found = pose_errors(about([0, 0, 1], 179.0), about([0, 0, 1], 181.0))
    np.testing.assert_allclose(found, [0.0, 2.0, 2.0, 0.0], atol=1e-6)


def test_a_direction_means_little_where_the_angle_is_small():
    found = pose_errors(about([1, 0, 0], 0.1), about([0, 1, 0], 0.1))
    np.testing.assert_allclose(found[:3], [90.0, 0.0, 0.1 * math.sqrt(2.0)], atol=1e-6)
    still = pose_errors(RigidTransform.identity(), about([0, 1, 0], 0.1))
    np.testing.assert_allclose(still, [0.0, 0.1, 0.1, 0.0], atol=1e-9)
    both = pose_errors(RigidTransform.identity(), RigidTransform.identity())
    np.testing.assert_allclose(both, 0.0, atol=1e-9)


def made_up_row(pi_over: int, inches: float, angle: float, *, sure: bool = True) -> PoseErrorRow:
    return PoseErrorRow("housing", pi_over, inches, 2.0, angle, 0.1, sure)


def made_up_errors(angle: float) -> Errors:
    """Errors of 50 trials that scatter by a twentieth around 2°, an angle, and 0.1 in."""
    rng = np.random.default_rng(0)
    rows = np.array([2.0, angle, 3.0, 0.1]) * (1.0 + 0.05 * rng.standard_normal((50, 4)))
    return Errors(dict.fromkeys(METHODS, rows), np.zeros(50), 0)


def test_a_mean_beyond_the_factor_is_outside_with_its_name_and_how_far():
    rows = [made_up_row(10, 0.01, 2.0)]
    assert judge(rows, [made_up_errors(7.0)])[0].verdict == "within"
    (far,) = judge(rows, [made_up_errors(9.0)])
    assert far.verdict == "outside"
    assert re.match(r"angle, °: 4\.[45]\d times the memo's;", far.why)
    assert "direction" not in far.why
    (near,) = judge(rows, [made_up_errors(0.4)])
    assert near.verdict == "outside"
    unsure = [made_up_row(10, 0.01, 2.0, sure=False)]
    assert judge(unsure, [made_up_errors(9.0)])[0].verdict == "not judged"


def test_rows_in_the_other_order_are_outside_where_both_orders_are_sure():
    rows = [made_up_row(10, 0.01, 2.0), made_up_row(8, 0.01, 3.0)]
    assert neighbours(rows) == [(0, 1)]
    upright = judge(rows, [made_up_errors(2.0), made_up_errors(3.0)])
    assert [row.verdict for row in upright] == ["within", "within"]
    swapped = judge(rows, [made_up_errors(3.0), made_up_errors(2.0)])
    assert [row.verdict for row in swapped] == ["within", "outside"]
    assert "ordered the other way against π/10, 0.01 in" in swapped[1].why
    # By less than the scatter of fifty trials:
    alike = judge(rows, [made_up_errors(2.01), made_up_errors(2.0)])
    assert [row.verdict for row in alike] == ["within", "within"]


def test_neighbours_are_one_step_apart_along_one_axis_of_noise():
    rows = table5()
    for a, b in neighbours(rows):
        assert rows[a].object_name == rows[b].object_name
        assert rows[a].sure
        assert rows[b].sure
        wider = rows[b].pi_over < rows[a].pi_over
        farther = rows[b].position_error_in > rows[a].position_error_in
        assert wider != farther
    # Six rows of the simple hand in a grid of three by two, two of the housing.
    assert len(neighbours(rows)) == 4 + 3 + 1
