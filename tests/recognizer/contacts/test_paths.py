"""Paths that a probe swept: what they keep, and what cannot be one."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.two_ways import TIGHT

from palpate.recognizer import Contacts, FreeSpace, Polygon, Recognizer, SupportPlane


def test_paths_are_joined_in_order_and_know_their_clearance() -> None:
    one = FreeSpace([[0, 0, 0]], [[1, 0, 0]], radius=0.25, error=0.125)
    two = FreeSpace([[0, 1, 0]] * 2, [[1, 1, 0]] * 2, error=[0.5, 1.0])
    both = FreeSpace.join([one, FreeSpace.none(), two])
    assert len(both) == 3
    np.testing.assert_array_equal(both.clearance, [0.125, -0.5, -1.0])
    np.testing.assert_array_equal(both.starts[:, 1], [0, 1, 1])
    assert len(FreeSpace.join([])) == len(FreeSpace.none()) == 0


def test_paths_share_no_memory_and_can_not_be_written() -> None:
    starts = np.zeros((1, 3))
    paths = FreeSpace(starts, np.ones((1, 3)), error=1.0)
    starts[:] = 7.0
    assert not paths.starts.any()
    for values in (paths.starts, paths.ends, paths.radius, paths.error):
        with pytest.raises(ValueError, match="read-only"):
            values[:] = 0.0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"starts": [0, 0, 0]}, r"starts must have shape \(m, 3\), not \(3,\)"),
        ({"starts": [[0, 0]]}, r"starts must have shape \(m, 3\), not \(1, 2\)"),
        ({"ends": [[0, 0, 0, 0]]}, r"ends must have shape \(m, 3\), not \(1, 4\)"),
        ({"starts": [[0, np.nan, 0]]}, r"starts: row 0 is \[0.0, nan, 0.0\]; it must be finite"),
        ({"ends": [[0, 0, -np.inf]]}, r"ends: row 0 is \[0.0, 0.0, -inf\]; it must be finite"),
        ({"ends": [[0, 0, 0]] * 2}, r"1 starts but 2 ends: give one end a start"),
        ({"radius": -1e-3}, r"radius: row 0 is -0.001; it must be zero or more"),
        ({"radius": np.nan}, r"radius: row 0 is nan; it must be zero or more"),
        ({"radius": [0.0, 0.0]}, r"radius must be one number or have shape \(1,\), not \(2,\)"),
        ({"error": 0.0}, r"error: row 0 is 0; it must be above zero"),
        ({"error": [-1.0]}, r"error: row 0 is -1; it must be above zero"),
        ({"error": np.inf}, r"error: row 0 is inf"),
        ({"error": [[1.0]]}, r"error must be one number or have shape \(1,\), not \(1, 1\)"),
    ],
)
def test_what_cannot_be_a_path_is_refused_with_a_reason(change: dict, message: str) -> None:
    values = {"starts": [[0, 0, 0]], "ends": [[1, 0, 0]], "radius": 0.0, "error": 1e-3} | change
    with pytest.raises(ValueError, match=message):
        FreeSpace(values["starts"], values["ends"], radius=values["radius"], error=values["error"])


def test_the_path_at_fault_is_named() -> None:
    with pytest.raises(ValueError, match="error: row 2 is 0"):
        FreeSpace(np.zeros((3, 3)), np.ones((3, 3)), error=[1.0, 1.0, 0.0])


@pytest.mark.parametrize("known", ["free_space", "support"])
def test_outlines_of_the_plane_take_neither_free_space_nor_a_support(known: str) -> None:
    outline = Polygon.from_corners([[0, 0], [0.04, 0], [0.04, 0.03]], name="corner")
    contacts = Contacts([[0.02, 0.0]], [[0.0, -1.0]], **TIGHT)
    recognizer = Recognizer([outline])
    given = {
        "free_space": {"free_space": FreeSpace.none()},
        "support": {"support": SupportPlane(error=1e-3)},
    }[known]
    with pytest.raises(ValueError, match="free space and support are for solids"):
        recognizer.recognize(contacts, **given)
    belief = recognizer.recognize(contacts)
    with pytest.raises(ValueError, match=r"free space .* for solids"):
        recognizer.update(belief, contacts, free_space=FreeSpace.none())
