"""Constraints on triples of contacts: outer bounds, whatever the faces, that prune all the same."""

from __future__ import annotations

import itertools
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from oracles.geometry import angle_between
from oracles.solids import (
    SOLIDS,
    Floats,
    as_set,
    box,
    enumerate_interpretations,
    model,
    points_on,
    prism,
    random_contacts,
    random_pose,
    surface_points,
    tables,
)

from palpate.assets import STAND_IN_NAMES
from palpate.envs.sensors.noise import uniform_in_ball
from palpate.recognizer import Constraints, Contacts, PairTables, Polyhedron
from palpate.recognizer.models.features import all_features
from palpate.recognizer.models.polygon import Polygon
from palpate.recognizer.tables import triples
from palpate.recognizer.tables.planar_ranges import PlanarTables
from palpate.recognizer.tables.triple_kernels import measured_triangle
from palpate.recognizer.tables.triple_range_kernels import (
    CORNER_TERMS,
    corner_ranges,
    direction_cones,
)
from palpate.recognizer.tables.triples import TripleTables
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


def triangle(p: Floats, q: Floats, r: Floats) -> tuple[Floats, Floats]:
    """(..., 3) angles at p, q and r, and (...) areas; not a number where points coincide."""
    angles = []
    for apex, one, other in ((p, q, r), (q, r, p), (r, p, q)):
        u, w = one - apex, other - apex
        with np.errstate(invalid="ignore", divide="ignore"):
            u = u / np.linalg.norm(u, axis=-1, keepdims=True)
            w = w / np.linalg.norm(w, axis=-1, keepdims=True)
        angles.append(
            2.0 * np.arctan2(np.linalg.norm(u - w, axis=-1), np.linalg.norm(u + w, axis=-1))
        )
    return np.stack(angles, axis=-1), np.linalg.norm(np.cross(q - p, r - p), axis=-1) / 2.0


def weights(rng: np.random.Generator, corners: int, count: int) -> Floats:
    """(count, corners) mostly on corners and edges, where the extremes are, but not only."""
    return rng.dirichlet(np.full(corners, rng.choice([0.05, 0.3, 1.0])), count)


def points_of_face(solid: Polyhedron, face: int, count: int, rng: np.random.Generator) -> Floats:
    members = rng.choice(np.flatnonzero(solid.triangle_faces == face), count)
    corners = solid.vertices[solid.triangles[members]]
    return np.einsum("nk,nkd->nd", weights(rng, 3, count), corners)


def some_triples(faces: int, most: int, rng: np.random.Generator) -> np.ndarray:
    every = np.array(list(itertools.combinations_with_replacement(range(faces), 3)))
    return rng.permuted(rng.permutation(every)[:most], axis=1)


# --- Ranges ---------------------------------------------------------------------------------


@every_model
def test_no_three_points_of_three_faces_lie_outside_the_ranges(name):
    solid, rng = model(name), np.random.default_rng(0)
    chosen = some_triples(solid.face_count, 200, rng)
    ranges = tables(name).triples.ranges(chosen)
    width, seen = 0.0, 0
    for row, faces in enumerate(chosen):
        angles, areas = triangle(*(points_of_face(solid, face, 200, rng) for face in faces))
        for k in range(3):
            known = angles[~np.isnan(angles[:, k]), k]
            assert (known >= ranges.angle_min[row, k]).all()
            assert (known <= ranges.angle_max[row, k]).all()
            width += np.ptp(known) if len(known) else 0.0
            seen += 1
        assert (areas >= ranges.area_min[row] - 1e-12 * solid.diameter**2).all()
        assert (areas <= ranges.area_max[row] + 1e-12 * solid.diameter**2).all()
    outer = np.clip(ranges.angle_max, 0, np.pi) - np.clip(ranges.angle_min, 0, np.pi)
    # Bounds that say nothing would pass too. On a tetrahedron nearly every angle is possible.
    assert np.pi - outer.mean() > 0.3 * (np.pi - width / seen) or name == "tetrahedron"


