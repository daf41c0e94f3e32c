"""Constraints on triples of contacts: they prune, and never the truth."""

from __future__ import annotations

import itertools
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from oracles.solids import (
    SOLIDS,
    Floats,
    as_set,
    enumerate_interpretations,
    model,
    points_on,
    random_contacts,
    random_pose,
    surface_points,
    tables,
)
from oracles.triangles import triangle

from palpate.assets import STAND_IN_NAMES
from palpate.envs.sensors.noise import uniform_in_ball
from palpate.recognizer import Constraints, Contacts, PairTables, Polyhedron
from palpate.recognizer.models.polygon import Polygon
from palpate.recognizer.tables import triples
from palpate.recognizer.tables.planar_ranges import PlanarTables
from palpate.recognizer.tables.triples import TripleTables
from palpate.recognizer.tree import triple_tree
from palpate.recognizer.tree.tree import InterpretationTree, prune, root

MODELS = (*SOLIDS, *STAND_IN_NAMES)
NO_NORMALS = {"angle": False, "component": False}
CHOICES = {
    "triple": Constraints(**NO_NORMALS, triple=True),
    "area": Constraints(**NO_NORMALS, area=True),
    "both": Constraints(**NO_NORMALS, triple=True, area=True),
}
DISTANCE = Constraints(**NO_NORMALS)
every_model = pytest.mark.parametrize("name", MODELS)
every_choice = pytest.mark.parametrize("choice", CHOICES)


def felt_without_normals(
    name: str, count: int, seed: int, *, dist: float = 0.003, awkward: bool = False
):
    """Contacts without normals; the bound on position as a share of the object's size."""
    solid, rng = model(name), np.random.default_rng(seed)
    points, faces = surface_points(solid, count, rng, awkward=awkward)
    points = random_pose(rng, solid.diameter).apply(points)
    error = dist * solid.diameter
    return Contacts(points + uniform_in_ball(rng, count, error), position_error=error), faces


def plain_margin(contacts: Contacts, rows: tuple[int, int, int], slack: float) -> Floats:
    """(4, 2) ranges that three contacts allow: of their angles, then of their area."""
    p, reach = contacts.positions[list(rows)], contacts.position_error[list(rows)] + slack
    angles, area = triangle(*p)
    found = []
    for k, (i, j) in enumerate(((1, 2), (0, 2), (0, 1))):
        swing = 0.0
        for m in (i, j):
            length, both = np.linalg.norm(p[m] - p[k]), reach[m] + reach[k]
            swing += np.arcsin(both / length) if both < length else np.pi
        middle = 0.0 if np.isnan(angles[k]) else angles[k]
        found.append((middle - swing, middle + swing))
    sides = [np.linalg.norm(p[1] - p[2]), np.linalg.norm(p[0] - p[2]), np.linalg.norm(p[0] - p[1])]
    mixed = reach[0] * reach[1] + reach[1] * reach[2] + reach[0] * reach[2]
    spread = (reach @ sides + mixed) / 2.0
    return np.array([*found, (area - spread, area + spread)])


def plain_filter(name: str, rows: np.ndarray, contacts: Contacts, choice: str) -> np.ndarray:
    """(m,) which interpretations have only triangles that fit: all triples, all at once."""
    known = tables(name).triples
    keep = np.ones(len(rows), bool)
    for chosen in itertools.combinations(range(rows.shape[1]), 3):
        allowed = plain_margin(contacts, chosen, known.slack)
        ranges = known.ranges(rows[:, list(chosen)])
        if choice != "area":
            keep &= (allowed[:3, 1] >= ranges.angle_min).all(axis=1)
            keep &= (allowed[:3, 0] <= ranges.angle_max).all(axis=1)
        if choice != "triple":
            keep &= (allowed[3, 1] >= ranges.area_min) & (allowed[3, 0] <= ranges.area_max)
    return keep


@every_choice
@pytest.mark.parametrize("name", ["cube", "tetrahedron", "l-block", "bridge", "holed"])
def test_leaves_are_all_assignments_whose_triangles_fit(name, choice):
    pruned = 0
    for seed in range(3):
        contacts, _ = felt_without_normals(name, 4, seed, awkward=seed == 2)
        pairs = enumerate_interpretations(tables(name), contacts, ("distance",))
        expected = as_set(pairs[plain_filter(name, pairs, contacts, choice)])
        for sort in (False, True):
            found = prune(tables(name), contacts, constraints=CHOICES[choice], sort=sort)
            assert found.complete
            assert len(found.faces) == len(expected)
            assert as_set(found.faces) == expected
        pruned += len(pairs) - len(expected)
    assert pruned > 0 or choice == "area" or name in ("cube", "tetrahedron")


