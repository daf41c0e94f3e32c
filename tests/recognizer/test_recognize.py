"""The recogniser as a whole: what a belief holds, and what it promises."""

from __future__ import annotations

import pickle
from dataclasses import FrozenInstanceError, fields

import numpy as np
import pytest
from helpers.beliefs import holder
from helpers.sensing import CUBE, INCH, Touches, exact, feel, move, sense_grid, touch_faces
from oracles.checker import check
from oracles.solids import random_pose
from scipy.spatial.transform import RigidTransform

from palpate.assets import STAND_IN_NAMES
from palpate.envs.library import load_library
from palpate.recognizer import (
    Belief,
    Constraints,
    Contacts,
    Hypothesis,
    Polyhedron,
    Recognizer,
    Search,
    SearchLimits,
)

ROWS = ((np.pi / 12, 0.01), (np.pi / 8, 0.05), (np.pi / 8, 0.1))


@pytest.fixture(scope="module")
def recognizer() -> Recognizer:
    return Recognizer(load_library())


def model_called(recognizer: Recognizer, name: str) -> Polyhedron:
    return next(model for model in recognizer.models if model.name == name)


def errors(model: Polyhedron, pose: RigidTransform, truth: RigidTransform) -> tuple[float, float]:
    """Shift of the centroid and least turn between poses, up to symmetry; metres and radians."""
    shift = np.linalg.norm(pose.apply(model.centroid) - truth.apply(model.centroid))
    between = pose.rotation.as_matrix().T @ truth.rotation.as_matrix()
    traces = np.einsum("ij,sij->s", between, model.symmetries)
    return float(shift), float(np.arccos(np.clip((traces.max() - 1.0) / 2.0, -1.0, 1.0)))


def assert_consistent(belief: Belief, contacts: Contacts, names: tuple[str, ...]) -> None:
    """What holds for every belief, whatever was touched."""
    weights = np.array([hypothesis.weight for hypothesis in belief.hypotheses])
    assert (weights >= 0.0).all()
    assert (np.diff(weights) <= 1e-3 * weights[:-1]).all()  # they are rounded to be put in order
    assert belief.empty == (len(weights) == 0)
    assert belief.empty or weights.sum() == pytest.approx(1.0)
    assert tuple(search.object_name for search in belief.searches) == names
    for search in belief.searches:
        own = [h for h in belief.hypotheses if h.object_name == search.object_name]
        rows = [tuple(row) for h in own for row in h.interpretations.tolist()]
        assert search.hypotheses == len(own)
        # An interpretation may have several components, in one hypothesis or in more.
        assert search.tested >= len(rows) >= len(set(rows)) > 0 or not rows
        assert search.tried > 0 or search.tested == 0
        assert search.nodes > 0 or search.tested == 0
        assert min(search.search_seconds, search.cluster_seconds) >= 0.0
    assert belief.interpretations <= sum(search.tested for search in belief.searches)
    assert belief.complete == all(search.complete for search in belief.searches)
    for hypothesis in belief.hypotheses:
        assert hypothesis.interpretations.shape[1] == len(contacts)
        assert hypothesis.determined == (len(hypothesis.freedoms) == 0)


# The truth


@pytest.mark.parametrize("row", ROWS, ids=lambda row: f"pi:{np.pi / row[0]:.0f}-{row[1]}in")
@pytest.mark.parametrize("name", STAND_IN_NAMES)
def test_the_truth_is_among_the_hypotheses(
    recognizer: Recognizer, name: str, row: tuple[float, float]
) -> None:
    model = model_called(recognizer, name)
    rng = np.random.default_rng([1, STAND_IN_NAMES.index(name), ROWS.index(row)])
    for case in range(8):
        touches = sense_grid(model, rng)
        contacts = feel(touches, rng, row[1] * INCH, row[0], at_bounds=case % 3 == 0)
        belief = recognizer.recognize(contacts)
        assert belief.complete
        assert_consistent(belief, contacts, STAND_IN_NAMES)
        hypothesis = holder(belief, touches.faces, name)
        assert hypothesis is not None, f"case {case}: the truth was lost"
        if hypothesis.determined:
            shift, turn = errors(model, hypothesis.pose, touches.T_world_object)
            assert shift < 3.0 * recognizer.tolerance.distance(model.diameter, row[1] * INCH)
            assert turn < 3.0 * recognizer.tolerance.rotation


