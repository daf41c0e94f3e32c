"""Recognition in the plane: the truth is never lost, and what is left is right."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.constraints import compiled_masks
from helpers.planar_search import angles_of, search
from oracles.outlines import (
    INCH,
    SHAPES,
    Felt,
    entry,
    feel,
    felt_outline,
    meets,
    moved,
    rotation,
    wrapped,
)
from oracles.solids import as_set
from scipy.spatial.distance import pdist
from scipy.spatial.transform import RigidTransform, Rotation

from palpate.assets.planar import PLANAR_NAMES
from palpate.recognizer import Constraints, Contacts, PoseTolerance, SearchLimits
from palpate.recognizer.beliefs.model_search import search_model, span_hypothesis
from palpate.recognizer.models.polygon import Polygon
from palpate.recognizer.poses.entry import OutlineEntry
from palpate.recognizer.tree.planar_mask_kernels import pair_masks

ALL = Constraints(tilt=True)
every_shape = pytest.mark.parametrize("name", SHAPES)


def assert_right(name: str, case: Felt) -> None:
    """The truth survives every step, and whatever survives is right."""
    model, contacts = entry(name).model, case.contacts
    rows = np.arange(len(contacts))
    allowed = compiled_masks(pair_masks, entry(name).tables, contacts, ALL)[
        rows[:, None], rows, case.edges[:, None], case.edges
    ]
    assert allowed[np.triu_indices(len(rows), 1)].all()
    hypotheses, log_weights, found = search(name, contacts)
    assert found.complete
    assert len(log_weights) == len(hypotheses) == found.hypotheses > 0
    holding = [h for h in hypotheses if (h.interpretations == case.edges).all(axis=1).any()]
    truth = lifted(case.angle, case.shift)
    ways = np.array([apart(model, one.pose, truth) for one in holding])
    reaches = np.array([(one.farthest_turn, one.farthest_shift) for one in holding])
    assert (ways <= reaches + 1e-9 * np.array([1.0, model.diameter])).all(axis=1).any()
    for hypothesis in hypotheses:
        angle = angles_of(hypothesis.T_world_object[:3, :3])
        shift = hypothesis.T_world_object[:3, 3]
        assert shift[2] == 0.0
        if hypothesis.proven:
            assert meets(model, contacts, hypothesis.interpretations[0], angle, shift[:2])
        gram = hypothesis.freedoms @ hypothesis.freedoms.T
        np.testing.assert_allclose(gram, np.eye(len(gram)), atol=1e-9)
        assert not hypothesis.freedoms[:, [0, 1, 5]].any()
        assert (
            np.unique(hypothesis.interpretations, axis=0).shape == hypothesis.interpretations.shape
        )


ROWS = [(0.01, np.pi / 15), (0.05, np.pi / 10), (0.1, np.pi / 8)]
"""Bounds on positions (inches) and normals (radians), as in the memo's tables."""


def outline_campaign(name: str, missing: float, cases: int, seed: int) -> None:
    """Cases over the rows; those without any normal begin at 5 contacts, to be quick."""
    model, rng = entry(name).model, np.random.default_rng([seed, int(10 * missing), len(name)])
    size = 1.0 if name in PLANAR_NAMES else model.diameter / (12 * INCH)
    for number in range(cases):
        inches, normal = ROWS[number % 3]
        count = int(rng.integers(5 if missing == 1.0 else 3, 13))
        each = rng.uniform(0.5, 1.0, count) if number % 5 == 0 else 1.0
        case = feel(
            model,
            count,
            rng,
            position_error=inches * INCH * size * each,
            normal_error=normal * each,
            at_bounds=number % 2 == 0,
            missing=missing,
            awkward=number % 7 == 0,
        )
        assert_right(name, case)


@pytest.mark.parametrize("missing", [0.0, 0.3, 1.0])
@every_shape
def test_the_truth_is_never_lost_and_every_witness_meets_its_bounds(name, missing):
    """2100 cases over all."""
    outline_campaign(name, missing, cases=100, seed=1)


