"""Contacts whose probe can tell faces, edges and vertices apart."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from helpers.beliefs import interpretations_of
from numpy.typing import NDArray

from palpate.recognizer import (
    ANYTHING,
    EDGE,
    FACE,
    VERTEX,
    Contacts,
    Polyhedron,
    Recognizer,
    SupportPlane,
)
from palpate.scripts.lab.soundness.touch import leaned, random_pose, shifted, touch_features

POSITION_ERROR, NORMAL_ERROR = 5e-4, 0.1
WEDGE = Polyhedron.from_mesh(
    trimesh.convex.convex_hull(
        np.array([[0, 0, 0], [60, 0, 0], [60, 40, 0], [0, 40, 0], [0, 0, 25], [0, 40, 25]]) * 1e-3
    ),
    name="wedge",
)
CUBE = Polyhedron.from_mesh(trimesh.creation.box((0.05, 0.05, 0.05)), name="cube")


def felt_with_kinds(
    model: Polyhedron, count: int, sharp: int, rng: np.random.Generator
) -> tuple[Contacts, NDArray[np.int32]]:
    """Contacts of a solid, some on edges and vertices, with their kinds; and what each is on."""
    features = Recognizer([model], features="all").features(model.name)
    touched = touch_features(model, features, random_pose(rng), count, sharp, rng)
    ends = np.array([features.face_count, features.face_count + features.edge_count])
    bound = np.full(count, POSITION_ERROR)
    contacts = Contacts(
        shifted(rng, touched.points, bound, False),
        leaned(rng, touched.normals, np.full(count, NORMAL_ERROR), False),
        position_error=POSITION_ERROR,
        normal_error=NORMAL_ERROR,
        kinds=FACE + np.searchsorted(ends, touched.features, side="right"),
    )
    return contacts, touched.features


def without_kinds(contacts: Contacts) -> Contacts:
    return Contacts(
        contacts.positions,
        contacts.normals,
        position_error=contacts.position_error,
        normal_error=contacts.normal_error,
    )


def found_by(recognizer: Recognizer, contacts: Contacts) -> set[tuple[int, ...]]:
    belief = recognizer.recognize(contacts)
    assert belief.complete
    return interpretations_of(belief)


@pytest.mark.parametrize("model", [WEDGE, CUBE], ids=lambda model: model.name)
def test_kinds_leave_the_interpretations_that_agree_with_them(model: Polyhedron) -> None:
    recognizer = Recognizer([model], features="all")
    features = recognizer.features(model.name)
    ends = np.array([features.face_count, features.face_count + features.edge_count])
    rng = np.random.default_rng(3)
    fewer = 0
    for _ in range(12):
        contacts, truth = felt_with_kinds(model, 4, int(rng.integers(3)), rng)
        everything = found_by(recognizer, without_kinds(contacts))
        agreeing = {
            row
            for row in everything
            if np.array_equal(FACE + np.searchsorted(ends, row, side="right"), contacts.kinds)
        }
        found = found_by(recognizer, contacts)
        assert tuple(map(int, truth)) in found
        # The symmetric solid is searched from one feature of each orbit, and spread out again.
        assert found == agreeing
        fewer += len(found) < len(everything)
    assert fewer > 6


def test_the_truth_is_kept_whatever_was_touched() -> None:
    rng = np.random.default_rng(4)
    recognizer = Recognizer([WEDGE], features="all")
    for _ in range(150):
        contacts, truth = felt_with_kinds(WEDGE, int(rng.integers(3, 9)), int(rng.integers(4)), rng)
        assert tuple(map(int, truth)) in found_by(recognizer, contacts)


def test_further_contacts_of_known_kinds_extend_a_belief() -> None:
    rng = np.random.default_rng(5)
    recognizer = Recognizer([WEDGE], features="all")
    for _ in range(20):
        contacts, _ = felt_with_kinds(WEDGE, 7, 2, rng)
        first = recognizer.recognize(contacts[slice(0, 4)])
        after = recognizer.update(first, contacts[slice(4, None)])
        assert interpretations_of(after) == found_by(recognizer, contacts)


def test_kinds_hold_for_an_object_that_stands_on_a_plane_too() -> None:
    recognizer = Recognizer([CUBE], features="all")
    belief = recognizer.recognize(
        Contacts(
            [[0.025, 0.0, 0.03], [0.0, 0.025, 0.05]],
            [[1.0, 0.0, 0.0], [0.0, np.sqrt(0.5), np.sqrt(0.5)]],
            position_error=POSITION_ERROR,
            normal_error=NORMAL_ERROR,
            kinds=[FACE, EDGE],
        ),
        support=SupportPlane(error=1e-4, resting=True),
    )
    features = recognizer.features("cube")
    rows = np.concatenate([h.interpretations for h in belief.hypotheses])
    assert len(rows)
    assert (rows[:, 0] < 6).all()
    assert (rows[:, 1] >= 6).all()
    assert (rows[:, 1] < 6 + features.edge_count).all()


def test_a_recogniser_of_faces_alone_refuses_a_contact_on_an_edge() -> None:
    contacts = Contacts([[0, 0, 0]], [[0, 0, 1]], position_error=1, normal_error=1, kinds=[VERTEX])
    with pytest.raises(ValueError, match="contact 0 is on an edge or a vertex"):
        Recognizer([CUBE]).recognize(contacts)


@pytest.mark.parametrize("kinds", [4, [FACE, -1], [FACE] * 3, ["edge", "face"]])
def test_kinds_that_there_are_not_are_refused(kinds: object) -> None:
    with pytest.raises(ValueError, match="kinds"):
        Contacts(np.zeros((2, 3)), position_error=1.0, kinds=kinds)  # type: ignore[arg-type]


def test_kinds_travel_with_their_contacts() -> None:
    some = Contacts(np.zeros((2, 3)), position_error=1.0, kinds=[EDGE, FACE])
    none = Contacts(np.zeros((1, 3)), position_error=1.0)
    assert some[[1]].kinds.tolist() == [FACE]
    assert Contacts.join([none, some]).kinds.tolist() == [ANYTHING, EDGE, FACE]
    assert none.kinds.dtype == np.int8