@every_model
def test_cones_hold_every_direction_between_two_faces(name):
    solid, rng = model(name), np.random.default_rng(1)
    start = solid.hulls.start
    axes, half_angles = direction_cones(solid.hulls.corners, start, 1e-9 * solid.diameter)
    narrow = 0
    for a, b in rng.integers(solid.face_count, size=(200, 2)):
        p, q = (points_of_face(solid, face, 40, rng) for face in (a, b))
        p = np.concatenate([p, solid.hulls.corners[start[a] : start[a + 1]]])
        q = np.concatenate([q, solid.hulls.corners[start[b] : start[b + 1]]])
        between = (q[:, None] - p).reshape(-1, 3)
        lengths = np.linalg.norm(between, axis=1)
        between = between[lengths > 1e-6 * solid.diameter]
        cosines = between @ axes[a, b] / np.linalg.norm(between, axis=1)
        assert (np.arccos(np.clip(cosines, -1.0, 1.0)) <= half_angles[a, b] + 1e-6).all()
        narrow += half_angles[a, b] < np.pi / 4
    assert narrow > 10 or name in ("cube", "tetrahedron", "l-block", "holed", "bridge")


def test_ranges_over_edges_and_vertices_hold_their_points_too():
    solid, rng = model("bridge"), np.random.default_rng(6)
    features = all_features(solid)
    chosen = some_triples(len(features), 400, rng)
    ranges = PairTables.of(solid, features).triples.ranges(chosen)
    hulls = [features.corners[a:b] for a, b in pairwise(features.start[: len(features) + 1])]
    kinds = set()
    for row, faces in enumerate(chosen):
        points = [weights(rng, len(hulls[f]), 60) @ hulls[f] for f in faces]
        angles, areas = triangle(*points)
        near = np.isnan(angles)
        for k in range(3):
            for j in range(3):
                if j != k:
                    near[:, k] |= np.linalg.norm(points[k] - points[j], axis=1) < 1e-6
        assert ((angles >= ranges.angle_min[row]) | near).all()
        assert ((angles <= ranges.angle_max[row]) | near).all()
        assert (areas >= ranges.area_min[row] - 1e-12).all()
        assert (areas <= ranges.area_max[row] + 1e-12).all()
        kinds |= {features.kind(int(f)) for f in faces}
    assert kinds == {"face", "edge", "vertex"}


def polygon_of(rng: np.random.Generator, size: float) -> Floats:
    """A flat convex polygon, a segment or a point, somewhere in a unit cube."""
    corners = int(rng.integers(1, 6))
    around = np.sort(rng.uniform(0, 2 * np.pi, corners))
    frame = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    ring = np.column_stack([np.cos(around), rng.uniform(0.2, 1) * np.sin(around)])
    return rng.uniform(-0.5, 0.5, 3) + size * ring @ frame[:2]


def bounds_of(polygons: list[Floats]) -> Floats:
    """(4, 2) what the kernel says of three polygons."""
    corners, sizes = np.concatenate(polygons), [len(p) for p in polygons]
    middles = [p.mean(axis=0) for p in polygons]
    lifts = [((p - c) ** 2).sum(axis=1) for p, c in zip(polygons, middles, strict=True)]
    out = np.empty((4, 2))
    corner_ranges(
        corners,
        np.cumsum([0, *sizes]),
        np.concatenate(lifts),
        (0, 1, 2),
        1e-15,
        np.empty((int(np.prod(sizes)), CORNER_TERMS)),
        out,
    )
    return out


def polygon_triples(count: int):
    """Three polygons each: far apart, near, with a corner or an edge in common, or the same."""
    rng = np.random.default_rng(3)
    for _ in range(count):
        polygons = [polygon_of(rng, 10.0 ** rng.uniform(-2, 0)) for _ in range(3)]
        kind = rng.integers(5)
        if kind == 1:
            polygons[1] = polygons[1] - polygons[1][0] + polygons[0][-1]
        elif kind == 2:
            polygons[1] = np.vstack([polygons[0][:2], rng.uniform(-0.5, 0.5, 3)])
        elif kind == 3:
            polygons[rng.integers(1, 3)] = polygons[0]
        yield polygons, rng


