"""The model test in the plane: three degrees of freedom, edges for faces (memo, Section 4.1)."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from oracles.geometry import segment_distances
from oracles.outlines import (
    SHAPES,
    SMALL,
    descend,
    entry,
    excess_grid,
    feel,
    felt_outline,
    meets,
    moved,
    place_bracket,
    regular,
    rotation,
    turned,
    within_arcs,
    wrapped,
)
from oracles.solids import as_set

from palpate.recognizer import Contacts
from palpate.recognizer.models.polygon import Polygon
from palpate.recognizer.poses.planar.exchange_kernels import (
    EXCLUDED,
    FOUND,
    excluded_arc,
    least_excess,
    start_exchange,
)
from palpate.recognizer.poses.planar.motion_kernels import assemble, fit
from palpate.recognizer.poses.planar.pose import PlanarModelTest, _readings
from palpate.recognizer.poses.planar.search_kernels import allowed_rotations
from palpate.recognizer.tree.tree import prune

every_shape = pytest.mark.parametrize("name", SHAPES)
small_shape = pytest.mark.parametrize("name", SMALL)


@every_shape
def test_the_convex_problem_at_one_angle_is_that_of_scipys_linear_program(name):
    model, rng = entry(name).model, np.random.default_rng(5)
    outline = PlanarModelTest(model)._outline
    basis, bounds, weights, y = np.empty(3, np.int64), np.empty((3, 3)), np.empty(3), np.empty(2)
    outcomes = []
    for seed in range(24):
        case = felt_outline(name, int(rng.integers(2, 7)), seed, dist=10 ** rng.uniform(-3, -1))
        contacts, edges = case.contacts, case.edges
        if seed % 2:
            edges = rng.integers(model.face_count, size=len(edges))
        arms = contacts.positions - contacts.positions.mean(axis=0)
        start_exchange(edges[0], contacts.position_error[0], outline, basis, bounds)
        angle = case.angle + (0.0 if seed % 3 == 0 else rng.uniform(-0.3, 0.3))
        outcome = least_excess(
            angle, edges, arms, contacts.position_error, outline, 0.0, basis, bounds, weights, y
        )
        lower, upper = place_bracket(model, contacts, edges, angle)
        slack = 1e-9 * model.diameter
        outcomes.append(outcome)
        if outcome == FOUND:
            assert lower <= slack
            placed = y + arms @ rotation(angle) + model.centroid
            off = segment_distances(placed, model.segments[edges])
            assert (off <= contacts.position_error * (1 + 1e-8)).all()
            continue
        assert outcome == EXCLUDED
        assert upper >= -slack
        middle, half = excluded_arc(arms, 10 * model.diameter, slack, basis, bounds, weights)
        assert np.abs(wrapped(angle - middle)) < half
        for other in middle + min(half, np.pi) * rng.uniform(-1, 1, 2):
            # None of these angles allows any shift.
            assert place_bracket(model, contacts, edges, other)[1] >= -slack
    assert 6 <= outcomes.count(FOUND) <= 18


def test_the_angles_that_normals_allow_are_those_of_every_cone():
    """On a grid of angles, for narrow cones and for cones of more than half a turn."""
    outline = entry("l-shape").test._outline
    angles = np.linspace(-np.pi, np.pi, 2001)
    pieces = set()
    for seed in range(200):
        rng = np.random.default_rng(seed)
        count = int(rng.integers(1, 5))
        directions = rng.uniform(-np.pi, np.pi, count)
        cones = rng.choice([rng.uniform(0.1, 3.1), 2.5, np.pi], count)
        edges = rng.integers(6, size=count)
        readings = (np.zeros((count, 2)), directions, np.ones(count), cones)
        arcs = np.full((count + 1, 2), np.nan)
        found = allowed_rotations(edges, readings, outline, arcs)
        off = np.abs(wrapped(directions - outline[3][edges] - angles[:, None])) - cones
        expected = np.all(off <= 0.0, axis=1)
        clear = np.all(np.abs(off) > 1e-8, axis=1)
        middles, halves = arcs[:found].mean(axis=1), np.diff(arcs[:found])[:, 0] / 2
        allowed = np.any(np.abs(wrapped(angles[:, None] - middles)) <= halves, axis=1)
        np.testing.assert_array_equal(allowed[clear], expected[clear])
        assert (halves >= 0.0).all()
        pieces.add(found)
    assert {0, 1, 2} <= pieces


@pytest.mark.parametrize("missing", [0.0, 0.4, 1.0])
@small_shape
def test_verdicts_on_all_assignments_are_those_of_a_grid_of_poses(name, missing):
    """Feasible where a pose of a grid is; not where none is by more than its spacing.

    Between the two: no descent of scipy's from the best grid poses finds what was rejected.
    """
    model, test = entry(name).model, entry(name).test
    rng = np.random.default_rng(3)
    accepted = rejected = between = 0
    for seed in range(3):
        case = felt_outline(name, 3 + seed % 2, seed, dist=0.04, missing=missing)
        contacts, count = case.contacts, len(case.edges)
        leaves = prune(entry(name).tables, contacts).faces
        leaves = rng.permutation(leaves)[:12].astype(np.int32)
        anything = rng.integers(model.face_count, size=(12, count), dtype=np.int32)
        rows = np.unique(np.concatenate([leaves, anything, case.edges[None]]), axis=0)
        poses = test.run(rows, contacts)
        kept = as_set(test.prune(rows, contacts))
        assert as_set(poses.faces) == kept
        assert poses.proven.all()
        for edges in rows:
            lower, upper, starts = excess_grid(model, contacts, edges)
            alive = tuple(edges.tolist()) in kept
            if upper <= 0.0:
                assert alive
            elif lower > 0.0:
                assert not alive
            else:
                between += 1
                if not alive:
                    # 1e-6: what the minimiser puts down to rounding.
                    assert min(descend(model, contacts, edges, s) for s in starts) > -1e-6
            accepted += alive
            rejected += not alive
    assert accepted > 4
    assert rejected > 4
    assert between < 0.6 * (accepted + rejected)


@every_shape
def test_every_survivor_of_the_model_test_meets_its_bounds(name):
    model, test, rng = entry(name).model, entry(name).test, np.random.default_rng(8)
    survivors = 0
    for seed in range(12):
        case = felt_outline(name, int(rng.integers(2, 6)), seed, dist=0.02, missing=0.3)
        rows = prune(entry(name).tables, case.contacts, budget=3000).faces
        poses = test.run(rows, case.contacts)
        assert poses.proven.all()
        assert poses.interpretations <= len(poses)
        assert (poses.arcs[:, 0] - 1e-9 <= poses.angles).all()
        assert (poses.angles <= poses.arcs[:, 1] + 1e-9).all()
        order = np.unique(poses.faces, axis=0, return_index=True)[1]
        for row in rng.permutation(len(poses))[:20]:
            angle, shift = poses.angles[row], poses.translations[row]
            assert meets(model, case.contacts, poses.faces[row], angle, shift)
            assert within_arcs(float(angle), poses.arcs[row : row + 1])
            assert -np.pi <= angle <= np.pi
        survivors += len(order)
    assert survivors > 12


def test_many_interpretations_at_once_have_the_poses_of_each_alone():
    test, contacts = (
        entry("gator").test,
        felt_outline("gator", 2, 2, dist=0.002, missing=1.0).contacts,
    )
    rows = prune(entry("gator").tables, contacts).faces
    together = test.run(rows, contacts)
    # More poses than interpretations, and so than there was room for at first.
    assert len(together) > len(rows) > 64
    alone = [test.run(row[None], contacts) for row in rows]
    for field in dataclasses.fields(together):
        parts = np.concatenate([getattr(poses, field.name) for poses in alone])
        np.testing.assert_array_equal(getattr(together, field.name), parts)


def test_bounds_met_at_one_pose_only_are_met():
    """Two contacts a square's diagonal apart and both bounds, all spent: one pose is left."""
    test, delta = entry("square").test, 0.01
    out = np.array([1.0, 1.0]) / np.sqrt(2.0)
    contacts = Contacts(
        [-delta * out, [1, 1] + delta * out],
        [turned(np.array([[0.0, -1.0]]), 0.1)[0], turned(np.array([[0.0, 1.0]]), -0.1)[0]],
        position_error=delta,
        normal_error=0.1,
    )
    poses = test.run(np.array([[0, 2]], np.int32), contacts)
    assert len(poses) == 1
    assert within_arcs(0.0, poses.arcs)
    assert np.diff(poses.arcs)[0, 0] < 1e-4
    spread = np.array(contacts.positions) + 1e-6 * np.array([-out, out])
    apart = Contacts(
        spread, contacts.normals, position_error=delta, normal_error=contacts.normal_error
    )
    assert len(test.run(np.array([[0, 2]], np.int32), apart)) == 0


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("dist", [1e-6, 1e-3, 0.3])
def test_scale_and_tight_and_wide_bounds_change_nothing(scale, dist):
    model = Polygon.from_corners(scale * entry("l-shape").model.corners, name="l")
    test, rng = PlanarModelTest(model), np.random.default_rng(4)
    for number in range(30):
        case = feel(
            model,
            int(rng.integers(1, 8)),
            rng,
            position_error=dist * model.diameter,
            normal_error=10 ** rng.uniform(-4, 0),
            at_bounds=number % 2 == 0,
            missing=0.2,
        )
        poses = test.run(case.edges[None], case.contacts)
        assert within_arcs(case.angle, poses.arcs)
        for row in np.flatnonzero(poses.proven):
            angle, shift = poses.angles[row], poses.translations[row]
            assert meets(model, case.contacts, case.edges, angle, shift)
        assert poses.proven.all()


