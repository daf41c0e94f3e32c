"""Contacts refuse what can't be a touch, and never change."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from palpate.recognizer import Contacts

UP = [[0.0, 0.0, 1.0]]


def contacts(count: int = 3, seed: int = 0) -> Contacts:
    rng = np.random.default_rng(seed)
    normals = rng.normal(size=(count, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return Contacts(
        rng.normal(size=(count, 3)),
        normals,
        position_error=rng.uniform(1e-4, 1e-2, count),
        normal_error=rng.uniform(0.1, 0.5, count),
    )


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"positions": [[0, np.nan, 0]]}, r"positions: row 0 is \[0.0, nan, 0.0\]; .* finite"),
        ({"positions": [[0, 0, np.inf]]}, r"positions: row 0 .* finite"),
        ({"positions": [0, 0, 0]}, r"positions must have shape \(n, 3\), or .*, not \(3,\)"),
        ({"positions": [[0] * 4]}, r"positions must have shape \(n, 3\), or .*, not \(1, 4\)"),
        ({"positions": [[0, 0]]}, r"positions have 2 coordinates but normals 3"),
        ({"normals": [[0, 0, np.nan]]}, r"normals: row 0 .* finite"),
        ({"normals": [[[0, 0, 1]]]}, r"normals must have shape \(n, 3\), or .*, not \(1, 1, 3\)"),
        ({"normals": [[0, 0, 1.01]]}, r"normals: row 0 has length 1.01; .* unit"),
        ({"normals": [[0, 0, 0]]}, r"normals: row 0 has length 0; .* unit"),
        ({"normals": UP * 2}, r"1 positions but 2 normals"),
        ({"normals": None}, r"normal_error below pi, but no normals"),
        ({"normal_error": None}, r"normals without normal_error"),
        ({"position_error": 0.0}, r"position_error: row 0 is 0; .* above zero$"),
        ({"position_error": -1e-3}, r"position_error: row 0 is -0.001"),
        ({"position_error": [np.inf]}, r"position_error: row 0 is inf"),
        ({"position_error": [1e-3, 1e-3]}, r"position_error must be one number or .* \(1,\), not"),
        ({"normal_error": np.nan}, r"normal_error: row 0 is nan"),
        ({"normal_error": 0.0}, r"normal_error: row 0 is 0; .* at most pi"),
        ({"normal_error": [3.2]}, r"normal_error: row 0 is 3.2; .* at most pi"),
        ({"normal_error": [[0.1]]}, r"normal_error must be one number or .* not \(1, 1\)"),
    ],
)
def test_what_cannot_be_a_contact_is_refused_with_a_reason(change, message):
    values = {
        "positions": [[0.0, 0.0, 0.0]],
        "normals": UP,
        "position_error": 1e-3,
        "normal_error": 0.2,
    } | change
    with pytest.raises(ValueError, match=message):
        Contacts(
            values["positions"],
            values["normals"],
            position_error=values["position_error"],
            normal_error=values["normal_error"],
        )


def test_the_row_at_fault_is_named():
    with pytest.raises(ValueError, match="normals: row 1 has length 2"):
        Contacts(np.zeros((2, 3)), [[0, 0, 1], [0, 0, 2]], position_error=1, normal_error=1)


def test_a_bad_bound_is_refused_even_without_contacts():
    nothing = np.zeros((0, 3))
    with pytest.raises(ValueError, match="position_error"):
        Contacts(nothing, nothing, position_error=-1.0, normal_error=1.0)


def test_one_bound_for_all_is_the_same_as_one_bound_each():
    rows = contacts()
    one = Contacts(rows.positions, rows.normals, position_error=1e-3, normal_error=0.2)
    each = Contacts(rows.positions, rows.normals, position_error=[1e-3] * 3, normal_error=[0.2] * 3)
    np.testing.assert_array_equal(one.position_error, each.position_error)
    np.testing.assert_array_equal(one.normal_error, each.normal_error)


def test_a_normal_bound_of_pi_says_that_the_normal_is_unknown():
    assert Contacts([[0, 0, 0]], UP, position_error=1.0, normal_error=np.pi).normal_error == np.pi


def test_contacts_without_normals_know_none_whatever_way_they_are_given():
    points = np.arange(6.0).reshape(2, 3)
    for felt in (
        Contacts(points, position_error=1e-3),
        Contacts(points, np.full((2, 3), np.nan), position_error=1e-3, normal_error=0.2),
        Contacts(points, UP * 2, position_error=1e-3, normal_error=np.pi),
    ):
        np.testing.assert_array_equal(felt.normal_error, np.pi)
        np.testing.assert_allclose(np.linalg.norm(felt.normals, axis=1), 1.0)


def test_one_missing_normal_among_others_is_unknown_alone():
    felt = Contacts(np.zeros((2, 3)), [UP[0], [np.nan] * 3], position_error=1, normal_error=0.2)
    np.testing.assert_array_equal(felt.normal_error, [0.2, np.pi])


def test_contacts_of_the_plane_have_two_coordinates_and_join_none_of_space():
    flat = Contacts([[0, 1]], [[0, 1]], position_error=1, normal_error=1)
    assert flat.dimension == 2
    assert len(Contacts.join([flat, flat[:0]])) == 1
    with pytest.raises(ValueError, match=r"plane .* and of space"):
        Contacts.join([flat, contacts()])


def test_normals_rounded_as_text_are_made_unit():
    rounded = Contacts([[0, 0, 0]], [[0.5773, 0.5774, 0.5774]], position_error=1, normal_error=1)
    assert abs(np.linalg.norm(rounded.normals) - 1.0) < 1e-15


def test_contacts_share_no_memory_and_cannot_be_written():
    positions = np.zeros((1, 3))
    rows = Contacts(positions, UP, position_error=1e-3, normal_error=0.2)
    positions[:] = 7.0
    assert not rows.positions.any()
    for field in dataclasses.fields(rows):
        with pytest.raises(ValueError, match="read-only"):
            getattr(rows, field.name)[:] = 0.0
        with pytest.raises(dataclasses.FrozenInstanceError):
            setattr(rows, field.name, None)


def test_arrays_are_contiguous_doubles_whatever_came_in():
    rows = Contacts(
        np.asfortranarray(np.zeros((2, 3), np.float32)),
        np.array([[0, 0, 1], [1, 0, 0]]),
        position_error=1,
        normal_error=np.ones(4)[::2],
    )
    for field in dataclasses.fields(rows):
        value = getattr(rows, field.name)
        assert value.dtype == (np.int8 if field.name == "kinds" else np.float64)
        assert value.flags.c_contiguous


@pytest.mark.parametrize("rows", [slice(1, 3), [2, 0], np.array([True, False, True]), [], slice(0)])
def test_a_choice_of_rows_keeps_everything_of_each(rows):
    whole = contacts()
    part = whole[rows]
    index = rows if isinstance(rows, slice | np.ndarray) else np.array(rows, int)
    assert len(part) == len(whole.positions[index])
    np.testing.assert_array_equal(part.positions, whole.positions[index])
    np.testing.assert_allclose(part.normals, whole.normals[index], rtol=0, atol=1e-15)
    np.testing.assert_array_equal(part.position_error, whole.position_error[index])
    np.testing.assert_array_equal(part.normal_error, whole.normal_error[index])


def test_joined_parts_are_the_whole():
    whole = contacts(5)
    joined = Contacts.join([whole[:2], Contacts.none(), whole[2:]])
    for field in dataclasses.fields(whole):
        np.testing.assert_allclose(
            getattr(joined, field.name), getattr(whole, field.name), rtol=0, atol=1e-15
        )


def test_no_parts_join_to_no_contacts():
    assert len(Contacts.join([])) == 0
    assert Contacts.none().positions.shape == (0, 3)


# Where the probe came from


def test_approaches_are_unknown_unless_given_and_kept_by_rows_and_joins():
    plain = contacts(2)
    assert not plain.approach_known.any()
    ways = [[0.0, 0.0, -1.0], [np.nan] * 3]
    felt = Contacts(np.zeros((2, 3)), UP * 2, position_error=1, normal_error=0.2, approaches=ways)
    np.testing.assert_array_equal(felt.approach_known, [True, False])
    np.testing.assert_array_equal(felt.approaches, [[0, 0, -1], [0, 0, 0]])
    np.testing.assert_array_equal(felt[[1, 0]].approach_known, [False, True])
    both = Contacts.join([plain, felt])
    np.testing.assert_array_equal(both.approach_known, [False, False, True, False])


def test_approaches_rounded_as_text_are_made_unit():
    felt = Contacts(
        [[0, 0, 0]],
        UP,
        position_error=1,
        normal_error=0.2,
        approaches=[[0.5773, 0.5774, -0.5774]],
    )
    assert abs(np.linalg.norm(felt.approaches) - 1.0) < 1e-15


@pytest.mark.parametrize(
    ("ways", "message"),
    [
        ([0, 0, 1], r"approaches must have shape \(n, 3\), or .*, not \(3,\)"),
        ([[0, 0, 1]] * 2, r"approaches have shape \(2, 3\) but positions \(1, 3\): give one a pos"),
        ([[0, 1]], r"approaches have shape \(1, 2\) but positions \(1, 3\)"),
        ([[0, 0, 1.01]], r"approaches: row 0 has length 1.01; .* unit vectors"),
        ([[0, 0, 1e-9]], r"approaches: row 0 has length 1e-09; .* unit vectors"),
        ([[0, np.nan, 1]], r"approaches: row 0 .* finite"),
        ([[0, np.inf, 0]], r"approaches: row 0 is \[0.0, inf, 0.0\]; it must be finite"),
    ],
)
def test_what_cannot_be_an_approach_is_refused_with_a_reason(ways, message):
    with pytest.raises(ValueError, match=message):
        Contacts([[0, 0, 0]], UP, position_error=1, normal_error=0.2, approaches=ways)


def test_an_unknown_normal_faces_the_approach_and_a_known_one_stays():
    felt = Contacts(
        np.zeros((4, 3)),
        [UP[0], [np.nan] * 3, [np.nan] * 3, UP[0]],
        position_error=1,
        normal_error=[0.2, 1.0, 1.0, 3.0],
        approaches=[[1, 0, 0], [0, 1, 0], [0, 0, 0], [0, 1, 0]],
    )
    facing = felt.facing_approach()
    half_space = np.pi / 2.0 + 0.01
    np.testing.assert_array_equal(facing.normals[[0, 1, 3]], [UP[0], [0, -1, 0], [0, -1, 0]])
    np.testing.assert_allclose(facing.normal_error, [0.2, half_space, np.pi, half_space])
    np.testing.assert_array_equal(facing.approaches, felt.approaches)
    assert facing.facing_approach() is facing
    assert contacts().facing_approach().normal_error.max() < 1.0