def test_bounds_from_corners_hold_all_triangles_of_awkward_polygons():
    informative = 0
    for polygons, rng in polygon_triples(1800):
        out = bounds_of(polygons)
        points = [weights(rng, len(p), 150) @ p for p in polygons]
        angles, areas = triangle(*points)
        for k in range(3):
            known = angles[~np.isnan(angles[:, k]), k]
            # Legs of a few millionths have no direction to speak of in double precision.
            far = min(
                np.linalg.norm(points[k] - points[j], axis=1)[~np.isnan(angles[:, k])].min(
                    initial=1
                )
                for j in range(3)
                if j != k
            )
            slack = 1e-9 + 1e-14 / far
            assert (known >= out[k, 0] - slack).all()
            assert (known <= out[k, 1] + slack).all()
            informative += out[k, 0] > 0.1 or out[k, 1] < 3.0
        assert (areas >= out[3, 0] - 1e-12).all()
        assert (areas <= out[3, 1] + 1e-12).all()
    assert informative > 1800


def test_bounds_that_are_said_to_be_exact_are_those_of_the_corners():
    seen = 0
    for polygons, _ in polygon_triples(600):
        out = bounds_of(polygons)
        corners = np.array(list(itertools.product(*polygons)))
        angles, areas = triangle(*corners.swapaxes(0, 1))
        assert out[3, 1] == pytest.approx(areas.max(), abs=1e-12)
        for k in range(3):
            if not np.isnan(angles[:, k]).any() and angles[:, k].min() > np.pi / 2 + 1e-6:
                assert out[k, 0] == pytest.approx(angles[:, k].min(), abs=1e-9)
                seen += 1
    assert seen > 50


def test_bounds_of_small_faces_far_apart_are_tight():
    rng = np.random.default_rng(8)
    excess = []
    for _ in range(300):
        polygons = [0.01 * polygon_of(rng, 1.0) + rng.normal(size=3) for _ in range(3)]
        out = bounds_of(polygons)
        angles, areas = triangle(*np.array(list(itertools.product(*polygons))).swapaxes(0, 1))
        excess.append(angles.min(axis=0) - out[:3, 0])
        excess.append(out[:3, 1] - angles.max(axis=0))
        assert out[3, 0] <= areas.min()
    assert np.median(excess) < 1e-3
    assert np.percentile(excess, 90) < 0.02


def test_ranges_of_a_cube_have_their_closed_forms():
    side = 0.25
    solid = Polyhedron.from_mesh(box(side, side, side))
    top, bottom = (int(np.argmax(sign * solid.normals[:, 2])) for sign in (1, -1))
    ranges = PairTables.of(solid).triples.ranges(np.array([[bottom, top, top], [top, top, top]]))
    # Seen from a corner of the bottom, the farthest apart on top are two opposite corners, or the
    # corner above and the one across; half a turn is no more than over a point of the top.
    widest = max(
        angle_between(np.array(u) - p, np.array(w) - p)
        for p in (np.array([x, y, 0.0]) for x, y in itertools.product([0, 0.5, 1], repeat=2))
        for u, w in itertools.combinations(itertools.product([0, 1], [0, 1], [1.0]), 2)
    )
    assert widest <= ranges.angle_max[0, 0] < widest + 0.3
    assert ranges.angle_min[0, 0] == pytest.approx(0.0, abs=1e-6)
    # Two points of the top can't see one of the bottom flatter than across the diagonal.
    assert ranges.angle_min[0, 1] == pytest.approx(np.arctan(1 / np.sqrt(2)), abs=0.15)
    np.testing.assert_allclose(ranges.area_min, 0.0, atol=1e-12)
    np.testing.assert_allclose(ranges.area_max, [np.sqrt(3) / 2 * side**2, side**2 / 2], rtol=1e-9)