@every_choice
def test_nodes_are_those_that_pass_the_filter(choice):
    contacts, _ = felt_without_normals("housing-34", 4, 1)
    order = np.argsort(-np.linalg.norm(contacts.positions - contacts.positions[0], axis=1))
    contacts = contacts[order]
    found = prune(tables("housing-34"), contacts, constraints=CHOICES[choice], sort=False)
    bare = prune(tables("housing-34"), contacts, constraints=DISTANCE, sort=False)
    assert (found.nodes <= bare.nodes).all()
    assert found.nodes[-1] == len(found.faces) < len(bare.faces)
    three = prune(tables("housing-34"), contacts[:3], constraints=DISTANCE, sort=False).faces
    alive = plain_filter("housing-34", three, contacts, choice)
    assert len(as_set(found.faces[:, :3])) <= found.nodes[2] <= alive.sum()


@every_choice
def test_leaves_do_not_depend_on_order_blocks_stages_or_memory(choice, monkeypatch):
    name = "simple-hand"
    contacts, _ = felt_without_normals(name, 4, 2)
    leaves = prune(tables(name), contacts, constraints=CHOICES[choice], sort=False)
    whole = as_set(leaves.faces)
    shuffled = prune(tables(name), contacts[[2, 0, 3, 1]], constraints=CHOICES[choice])
    assert as_set(shuffled.faces[:, [1, 3, 0, 2]]) == whole
    tree = InterpretationTree(tables(name), contacts, CHOICES[choice])
    prefixes = root()
    for stop in (1, 3, 4):
        prefixes, complete = tree.extend(prefixes, stop, 1_000_000)
        assert complete
    assert as_set(prefixes) == whole
    monkeypatch.setattr(triple_tree, "BLOCK", 100)
    monkeypatch.setattr(triples, "FIRST_SLOTS", 64)
    monkeypatch.setattr(triples, "MOST_SLOTS", 512)
    forgetful = PairTables.of(model(name))
    again = prune(forgetful, contacts, constraints=CHOICES[choice], sort=False)
    np.testing.assert_array_equal(again.faces, leaves.faces)
    np.testing.assert_array_equal(again.nodes, leaves.nodes)


def test_a_spent_budget_is_reported():
    contacts, _ = felt_without_normals("simple-hand", 4, 5)
    whole = prune(tables("simple-hand"), contacts, constraints=CHOICES["both"])
    count = len(whole.faces)
    assert prune(
        tables("simple-hand"), contacts, constraints=CHOICES["both"], budget=count
    ).complete
    for budget in (1, count - 1):
        cut = prune(tables("simple-hand"), contacts, constraints=CHOICES["both"], budget=budget)
        assert not cut.complete
        np.testing.assert_array_equal(cut.faces, whole.faces[:budget])


@pytest.mark.parametrize("count", [0, 1, 2])
def test_fewer_than_three_contacts_have_no_triangle(count):
    contacts, _ = felt_without_normals("cube", count, 0)
    found = prune(tables("cube"), contacts, constraints=CHOICES["both"])
    bare = prune(tables("cube"), contacts, constraints=DISTANCE)
    assert as_set(found.faces) == as_set(bare.faces)


def test_contacts_that_fit_pair_by_pair_but_not_together_are_refused():
    # From the top of a bridge to either sole is 2 to 4.15, and from sole to sole 1 to 3.64; but
    # within 2.1 of one point of the top no two points of the soles are that far apart.
    ranges, solid = tables("bridge"), model("bridge")
    height = np.sqrt(2.1**2 - 1.8**2)
    contacts = Contacts([[0, 0, height], [1.8, 0, 0], [-1.8, 0, 0]], position_error=1e-3)
    roof = np.flatnonzero(solid.normals[:, 2] > 0.5)
    soles = np.flatnonzero((np.abs(solid.offsets) < 1e-9) & (solid.normals[:, 2] < -0.5))
    refused = (*roof.tolist(), *soles.tolist())
    assert len(refused) == 3
    assert refused in as_set(prune(ranges, contacts, constraints=DISTANCE).faces)
    assert refused not in as_set(prune(ranges, contacts, constraints=CHOICES["triple"]).faces)


