"""What a belief says of itself."""

from __future__ import annotations

import json

import numpy as np
import pytest
from helpers.sensing import SMALL, feel, touch_faces

from palpate.recognizer import Belief, Contacts, Recognizer

FACES = [0]


@pytest.fixture(scope="module")
def belief() -> Belief:
    """Of one contact with an L-block, of a library of three solids."""
    touches = touch_faces(SMALL["L-block"], np.random.default_rng(3), FACES)
    contacts = feel(touches, np.random.default_rng(4), 5e-4, 0.3)
    return Recognizer(list(SMALL.values())).recognize(contacts)


@pytest.fixture(scope="module")
def nothing() -> Belief:
    """Of contacts farther apart than any solid is wide."""
    far = Contacts(np.diag([1.0, 2.0, 3.0]), np.eye(3), position_error=1e-3, normal_error=0.1)
    return Recognizer(list(SMALL.values())).recognize(far)


def test_it_is_as_long_as_it_has_hypotheses_and_goes_through_them(
    belief: Belief, nothing: Belief
) -> None:
    assert len(belief) == len(belief.hypotheses) > 1
    assert list(belief) == list(belief.hypotheses)
    assert len(nothing) == 0
    assert list(nothing) == []


def test_objects_have_the_weights_of_their_hypotheses(belief: Belief, nothing: Belief) -> None:
    weights = belief.objects()
    assert sum(weights.values()) == pytest.approx(1.0)
    assert list(weights.values()) == sorted(weights.values(), reverse=True)
    for name, weight in weights.items():
        own = [h.weight for h in belief.hypotheses if h.object_name == name]
        assert weight == pytest.approx(sum(own))
    assert nothing.objects() == {}


def test_entropy_is_that_of_the_weights(belief: Belief, nothing: Belief) -> None:
    weights = np.array([h.weight for h in belief.hypotheses])
    assert belief.entropy() == pytest.approx(-(weights * np.log2(weights)).sum())
    assert 0.0 <= belief.entropy() <= np.log2(len(belief))
    assert nothing.entropy() == 0.0


def test_it_goes_into_json_and_says_there_what_it_says(belief: Belief, nothing: Belief) -> None:
    read = json.loads(json.dumps(belief.to_dict()))
    assert (read["complete"], read["unique"]) == (belief.complete, belief.unique)
    assert read["contacts"] == len(FACES)
    for one, hypothesis in zip(read["hypotheses"], belief.hypotheses, strict=True):
        np.testing.assert_array_equal(one["T_world_object"], hypothesis.T_world_object)
        assert one["weight"] == hypothesis.weight
        assert one["farthest_turn"] == hypothesis.farthest_turn
    assert json.loads(json.dumps(nothing.to_dict()))["hypotheses"] == []


def test_printed_it_is_a_line(belief: Belief, nothing: Belief) -> None:
    assert "L-block" in repr(belief)
    assert f"{len(belief)} hypotheses" in repr(belief)
    assert "0 hypotheses" in repr(nothing)
    for text in (repr(belief), repr(nothing), *map(repr, belief.hypotheses)):
        assert "\n" not in text
        assert len(text) < 200