@pytest.mark.parametrize("count", [1, 2, 3, 5])
@pytest.mark.parametrize("name", ["housing", "simple-hand"])
def test_the_truth_is_among_the_hypotheses_of_few_contacts(
    recognizer: Recognizer, name: str, count: int
) -> None:
    model, rng = model_called(recognizer, name), np.random.default_rng([2, count])
    alone = Recognizer([model])
    for case in range(3):
        touches = touch_faces(model, rng, rng.integers(model.face_count, size=count).tolist())
        contacts = feel(touches, rng, 0.01 * INCH, np.pi / 12, at_bounds=case == 0)
        belief = alone.recognize(contacts)
        assert_consistent(belief, contacts, (name,))
        assert belief.complete
        assert holder(belief, touches.faces, name) is not None


def test_many_exact_contacts_leave_the_truth_alone(recognizer: Recognizer) -> None:
    rng = np.random.default_rng(3)
    for name in ("housing", "housing-34", "stapler", "complex-hand"):
        model = model_called(recognizer, name)
        touches = touch_faces(model, rng, list(range(model.face_count)))
        belief = recognizer.recognize(exact(touches, 2e-5, 0.01))
        assert belief.unique
        (only,) = belief.hypotheses
        assert only.object_name == name
        assert [tuple(row) for row in only.interpretations.tolist()] == [tuple(touches.faces)]
        shift, turn = errors(model, only.pose, touches.T_world_object)
        assert shift < 1e-6
        assert turn < 1e-5


def test_symmetric_copies_of_a_cube_are_one_hypothesis() -> None:
    rng = np.random.default_rng(4)
    touches = touch_faces(CUBE, rng, [0, 1, 2, 3, 4, 5] * 2)
    contacts = feel(touches, rng, 2e-4, 0.1)
    belief = Recognizer([CUBE]).recognize(contacts)
    assert belief.unique
    (hypothesis,) = belief.hypotheses
    assert len(hypothesis.interpretations) == 24
    assert check(CUBE, hypothesis.pose, contacts, hypothesis.interpretations[0]).passed


def test_moving_the_world_moves_the_belief(recognizer: Recognizer) -> None:
    rng = np.random.default_rng(5)
    model = model_called(recognizer, "housing")
    for _ in range(4):
        touches = sense_grid(model, rng)
        contacts, motion = feel(touches, rng, 0.01 * INCH, np.pi / 12), random_pose(rng)
        before = recognizer.recognize(contacts)
        after = recognizer.recognize(move(motion, contacts))
        assert len(before.hypotheses) == len(after.hypotheses)
        left = list(after.hypotheses)
        for one in before.hypotheses:
            # Those of like weight are put in order by their poses, which a motion changes.
            owner = model_called(recognizer, one.object_name)
            alike = [other for other in left if other.object_name == owner.name]
            moved = motion * one.pose
            other = min(alike, key=lambda other: sum(errors(owner, other.pose, moved)))
            left.remove(other)
            assert other.weight == pytest.approx(one.weight, abs=1e-4)
            if one.determined:
                shift, turn = errors(owner, other.pose, moved)
                assert shift < 1e-5
                assert turn < 1e-4


# What fits nothing


def test_contacts_too_far_apart_for_any_object_leave_an_empty_belief(
    recognizer: Recognizer,
) -> None:
    contacts = Contacts(
        [[0, 0, 0], [10, 0, 0], [0, 10, 0]],
        [[-1, 0, 0], [1, 0, 0], [0, 1, 0]],
        position_error=1e-3,
        normal_error=0.2,
    )
    belief = recognizer.recognize(contacts)
    assert belief.empty
    assert belief.complete
    assert not belief.unique
    assert belief.interpretations == 0
    assert_consistent(belief, contacts, STAND_IN_NAMES)


@pytest.mark.parametrize("name", STAND_IN_NAMES)
def test_an_object_that_is_not_in_the_library_is_recognised_as_none(
    recognizer: Recognizer, name: str
) -> None:
    stranger = model_called(recognizer, name)
    others = Recognizer([model for model in recognizer.models if model is not stranger])
    rng = np.random.default_rng(6)
    for _ in range(3):
        touches = touch_faces(stranger, rng, list(range(stranger.face_count)))
        belief = others.recognize(feel(touches, rng, 0.005 * INCH, np.pi / 30))
        assert belief.empty
        assert belief.complete


def test_a_bound_too_tight_for_the_noise_leaves_an_empty_belief(recognizer: Recognizer) -> None:
    rng = np.random.default_rng(7)
    touches = sense_grid(model_called(recognizer, "housing"), rng)
    felt = feel(touches, rng, 0.1 * INCH, np.pi / 8, at_bounds=True)
    tight = Contacts(felt.positions, felt.normals, position_error=1e-5, normal_error=0.01)
    assert recognizer.recognize(tight).empty