def test_one_interpretation_may_have_separate_poses():
    """Without normals: a triangle on three points turns from one solution into another.

    Points ``r n + s t`` on the sides of an equilateral triangle of inradius r stay on them when it
    turns by an angle a with ``r cos a - s sin a = r``: 0 or ``-2 atan(s / r)``.
    """
    model = Polygon.from_corners(2.0 * regular(3), name="even")
    points = model.normals + 0.4 * turned(model.normals, np.pi / 2)
    contacts = Contacts(points, position_error=0.01)
    poses = PlanarModelTest(model).run(np.arange(3, dtype=np.int32)[None], contacts)
    assert len(poses) == 2
    assert poses.interpretations == 1
    # The object turns against the points.
    np.testing.assert_allclose(np.sort(poses.angles), [0.0, 2 * np.arctan(0.4)], atol=1e-3)
    np.testing.assert_allclose(poses.translations, 0.0, atol=1e-3)
    assert poses.proven.all()
    # Whichever way the world is turned, across the angle at which the search begins, too.
    for turn in np.linspace(0.0, 2 * np.pi, 90):
        again = PlanarModelTest(model).run(poses.faces[:1], moved(contacts, turn, [0, 0]))
        expected = wrapped(turn + np.array([0.0, 2 * np.arctan(0.4)]))
        np.testing.assert_allclose(np.sort(again.angles), np.sort(expected), atol=1e-3)