@pytest.mark.slow
@pytest.mark.parametrize("missing", [0.0, 0.3, 1.0])
@every_shape
def test_the_truth_is_never_lost_in_a_long_campaign(name, missing):
    outline_campaign(name, missing, cases=2000, seed=2)


def lifted(angle: float, shift) -> RigidTransform:
    """A pose of the plane as one in space."""
    turn = Rotation.from_rotvec([0.0, 0.0, angle])
    return RigidTransform.from_components(np.append(shift, 0.0), turn)


def apart(model: Polygon, one, other) -> tuple[float, float]:
    """Angle between two poses, up to symmetries, and distance of their centroids."""
    between = (one.rotation.inv() * other.rotation).as_rotvec()[2]
    own = np.arctan2(model.symmetries[:, 1, 0], model.symmetries[:, 0, 0])
    centre = np.append(model.centroid, 0.0)
    shift = np.linalg.norm(one.apply(centre) - other.apply(centre))
    return float(np.abs(wrapped(between - own)).min()), float(shift)


@every_shape
def test_moving_the_contacts_moves_the_poses(name):
    model = entry(name).model
    compared = 0
    for seed in range(6):
        case = felt_outline(name, 8, seed, dist=0.01, normal=0.2, missing=0.2)
        motion = lifted(2.0, [0.3, -0.2])
        here, _, _ = search(name, case.contacts)
        there, _, _ = search(name, moved(case.contacts, 2.0, [0.3, -0.2]))
        images = {frozenset(as_set(h.interpretations)): h for h in there}
        assert len(here) == len(there) == len(images)
        for one in here:
            image = images[frozenset(as_set(one.interpretations))]
            assert len(image.freedoms) == len(one.freedoms)
            if one.determined:
                turn, shift = apart(model, motion * one.pose, image.pose)
                assert turn < 1e-3
                assert shift < 1e-3 * model.diameter
                compared += 1
    assert compared > 0


@pytest.mark.parametrize(("name", "order"), [("square", 4), ("hexagon", 6), ("wrench", 2)])
def test_symmetric_outlines_have_one_hypothesis_with_all_their_interpretations(name, order):
    model = entry(name).model
    for seed in range(8):
        rng = np.random.default_rng(seed)
        edges = np.r_[np.arange(model.face_count), rng.integers(model.face_count, size=4)]
        points = model.segments[edges, 0] * 0.8 + model.segments[edges, 1] * 0.2
        angle = rng.uniform(-np.pi, np.pi)
        contacts = Contacts(
            points @ rotation(angle).T,
            model.normals[edges] @ rotation(angle).T,
            position_error=0.01 * model.lengths.min(),
            normal_error=0.2,
        )
        hypotheses, _, found = search(name, contacts)
        assert len(hypotheses) == 1
        assert hypotheses[0].determined
        assert found.tested == order
        places = model.face_count // order
        expected = {tuple(((edges + k * places) % model.face_count).tolist()) for k in range(order)}
        assert as_set(hypotheses[0].interpretations) == expected


def test_determined_poses_are_near_the_truth():
    turns, shifts = [], []
    for name in PLANAR_NAMES:
        model, rng = entry(name).model, np.random.default_rng(7)
        for _ in range(20):
            case = feel(model, 12, rng, position_error=0.01 * INCH, normal_error=np.pi / 12)
            truth = lifted(case.angle, case.shift)
            for hypothesis in search(name, case.contacts)[0]:
                holds = (hypothesis.interpretations == case.edges).all(axis=1).any()
                if holds and hypothesis.determined:
                    turn, shift = apart(model, hypothesis.pose, truth)
                    turns.append(turn)
                    shifts.append(shift / INCH)
    assert len(turns) > 50
    assert np.degrees(np.median(turns)) < 0.1
    assert np.degrees(np.max(turns)) < 1.0
    assert np.median(shifts) < 0.01
    assert np.max(shifts) < 0.05