def test_a_hull_of_many_corners_is_held_by_one_of_few():
    solid = Polyhedron.from_mesh(prism(60, 0.5))
    few = PairTables.of(solid).triples
    rng = np.random.default_rng(4)
    round_faces = np.flatnonzero(np.abs(solid.normals[:, 2]) > 0.5)
    chosen = some_triples(solid.face_count, 200, rng)
    chosen[:150, 0] = rng.choice(round_faces, 150)
    chosen[:60, 1] = rng.choice(round_faces, 60)
    ranges = few.ranges(chosen)
    for row, faces in enumerate(chosen):
        angles, areas = triangle(*(points_of_face(solid, face, 200, rng) for face in faces))
        known = np.where(np.isnan(angles), 1.0, angles)
        nothing = np.isnan(angles)
        assert ((known >= ranges.angle_min[row]) | nothing).all()
        assert ((known <= ranges.angle_max[row]) | nothing).all()
        assert (areas <= ranges.area_max[row]).all()
        assert (areas >= ranges.area_min[row] - 1e-12).all()
    # A polygon of twelve sides around a disc is larger by 1 / cos 15 degrees at most.
    assert ranges.area_max.max() < 1.2 * 3 * np.sqrt(3) / 4 + 0.5


@pytest.mark.parametrize("scale", [1e-3, 1e3])
def test_ranges_go_with_the_solid_when_it_is_moved_and_scaled(scale):
    import trimesh

    solid, rng = model("housing-34"), np.random.default_rng(2)
    pose = random_pose(rng, solid.diameter)
    moved = trimesh.Trimesh(pose.apply(solid.vertices) * scale, solid.triangles, process=False)
    other = PairTables.of(Polyhedron.from_mesh(moved)).triples
    chosen = some_triples(solid.face_count, 400, rng)
    here, there = tables("housing-34").triples.ranges(chosen), other.ranges(chosen)
    np.testing.assert_allclose(there.area_max, scale**2 * here.area_max, rtol=1e-6)
    # Where one face's plane just touches another face, rounding decides what the tilts say.
    alike = np.abs(there.angle_min - here.angle_min) < 1e-3
    alike &= np.abs(there.angle_max - here.angle_max) < 1e-3
    assert alike.mean() > 0.85


def test_what_three_balls_allow_holds_every_triangle_with_points_in_them():
    rng = np.random.default_rng(5)
    for case in range(800):
        points = rng.normal(size=(3, 3))
        if case % 3 == 0:
            points[2] = points[1] + 10.0 ** rng.uniform(-6, 0) * rng.normal(size=3)
        reach = 10.0 ** rng.uniform(-4, 0, 3)
        felt = np.empty((4, 2))
        measured_triangle(points, reach, felt)
        shifts = rng.normal(size=(60, 3, 3))
        shifts /= np.linalg.norm(shifts, axis=2, keepdims=True)
        true = points + shifts * reach[:, None] * rng.choice([0.5, 1.0], (60, 3, 1))
        angles, areas = triangle(*true.swapaxes(0, 1))
        assert (angles >= felt[:3, 0] - 1e-9).all()
        assert (angles <= felt[:3, 1] + 1e-9).all()
        assert (areas >= felt[3, 0] - 1e-12).all()
        assert (areas <= felt[3, 1] + 1e-12).all()


# --- The tree -------------------------------------------------------------------------------


def felt(name: str, count: int, seed: int, *, dist: float = 0.003, awkward: bool = False):
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
        contacts, _ = felt(name, 4, seed, awkward=seed == 2)
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
    contacts, _ = felt("housing-34", 4, 1)
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
    contacts, _ = felt(name, 4, 2)
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
    monkeypatch.setattr(triples, "BLOCK", 100)
    monkeypatch.setattr(triples, "FIRST_SLOTS", 64)
    monkeypatch.setattr(triples, "MOST_SLOTS", 512)
    forgetful = PairTables.of(model(name))
    again = prune(forgetful, contacts, constraints=CHOICES[choice], sort=False)
    np.testing.assert_array_equal(again.faces, leaves.faces)
    np.testing.assert_array_equal(again.nodes, leaves.nodes)


def test_a_spent_budget_is_reported():
    contacts, _ = felt("simple-hand", 4, 5)
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
    contacts, _ = felt("cube", count, 0)
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
        contacts, truth = felt(name, 4, seed, dist=0.002)
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


# --- The truth survives ---------------------------------------------------------------------


@cache
def fresh(name: str) -> TripleTables:
    return TripleTables(tables(name))


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
    solid, rng = model(name), np.random.default_rng(12)
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