def test_a_contact_more_never_brings_an_object_back(recognizer: Recognizer) -> None:
    rng = np.random.default_rng(8)
    touches = sense_grid(model_called(recognizer, "stapler"), rng)
    contacts = feel(touches, rng, 0.02 * INCH, np.pi / 12)
    before = set(STAND_IN_NAMES)
    for count in range(5, len(contacts) + 1):
        belief = recognizer.recognize(contacts[:count])
        now = {hypothesis.object_name for hypothesis in belief.hypotheses}
        assert "stapler" in now
        assert now <= before
        before = now
    assert before == {"stapler"}


# Order, repetition, immutability


def test_the_order_of_the_contacts_does_not_matter(recognizer: Recognizer) -> None:
    rng = np.random.default_rng(9)
    for name in STAND_IN_NAMES:
        model = model_called(recognizer, name)
        touches = sense_grid(model, rng)
        contacts = feel(touches, rng, 0.01 * INCH, np.pi / 12)
        order = rng.permutation(len(contacts))
        one, other = recognizer.recognize(contacts), recognizer.recognize(contacts[order])
        assert holder(other, touches.faces[order], name) is not None
        assert len(one.hypotheses) == len(other.hypotheses)
        for hypothesis in one.hypotheses:
            twin = holder(other, hypothesis.interpretations[0, order], hypothesis.object_name)
            assert twin is not None
            if hypothesis.determined:
                owner = model_called(recognizer, hypothesis.object_name)
                shift, turn = errors(owner, twin.pose, hypothesis.pose)
                assert shift < recognizer.tolerance.distance(owner.diameter, 0.01 * INCH)
                assert turn < recognizer.tolerance.rotation


def test_the_order_of_the_library_does_not_matter(recognizer: Recognizer) -> None:
    backwards = Recognizer(recognizer.models[::-1])
    rng = np.random.default_rng(10)
    contacts = feel(sense_grid(recognizer.models[0], rng, 8, 12), rng, 0.02 * INCH, np.pi / 10)
    one, other = recognizer.recognize(contacts), backwards.recognize(contacts)

    def summary(belief: Belief) -> list[tuple[str, bytes]]:
        return sorted((h.object_name, h.pose.as_matrix().tobytes()) for h in belief.hypotheses)

    assert summary(one) == summary(other)


def test_recognising_twice_gives_the_same_to_the_bit(recognizer: Recognizer) -> None:
    rng = np.random.default_rng(11)
    for name in STAND_IN_NAMES:
        contacts = feel(
            sense_grid(model_called(recognizer, name), rng, 5, 12), rng, 0.05 * INCH, np.pi / 10
        )
        one, other = recognizer.recognize(contacts), recognizer.recognize(contacts)
        assert len(one.hypotheses) == len(other.hypotheses) > 0
        for a, b in zip(one.hypotheses, other.hypotheses, strict=True):
            assert a.object_name == b.object_name
            assert a.weight == b.weight
            assert a.pose.as_matrix().tobytes() == b.pose.as_matrix().tobytes()
            np.testing.assert_array_equal(a.interpretations, b.interpretations)
            assert a.freedoms.tobytes() == b.freedoms.tobytes()


def test_a_new_recogniser_gives_the_same_to_the_bit(recognizer: Recognizer) -> None:
    rng = np.random.default_rng(12)
    contacts = feel(sense_grid(recognizer.models[2], rng), rng, 0.01 * INCH, np.pi / 12)
    one, other = recognizer.recognize(contacts), Recognizer(load_library()).recognize(contacts)
    assert one.hypotheses
    for a, b in zip(one.hypotheses, other.hypotheses, strict=True):
        assert a.weight == b.weight
        assert a.pose.as_matrix().tobytes() == b.pose.as_matrix().tobytes()


def test_recognising_changes_neither_library_nor_contacts_nor_the_global_generator(
    recognizer: Recognizer,
) -> None:
    def snapshot() -> list[bytes]:
        tables = [recognizer.tables(name) for name in STAND_IN_NAMES]
        return [
            *(getattr(t, field.name).tobytes() for t in tables for field in fields(t)),
            *(model.vertices.tobytes() + model.normals.tobytes() for model in recognizer.models),
            *(getattr(contacts, field.name).tobytes() for field in fields(contacts)),
            pickle.dumps(np.random.get_state()),  # noqa: NPY002  the global state is the point
        ]

    rng = np.random.default_rng(13)
    contacts = feel(sense_grid(recognizer.models[0], rng), rng, 0.05 * INCH, np.pi / 10)
    before = snapshot()
    recognizer.recognize(contacts)
    assert snapshot() == before


