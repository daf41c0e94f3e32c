"""The interpretation tree keeps all that the constraints allow, and above all the truth."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from helpers.constraints import NAMES, compiled_masks, only
from oracles.solids import (
    as_set,
    enumerate_interpretations,
    model,
    noisy_contacts,
    pair_margins,
    random_contacts,
    random_pose,
    search_interpretations,
    tables,
)
from scipy.spatial.transform import Rotation

from palpate.assets import STAND_IN_NAMES
from palpate.recognizer import Constraints, Contacts
from palpate.recognizer.models.rays import cast_rays
from palpate.recognizer.tree.tree import InterpretationTree, far_apart_order, prune, root
from palpate.recognizer.tree.tree_kernels import pair_masks

ALL = Constraints(distance=True, angle=True, component=True, tilt=True)
USUAL = ("distance", "angle", "component")
BORDERLINE = 1e-12
"""Margins (metres or radians) below which rounding decides whether two faces fit."""

every_stand_in = pytest.mark.parametrize("name", STAND_IN_NAMES)
small_solid = pytest.mark.parametrize("name", ["cube", "tetrahedron", "l-block", "bridge"])


def felt_solid(name: str, count: int, seed: int, *, dist=0.01, normal=0.3, **sampler) -> Contacts:
    """Contacts with a model at a random pose; the bound on position as a share of its size."""
    solid, rng = model(name), np.random.default_rng(seed)
    return random_contacts(
        solid,
        random_pose(rng, solid.diameter),
        count,
        rng,
        position_error=dist * solid.diameter,
        normal_error=normal,
        **sampler,
    )[0]


def unrelated_contacts(name: str, count: int, seed: int) -> Contacts:
    """Contacts with nothing in particular, bounds of their own each, some of them degenerate."""
    rng, size = np.random.default_rng(seed), model(name).diameter
    positions = rng.uniform(-0.5, 0.5, (count, 3)) * size
    normals = rng.normal(size=(count, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    normals[rng.random(count) < 0.2] = [0.0, 0.0, 1.0]
    normals[rng.random(count) < 0.2] = [0.0, 0.0, -1.0]
    for row in range(1, count):
        if rng.random() < 0.2:
            positions[row] = positions[row - 1]
        elif rng.random() < 0.2:  # straight along a normal
            positions[row] = positions[row - 1] + 0.3 * size * normals[row - 1]
    return Contacts(
        positions,
        normals,
        position_error=size * 10.0 ** rng.uniform(-5, -0.5, count),
        normal_error=rng.choice([1e-3, 0.1, 0.4, 2.0, np.pi], count),
    )


def far_apart_first(contacts: Contacts) -> Contacts:
    return contacts[far_apart_order(contacts.positions)]


CHOICES = [(name,) for name in NAMES] + [USUAL, NAMES]


@pytest.mark.parametrize("chosen", CHOICES, ids="+".join)
@pytest.mark.parametrize("name", ["cube", "holed", "hull-90", "housing", "complex-hand"])
def test_masks_are_those_of_the_formulas(name, chosen):
    ranges = tables(name)
    compared = borderline = kept = 0
    for seed in range(4):
        cases = [
            unrelated_contacts(name, 5, seed),
            felt_solid(name, 5, seed, awkward=True),
            felt_solid(name, 5, seed, awkward=True, at_bounds=True, dist=0.05),
        ]
        for contacts in cases:
            found = compiled_masks(pair_masks, tables(name), contacts, only(chosen))
            faces_left = np.ones((len(contacts), ranges.face_count), bool)
            for j in range(len(contacts)):
                for i in range(j):
                    margins = pair_margins(ranges, contacts, i, j, chosen)
                    # The kernel drops faces of j that no partner before i supports, and rows of i
                    # likewise.
                    expected = (margins >= 0.0) & faces_left[i][:, None] & faces_left[j]
                    clear = np.abs(margins) > BORDERLINE
                    np.testing.assert_array_equal(found[i, j][clear], expected[clear])
                    faces_left[j] &= found[i, j].any(axis=0)
                    compared += clear.size
                    borderline += int((~clear).sum())
                    kept += int(expected.sum())
    assert borderline < 0.01 * compared
    assert 0 < kept <= compared
    assert kept < compared or chosen == ("tilt",)


@pytest.mark.parametrize("chosen", CHOICES, ids="+".join)
@small_solid
def test_leaves_are_all_assignments_that_fit(name, chosen):
    for seed in range(4):
        cases = [
            unrelated_contacts(name, 4, seed),
            felt_solid(name, 4, seed, awkward=True, dist=0.03),
        ]
        for contacts in cases:
            expected = as_set(enumerate_interpretations(tables(name), contacts, chosen))
            for sort in (False, True):
                found = prune(tables(name), contacts, constraints=only(chosen), sort=sort)
                assert found.complete
                assert as_set(found.faces) == expected
                assert len(found.faces) == len(expected)


@pytest.mark.parametrize("name", ["hull-90", "housing", "stapler", "simple-hand", "complex-hand"])
def test_leaves_are_those_of_a_plain_search_on_larger_models(name):
    sizes = []
    for seed in range(3):
        contacts = felt_solid(name, 6, seed, awkward=seed == 1)
        expected, alive = search_interpretations(tables(name), contacts, USUAL)
        found = prune(tables(name), contacts, sort=False)
        assert as_set(found.faces) == set(expected)
        assert len(found.faces) == len(expected)
        # Looking ahead only takes away prefixes that lead nowhere.
        assert (found.nodes <= alive).all()
        assert found.nodes[-1] == alive[-1] == len(found.faces)
        for level in range(6):
            assert found.nodes[level] >= len(as_set(found.faces[:, : level + 1]))
        sizes.append(len(expected))
    assert max(sizes) > 1


@every_stand_in
def test_leaves_do_not_depend_on_the_order_of_contacts(name):
    rng = np.random.default_rng(9)
    for seed in range(5):
        contacts = felt_solid(name, 7, seed)
        leaves = as_set(prune(tables(name), contacts).faces)
        assert leaves
        order = rng.permutation(7)
        for sort in (False, True):
            shuffled = prune(tables(name), contacts[order], sort=sort).faces
            assert as_set(shuffled[:, np.argsort(order)]) == leaves
        assert as_set(prune(tables(name), contacts, sort=False).faces) == leaves


@every_stand_in
def test_another_contact_never_adds_an_interpretation(name):
    contacts = felt_solid(name, 8, 4)
    before = {()}
    for count in range(1, 9):
        now = as_set(prune(tables(name), contacts[:count]).faces)
        assert {row[:-1] for row in now} <= before
        before = now
    assert before


@every_stand_in
def test_a_motion_of_all_contacts_changes_nothing(name):
    rng = np.random.default_rng(3)
    for seed in range(5):
        contacts = felt_solid(name, 7, seed)
        motion = random_pose(rng, 1.0)
        moved = Contacts(
            motion.apply(contacts.positions),
            motion.rotation.apply(np.array(contacts.normals)),  # scipy takes no read-only array
            position_error=contacts.position_error,
            normal_error=contacts.normal_error,
        )
        here, there = prune(tables(name), contacts), prune(tables(name), moved)
        assert as_set(here.faces) == as_set(there.faces) != set()


@pytest.mark.parametrize("name", ["l-block", "housing-34", "hull-90"])
def test_more_constraints_leave_fewer_interpretations(name):
    contacts = felt_solid(name, 4, 6, dist=0.02)
    leaves = {
        chosen: as_set(prune(tables(name), contacts, constraints=only(chosen)).faces)
        for size in (2, 3, 4)
        for chosen in itertools.combinations(NAMES, size)
        if "angle" in chosen
    }
    for fewer, more in itertools.permutations(leaves, 2):
        if set(fewer) < set(more):
            assert leaves[more] <= leaves[fewer]
    assert len(leaves[NAMES]) > 0


@every_stand_in
def test_wider_bounds_keep_every_interpretation(name):
    narrow = felt_solid(name, 6, 2)
    leaves: set[tuple[int, ...]] = set()
    for factor in (1.0, 1.5, 2.0):
        wide = Contacts(
            narrow.positions,
            narrow.normals,
            position_error=factor * narrow.position_error,
            normal_error=factor * narrow.normal_error,
        )
        found = prune(tables(name), wide)
        assert found.complete
        assert leaves <= as_set(found.faces)
        leaves = as_set(found.faces)
        assert leaves


def test_a_tree_grown_in_stages_has_the_leaves_of_one_grown_at_once():
    for name, seed in itertools.product(["housing", "hull-90"], range(3)):
        contacts = far_apart_first(felt_solid(name, 9, seed, normal=0.15))
        at_once = as_set(prune(tables(name), contacts, sort=False).faces)
        tree = InterpretationTree(tables(name), contacts, Constraints())
        prefixes = root()
        for stop in (2, 3, 6, 9):
            prefixes, complete = tree.extend(prefixes, stop, 1_000_000)
            assert complete
        assert as_set(prefixes) == at_once
        assert tree.nodes[-1] == len(at_once)


def test_dropping_prefixes_drops_their_descendants_and_no_others():
    contacts = far_apart_first(felt_solid("housing", 8, 1))
    tree = InterpretationTree(tables("housing"), contacts, Constraints())
    prefixes, _ = tree.extend(root(), 4, 1_000_000)
    kept = prefixes[::2]
    leaves, _ = tree.extend(kept, 8, 1_000_000)
    whole = as_set(prune(tables("housing"), contacts, sort=False).faces)
    assert as_set(leaves) == {leaf for leaf in whole if leaf[:4] in as_set(kept)}


def test_a_spent_budget_is_reported():
    contacts = felt_solid("complex-hand", 5, 1, dist=0.05)
    whole = prune(tables("complex-hand"), contacts)
    count = len(whole.faces)
    assert whole.complete
    assert count > 2
    assert prune(tables("complex-hand"), contacts, budget=count).complete
    for budget in (1, count - 1):
        cut = prune(tables("complex-hand"), contacts, budget=budget)
        assert not cut.complete
        assert len(cut.faces) == budget
        assert as_set(cut.faces) < as_set(whole.faces)


def test_no_contacts_have_one_empty_interpretation():
    found = prune(tables("cube"), Contacts.none())
    assert found.faces.shape == (1, 0)
    assert found.complete


@pytest.mark.parametrize("name", ["cube", "hull-90"])
def test_one_contact_may_be_on_any_face(name):
    found = prune(tables(name), felt_solid(name, 1, 0))
    assert as_set(found.faces) == {(face,) for face in range(model(name).face_count)}


def test_contacts_that_cannot_be_on_one_object_have_no_interpretation():
    size = model("stapler").diameter
    apart = Contacts(
        [[0, 0, 0], [2 * size, 0, 0]], [[-1, 0, 0], [1, 0, 0]], position_error=1e-3, normal_error=1
    )
    found = prune(tables("stapler"), apart)
    assert found.faces.shape == (0, 2)
    assert found.complete


def test_opposite_contacts_of_a_cube_have_its_six_interpretations():
    # Face to face, an arm's length apart: three axes, two ways round.
    ends = Contacts(
        [[0, 0, 0], [0, 0, 1.0]], [[0, 0, -1], [0, 0, 1]], position_error=0.01, normal_error=0.1
    )
    leaves = as_set(prune(tables("cube"), ends).faces)
    normals = model("cube").normals
    assert len(leaves) == 6
    assert all(normals[a] @ normals[b] == -1.0 for a, b in leaves)


@pytest.mark.parametrize("count", [0, 1, 2, 3, 12])
def test_far_apart_contacts_come_first(count):
    rng = np.random.default_rng(count)
    points = rng.normal(size=(count, 3))
    order = far_apart_order(points)
    assert sorted(order.tolist()) == list(range(count))
    apart = np.linalg.norm(points[:, None] - points, axis=2)
    if count >= 2:
        assert apart[order[0], order[1]] == apart.max()
    for k in range(2, count):
        gaps = apart[np.ix_(order[k:], order[:k])].min(axis=1)
        assert gaps[0] == gaps.max()


def test_the_order_of_coinciding_points_is_still_an_order():
    for points in (np.zeros((5, 3)), np.repeat(np.eye(3), 2, axis=0)):
        assert sorted(far_apart_order(points).tolist()) == list(range(len(points)))


# --- The truth survives -----------------------------------------------------------------------


def truth_survives(name: str, contacts: Contacts, truth: np.ndarray) -> bool:
    """Assert that no pair of true faces is refused, and that they are a leaf if all were found.

    Returns:
        Whether all were: contacts that say little have more leaves than are looked for.
    """
    rows = np.arange(len(truth))
    allowed = compiled_masks(pair_masks, tables(name), contacts, ALL)[
        rows[:, None], rows, truth[:, None], truth
    ]
    assert allowed[np.triu_indices(len(truth), 1)].all()
    found = prune(tables(name), contacts, constraints=ALL, budget=200_000)
    if found.complete:
        assert tuple(truth.tolist()) in as_set(found.faces)
    return found.complete


@pytest.mark.parametrize("at_bounds", [False, True], ids=["inside", "at the bounds"])
@pytest.mark.parametrize(
    "name", ["cube", "l-block", "pocketed", "bridge", "hull-90", *STAND_IN_NAMES]
)
def test_the_true_interpretation_survives(name, at_bounds):
    solid, rng, whole = model(name), np.random.default_rng(12), 0
    for case in range(200):
        count = int(rng.integers(2, 8))
        each = case % 3 == 0
        contacts, truth = random_contacts(
            solid,
            random_pose(rng, 2.0 * solid.diameter),
            count,
            rng,
            position_error=solid.diameter * 10.0 ** rng.uniform(-5, -2, count if each else None),
            normal_error=rng.uniform(0.01, np.pi / 8, count if each else None),
            awkward=case % 2 == 0,
            at_bounds=at_bounds,
        )
        whole += truth_survives(name, contacts, truth)
    assert whole > 150


@every_stand_in
def test_the_true_interpretation_survives_where_rays_of_a_grid_meet_the_object(name):
    """The memo's simulated range data (Section 4.2), at its bounds of pi / 12 and 0.01 in."""
    solid, rng, whole = model(name), np.random.default_rng(13), 0
    for case in range(60):
        pose = random_pose(rng, solid.diameter)
        axes, starts, directions = Rotation.random(rng=rng).as_matrix(), [], []
        for axis in range(3):
            u, v = axes[(axis + 1) % 3], axes[(axis + 2) % 3]
            for a, b in itertools.product(np.linspace(-0.35, 0.35, 4), repeat=2):
                shift = (a * u + b * v - 2.0 * axes[axis]) * solid.diameter
                starts.append(pose.apply(solid.centroid) + shift)
                directions.append(axes[axis])
        hits = cast_rays(solid, pose, np.array(starts), np.array(directions))
        rows = rng.permutation(np.flatnonzero(hits.hit))[:12]
        contacts = noisy_contacts(
            hits.points_world[rows],
            hits.normals_world[rows],
            rng,
            position_error=0.000254,
            normal_error=np.pi / 12,
            at_bounds=case % 2 == 0,
        )
        whole += truth_survives(name, contacts, hits.faces[rows])
    assert whole > 50


def test_noise_at_the_bounds_is_on_the_bounds():
    # The sampler's own check: otherwise the tests above would be easier than they say.
    solid, rng = model("housing"), np.random.default_rng(14)
    contacts, truth = random_contacts(
        solid,
        pose := random_pose(rng, 1.0),
        200,
        rng,
        position_error=1e-3,
        normal_error=0.3,
        at_bounds=True,
    )
    true_normals = pose.rotation.apply(solid.normals[truth])
    cosines = (contacts.normals * true_normals).sum(axis=1)
    assert (np.abs(np.arccos(cosines) - 0.3) < 1e-6).mean() > 0.95
    heights = ((pose.inv().apply(contacts.positions)) * solid.normals[truth]).sum(axis=1)
    assert np.abs(heights - solid.offsets[truth]).max() < 1e-3 + 1e-12