@pytest.mark.parametrize("bounded", [False, True])
@every_shape
def test_the_normal_equations_are_the_derivatives_of_the_misfit(name, bounded):
    outline = PlanarModelTest(entry(name).model)._outline
    radius = outline[4]
    for seed in range(5):
        case = felt_outline(name, 6, seed, missing=0.3)
        readings = _readings(case.contacts)
        rng = np.random.default_rng(seed)
        place = case.shift + rng.uniform(-0.2, 0.2, 2) * radius
        angle = case.angle + rng.uniform(-0.1, 0.1)
        system, gradient, spare = np.empty((3, 3)), np.empty(3), (np.empty((3, 3)), np.empty(3))
        assemble(bounded, case.edges, readings, outline, angle, place, system, gradient)
        np.testing.assert_allclose(system, system.T, atol=1e-9 * np.abs(system).max())
        assert np.linalg.eigvalsh(system).min() > -1e-9 * np.abs(system).max()
        step = 1e-6 * radius
        for axis in range(3):
            costs = []
            for sign in (-1.0, 1.0):
                motion = sign * step * np.eye(3)[axis]
                costs.append(
                    assemble(
                        bounded,
                        case.edges,
                        readings,
                        outline,
                        angle + motion[0] / radius,
                        place + rotation(angle) @ motion[1:],
                        *spare,
                    )
                )
            slope = (costs[1] - costs[0]) / (2 * step)
            # The misfit counts squares, the normal equations half of them.
            assert 2 * gradient[axis] == pytest.approx(
                slope, rel=1e-4, abs=1e-4 * costs[0] / radius
            )


@every_shape
def test_exact_contacts_are_fitted_exactly(name):
    model, rng = entry(name).model, np.random.default_rng(2)
    outline = PlanarModelTest(model)._outline
    edges = np.arange(model.face_count)
    points = model.segments[:, 0] + 0.3 * (model.segments[:, 1] - model.segments[:, 0])
    for _ in range(5):
        angle, shift = rng.uniform(-np.pi, np.pi), rng.uniform(-1, 1, 2)
        contacts = Contacts(
            points @ rotation(angle).T + shift,
            model.normals @ rotation(angle).T,
            position_error=0.01 * model.diameter,
            normal_error=0.2,
        )
        centre = rotation(angle) @ model.centroid + shift
        place = centre + 0.02 * model.diameter
        found = fit(edges, _readings(contacts), outline, 30, angle + 0.05, place)
        assert np.abs(found - angle) < 1e-4
        assert np.linalg.norm(place - centre) < 1e-4 * model.diameter