def test_results_can_not_be_changed(recognizer: Recognizer) -> None:
    rng = np.random.default_rng(14)
    contacts = feel(sense_grid(recognizer.models[0], rng), rng, 0.01 * INCH, np.pi / 12)
    belief = recognizer.recognize(contacts)
    for thing, name in (
        (belief, "hypotheses"),
        (belief.hypotheses[0], "weight"),
        (belief.searches[0], "complete"),
        (recognizer.tables("housing"), "angle"),
        (recognizer.limits, "budget"),
        (recognizer.models[0], "normals"),
        (contacts, "positions"),
    ):
        with pytest.raises(FrozenInstanceError):
            setattr(thing, name, None)
    assert isinstance(belief.hypotheses, tuple)
    with pytest.raises(ValueError, match="read-only"):
        contacts.positions[0, 0] = 1.0


# Limits


def test_a_search_cut_short_says_so(recognizer: Recognizer) -> None:
    rng = np.random.default_rng(15)
    model = model_called(recognizer, "housing")
    touches = touch_faces(model, rng, [0, 1, 2])
    contacts = feel(touches, rng, 0.05 * INCH, np.pi / 8)
    whole = Recognizer([model]).recognize(contacts)
    assert whole.complete
    assert whole.interpretations > 3
    short = Recognizer([model], limits=SearchLimits(budget=3)).recognize(contacts)
    assert not short.complete
    assert not short.unique
    assert short.interpretations <= 3
    assert_consistent(short, contacts, ("housing",))


def test_every_choice_of_constraints_keeps_the_truth() -> None:
    rng = np.random.default_rng(17)
    touches = touch_faces(CUBE, rng, [0, 1, 2, 3, 4])
    contacts = feel(touches, rng, 5e-4, 0.2, at_bounds=True)
    for k in range(16):
        chosen = Constraints(
            distance=bool(k & 1), angle=bool(k & 2), component=bool(k & 4), tilt=bool(k & 8)
        )
        belief = Recognizer([CUBE], constraints=chosen).recognize(contacts)
        assert holder(belief, touches.faces, "cube") is not None


@pytest.mark.parametrize("name", ["budget", "nodes"])
def test_a_limit_below_one_is_refused(name: str) -> None:
    with pytest.raises(ValueError, match=rf"{name} is 0"):
        SearchLimits(**{name: 0})


def test_a_library_without_models_is_refused() -> None:
    with pytest.raises(ValueError, match="at least one model"):
        Recognizer([])


def test_two_models_of_one_name_are_refused() -> None:
    with pytest.raises(ValueError, match="'cube'"):
        Recognizer([CUBE, CUBE])


def test_recognising_without_contacts_is_refused(recognizer: Recognizer) -> None:
    with pytest.raises(ValueError, match="no contacts"):
        recognizer.recognize(Contacts.none())


def test_asking_for_the_tables_of_an_unknown_model_names_the_known_ones(
    recognizer: Recognizer,
) -> None:
    with pytest.raises(ValueError, match=r"'gator'.*housing, housing-34, stapler"):
        recognizer.tables("gator")
    assert recognizer.tables("stapler").face_count == 34


def test_a_recogniser_takes_any_iterable_of_models() -> None:
    assert Recognizer(model for model in [CUBE]).models == (CUBE,)


# Uniqueness


def hand_made(count: int, *, determined: bool, complete: bool) -> Belief:
    freedoms = np.zeros((0, 6)) if determined else np.eye(6)[:1]
    hypotheses = tuple(
        Hypothesis(
            f"object {k}",
            np.eye(4),
            1 / count,
            np.zeros((2, 3), np.int32),
            freedoms,
            np.eye(6),
        )
        for k in range(count)
    )
    searches = tuple(
        Search(f"object {k}", 6, 2, 2, 1, complete or k != 1, 0.0, 0.0) for k in range(2)
    )
    known = Recognizer([CUBE])
    return Belief(hypotheses, searches, Contacts.none(), known.library, known.tolerance)


@pytest.mark.parametrize(
    ("count", "determined", "complete", "unique"),
    [
        (1, True, True, True),
        (1, False, True, False),
        (1, True, False, False),
        (2, True, True, False),
        (0, True, True, False),
    ],
)
def test_unique_means_one_hypothesis_with_a_fixed_pose_and_a_whole_search(
    count: int, determined: bool, complete: bool, unique: bool
) -> None:
    belief = hand_made(count, determined=determined, complete=complete)
    assert belief.unique == unique
    assert belief.complete == complete
    assert belief.empty == (count == 0)
    assert belief.interpretations == 2 * count


def test_one_face_of_a_cube_is_one_hypothesis_and_not_unique() -> None:
    rng = np.random.default_rng(18)
    touches: Touches = touch_faces(CUBE, rng, [0] * 6)
    belief = Recognizer([CUBE]).recognize(exact(touches))
    assert not belief.unique
    assert not belief.hypotheses[0].determined