def test_the_usual_constraints_and_triples_go_together():
    solid, ranges, rng = model("housing"), tables("housing"), np.random.default_rng(7)
    both = Constraints(triple=True, area=True)
    for _ in range(5):
        contacts, truth = random_contacts(
            solid, random_pose(rng, 1.0), 7, rng, position_error=3e-4, normal_error=0.4
        )
        usual, more = prune(ranges, contacts), prune(ranges, contacts, constraints=both)
        assert as_set(more.faces) <= as_set(usual.faces)
        assert (more.faces == truth).all(axis=1).any()
        assert (more.nodes <= usual.nodes).all()
        trees = [InterpretationTree(ranges, contacts, chosen) for chosen in (Constraints(), both)]
        leaves = [tree.extend(tree.extend(root(), 3, 10**6)[0], 7, 10**6)[0] for tree in trees]
        assert (trees[1].nodes <= trees[0].nodes).all()
        assert as_set(leaves[1]) == as_set(more.faces)


def test_outlines_are_refused():
    outline = PlanarTables.of(Polygon.from_corners([[0, 0], [1, 0], [0, 1]], name="outline"))
    contacts = Contacts([[0.0, 0.0], [1.0, 0.0]], position_error=0.1)
    for choice in ("triple", "area"):
        with pytest.raises(ValueError, match="polyhedra"):
            prune(outline, contacts, constraints=CHOICES[choice])


@pytest.mark.parametrize("name", STAND_IN_NAMES)
def test_each_prunes_contacts_without_normals_and_both_prune_more(name):
    left = []
    for seed in range(3):
        contacts, truth = felt_without_normals(name, 4, seed, dist=0.002)
        found = [
            prune(tables(name), contacts, constraints=chosen)
            for chosen in (DISTANCE, *CHOICES.values())
        ]
        assert all((one.faces == truth).all(axis=1).any() for one in found)
        left.append([len(one.faces) for one in found])
    bare, triple, area, both = np.median(left, axis=0)
    assert triple < 0.97 * bare
    assert area < 0.997 * bare
    assert both < min(triple, area)


@cache
def fresh(name: str) -> TripleTables:
    return replace(tables(name)).triples  # not yet asked for anything


@every_model
def test_the_true_interpretation_survives_noise_up_to_its_bounds(name):
    solid, rng = model(name), np.random.default_rng(11)
    seen = 0
    for case in range(120):
        error = solid.diameter * 10.0 ** rng.uniform(-6, -0.7, 6 if case % 2 else 1)
        contacts, truth = random_contacts(
            solid,
            random_pose(rng, solid.diameter),
            6,
            rng,
            position_error=np.broadcast_to(error, 6),
            normal_error=1.0,
            awkward=case % 3 > 0,
            at_bounds=case % 3 == 2,
        )
        rows = truth.astype(np.int32)[None]
        for count in range(3, 7):
            first = np.ascontiguousarray(rows[:, :count])
            assert fresh(name).possible(first, contacts, angles=True, areas=True).all()
            seen += 1
    assert seen == 480


@every_model
def test_the_true_interpretation_survives_where_contacts_crowd_on_edges(name):
    """Triangles of points so near that the bound decides everything, on faces that meet."""
    solid, rng, seen = model(name), np.random.default_rng(12), 0
    for _ in range(200):
        members = rng.integers(len(solid.triangles), size=3)
        points = points_on(solid, members, rng)
        ends = solid.edges[rng.integers(len(solid.edges))]
        centre = ends[0] + rng.random() * (ends[1] - ends[0])
        scale = 10.0 ** rng.uniform(-7, -1)
        points = centre + scale * (points - centre)
        # Back onto the surface: the nearest point of the mesh's planes through that edge.
        faces = [face for face in range(solid.face_count) if on_plane(solid, face, centre)]
        chosen = rng.choice(faces, 3)
        heights = (points * solid.normals[chosen]).sum(axis=1) - solid.offsets[chosen]
        points -= heights[:, None] * solid.normals[chosen]
        inside = np.array([is_on(solid, f, p) for f, p in zip(chosen, points, strict=True)])
        if not inside.all():
            continue
        error = solid.diameter * 10.0 ** rng.uniform(-9, -3)
        contacts = Contacts(points + uniform_in_ball(rng, 3, error), position_error=error)
        rows = chosen.astype(np.int32)[None]
        assert fresh(name).possible(rows, contacts, angles=True, areas=True).all()
        seen += 1
    assert seen > 10


def on_plane(solid: Polyhedron, face: int, point: Floats) -> bool:
    return abs(solid.normals[face] @ point - solid.offsets[face]) < 1e-9 * solid.diameter


def is_on(solid: Polyhedron, face: int, point: Floats) -> bool:
    """Whether a point of a face's plane is in one of its triangles."""
    for a, b, c in solid.vertices[solid.triangles[solid.triangle_faces == face]]:
        sides = [
            np.cross(q - p, point - p) @ solid.normals[face] for p, q in ((a, b), (b, c), (c, a))
        ]
        if min(sides) >= 0.0:
            return True
    return False
