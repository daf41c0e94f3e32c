"""Readings of a pose: what contacts miss of their features and cones, against plain numpy."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from helpers.fitting import Fitter
from helpers.sensing import CUBE
from numpy.typing import NDArray
from oracles.checker import check
from oracles.geometry import angle_between, cone_angles, triangle_distances
from oracles.samples import direction, draw, read_at, start_near
from scipy.spatial.transform import RigidTransform, Rotation

from palpate.recognizer import Contacts
from palpate.recognizer.contacts.reading_kernels import (
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
from palpate.recognizer.models.features import all_features
from palpate.recognizer.models.polygon_kernels import CORNER, EDGE, INSIDE, nearest_in_polygon

Floats = NDArray[np.float64]


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
    poses = Fitter(CUBE, features).run(np.full((1, 2), edge, np.int32), contacts)
    assert len(poses) == 0


def test_a_pose_reads_as_the_checker_reads_it() -> None:
    rng = np.random.default_rng(3)
    for _ in range(200):
        sample = draw(rng)
        _, rotation, translation = start_near(sample, rng, rng.choice([0.1, 1.0]))
        space, worst = read_at(sample, rotation, translation)
        count, faces, _, model, contacts = sample.question
        farthest, _ = worst_on_pieces(
            *(count, faces, faces, space.x, model, contacts, space.readings)
        )
        pose = RigidTransform.from_components(translation, Rotation.from_matrix(rotation))
        found = check(sample.model, pose, sample.contacts, sample.faces, features=sample.features)
        shares = found.distances / sample.contacts.position_error
        assert farthest == pytest.approx(shares.max(), rel=1e-6, abs=1e-6)
        assert max(worst, farthest) <= 1.0 or not found.within.all()
        # The hulls of concave faces hold more than the faces do.
        angles, bounds = found.angles, sample.contacts.normal_error
        chords = np.sin(0.5 * angles) / np.sin(0.5 * bounds)
        assert worst <= max(shares.max(), chords.max(), (angles / bounds).max()) * (1.0 + 1e-6)


def test_bounds_are_all_met_where_no_reading_is_above_its_own() -> None:
    rng, met, cases = np.random.default_rng(31), 0, 1500
    for _ in range(cases):
        sample = draw(rng)
        _, rotation, translation = start_near(sample, rng, rng.choice([1e-9, 0.01, 0.3]))
        translation = sample.true_translation + rng.normal(size=3) * rng.choice([0.0, 1e-3])
        space, worst = read_at(sample, rotation, translation)
        count, faces, targets, model, contacts = sample.question
        x, u, spare = space.x, space.u, np.empty(3)
        exact, _ = worst_on_pieces(count, faces, targets, x, model, contacts, space.readings)
        within = meets_all(count, faces, x, u, model, contacts, 1e-9, spare)
        assert within == (max(worst, exact) <= 1.0 + 1e-9)
        met += within
    assert 0.2 * cases < met < 0.8 * cases
