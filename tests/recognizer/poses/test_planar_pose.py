"""Poses of single interpretations in the plane: three degrees of freedom, edges for faces.

The memo's Section 4.1.
"""

from __future__ import annotations

import numpy as np
import pytest
from helpers.planar_search import angles_of, components, fit
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
    regular,
    turned,
    wrapped,
)
from oracles.solids import as_set

from palpate.recognizer import Contacts
from palpate.recognizer.models.polygon import Polygon
from palpate.recognizer.poses.entry import OutlineEntry
from palpate.recognizer.tree.tree import prune

every_shape = pytest.mark.parametrize("name", SHAPES)
small_shape = pytest.mark.parametrize("name", SMALL)


@pytest.mark.parametrize("missing", [0.0, 0.4, 1.0])
@small_shape
def test_verdicts_on_all_assignments_are_those_of_a_grid_of_poses(name, missing):
    """Feasible where a pose of a grid is; not where none is by more than its spacing.

    Between the two: no descent of scipy's from the best grid poses finds what was rejected.
    """
    model = entry(name).model
    rng = np.random.default_rng(3)
    accepted = rejected = between = 0
    for seed in range(3):
        case = felt_outline(name, 3 + seed % 2, seed, dist=0.04, missing=missing)
        contacts, count = case.contacts, len(case.edges)
        leaves = prune(entry(name).tables, contacts).faces
        leaves = rng.permutation(leaves)[:12].astype(np.int32)
        anything = rng.integers(model.face_count, size=(12, count), dtype=np.int32)
        rows = np.unique(np.concatenate([leaves, anything, case.edges[None]]), axis=0)
        poses = fit(entry(name), rows, contacts)
        kept = as_set(poses.faces)
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
    model, rng = entry(name).model, np.random.default_rng(8)
    survivors = 0
    for seed in range(12):
        case = felt_outline(name, int(rng.integers(2, 6)), seed, dist=0.02, missing=0.3)
        rows = prune(entry(name).tables, case.contacts, budget=3000).faces
        poses = fit(entry(name), rng.permutation(rows)[:40], case.contacts)
        assert poses.proven.all()
        for angle, shift, edges in zip(
            angles_of(poses.rotations), poses.translations, poses.faces, strict=True
        ):
            assert shift[2] == 0.0
            assert meets(model, case.contacts, edges, angle, shift[:2])
        survivors += len(poses)
    assert survivors > 12


def test_bounds_met_at_one_pose_only_are_met():
    """Two contacts a square's diagonal apart and both bounds, all spent: one pose is left."""
    delta = 0.01
    out = np.array([1.0, 1.0]) / np.sqrt(2.0)
    contacts = Contacts(
        [-delta * out, [1, 1] + delta * out],
        [turned(np.array([[0.0, -1.0]]), 0.1)[0], turned(np.array([[0.0, 1.0]]), -0.1)[0]],
        position_error=delta,
        normal_error=0.1,
    )
    poses = fit(entry("square"), np.array([[0, 2]], np.int32), contacts)
    assert len(poses) == 1
    assert poses.reaches[0, 0] < 1e-4
    assert abs(angles_of(poses.rotations)[0]) <= poses.reaches[0, 0] + 1e-9
    spread = np.array(contacts.positions) + 1e-6 * np.array([-out, out])
    apart = Contacts(
        spread, contacts.normals, position_error=delta, normal_error=contacts.normal_error
    )
    assert len(fit(entry("square"), np.array([[0, 2]], np.int32), apart)) == 0


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("dist", [1e-6, 1e-3, 0.3])
def test_scale_and_tight_and_wide_bounds_change_nothing(scale, dist):
    model = Polygon.from_corners(scale * entry("l-shape").model.corners, name="l")
    test, rng = OutlineEntry.of(model), np.random.default_rng(4)
    proven = 0
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
        poses = fit(test, case.edges[None], case.contacts)
        assert len(poses) == 1
        if poses.proven[0]:
            angle, shift = angles_of(poses.rotations)[0], poses.translations[0]
            assert meets(model, case.contacts, case.edges, angle, shift[:2])
        proven += poses.proven[0]
    assert proven >= 29


def test_one_interpretation_may_have_separate_poses():
    """Without normals: a triangle on three points turns from one solution into another.

    Points ``r n + s t`` on the sides of an equilateral triangle of inradius r stay on them when it
    turns by an angle a with ``r cos a - s sin a = r``: 0 or ``-2 atan(s / r)``.
    """
    model = Polygon.from_corners(2.0 * regular(3), name="even")
    points = model.normals + 0.4 * turned(model.normals, np.pi / 2)
    contacts = Contacts(points, position_error=0.01)
    # Whichever way the world is turned, across the angles at which the search begins, too.
    for turn in np.linspace(0.0, 2 * np.pi, 90):
        poses = components(OutlineEntry.of(model), np.arange(3), moved(contacts, turn, [0, 0]))
        # The object turns against the points.
        expected = wrapped(turn + np.array([0.0, 2 * np.arctan(0.4)]))
        found = wrapped(angles_of(poses.rotations))
        np.testing.assert_allclose(np.sort(found), np.sort(expected), atol=1e-3)
        np.testing.assert_allclose(poses.translations, 0.0, atol=1e-3)
        assert poses.proven.all()