def test_what_fits_no_outline_has_no_hypothesis():
    size = entry("gator").model.diameter
    apart = Contacts([[0, 0], [2 * size, 0], [0, size]], position_error=1e-3)
    hypotheses, log_weights, found = search("gator", apart)
    assert hypotheses == []
    assert log_weights.shape == (0,)
    assert (found.tried, found.tested, found.hypotheses) == (0, 0, 0)
    assert found.complete


def test_a_spent_budget_is_reported():
    case = felt_outline("hand", 4, 1, dist=0.05, missing=1.0)
    assert search("hand", case.contacts)[2].complete
    assert not search("hand", case.contacts, budget=5)[2].complete


def test_one_contact_leaves_every_edge_and_two_freedoms_at_least():
    case = felt_outline("gator", 1, 1, dist=0.002, normal=0.05)
    hypotheses, _, found = search("gator", case.contacts)
    assert found.tested == 50
    assert {h.freedoms.shape for h in hypotheses} == {(2, 6)}  # a slide and a turn
    blind, _, _ = search("gator", felt_outline("gator", 1, 1, missing=1.0).contacts)
    assert {h.freedoms.shape for h in blind} == {(2, 6)}


def test_points_beside_straightened_edges_are_contacts_still():
    """A corner that was left out lies 0.8e-6 of the diameter off its edge, and is touched."""
    corners = np.array([[0, 0], [0.5, -0.9e-6], [1, 0], [1, 1], [0, 1]])
    model = Polygon.from_corners(corners, name="square")
    assert model.face_count == 4
    assert model.straightness == pytest.approx(0.9e-6)
    touched = np.array([[0.5, -0.9e-6], [0.5, 1.0], [0.0, 0.5], [1.0, 0.5], [0.1, 1.0]])
    touched[0, 1] -= 0.99e-7
    touched[1:, 1] += [0.99e-7, 0, 0, 0.99e-7]
    normals = [[0, -1], [0, 1], [-1, 0], [1, 0], [0, 1]]
    contacts = Contacts(touched, normals, position_error=1e-7, normal_error=0.01)
    hypotheses, _, _ = search_model(
        OutlineEntry.of(model), contacts, Constraints(), PoseTolerance(), SearchLimits()
    )
    assert len(hypotheses) == 1


def test_a_family_spans_the_whole_edge_and_stays_within_bounds():
    """Two contacts near each other on one long edge: the outline may slide along it."""
    name, edges = "l-shape", np.array([0, 0], np.int32)
    model = entry(name).model
    angle = 0.5
    points = np.array([[1.0, 0.0], [1.4, 0.0]]) @ rotation(angle).T
    contacts = Contacts(
        points,
        np.tile([0.0, -1.0], (2, 1)) @ rotation(angle).T,
        position_error=0.01,
        normal_error=0.02,
    )
    hypotheses, _, _ = search(name, contacts)
    (family,) = [h for h in hypotheses if (h.interpretations == edges).all(axis=1).any()]
    assert not family.determined
    poses = span_hypothesis(entry(name), family, contacts, PoseTolerance(), 2000)
    np.testing.assert_allclose(poses[0].as_matrix(), family.pose.as_matrix())
    angles = poses.rotation.as_rotvec()[:, 2]
    shifts = np.asarray(poses.translation)[:, :2]
    for a, t in zip(angles, shifts, strict=True):
        assert meets(model, contacts, edges, a, t)
    slides = shifts @ rotation(angle)[:, 0]
    # The contacts cover 0.4 of the edge's 3; the outline slides over the rest.
    assert np.ptp(slides) > 2.4
    places = np.column_stack([angles * model.diameter / 2, shifts])
    assert pdist(places).min() > 1e-3


def test_a_determined_hypothesis_spans_one_pose():
    case = felt_outline("gator", 12, 3, dist=1e-3, normal=0.1)
    hypotheses, _, _ = search("gator", case.contacts)
    assert hypotheses[0].determined
    poses = span_hypothesis(entry("gator"), hypotheses[0], case.contacts, PoseTolerance(), 256)
    np.testing.assert_allclose(poses.as_matrix(), hypotheses[0].pose.as_matrix()[None])
