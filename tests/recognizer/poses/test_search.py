"""What the search rules out, feature by feature, and what it finds in the end."""

from __future__ import annotations

from collections import Counter
from typing import Literal

import numpy as np
import pytest
from helpers.beliefs import interpretations_of
from helpers.constraints import NAMES, only
from helpers.fitting import Fitter
from helpers.sensing import INCH, SMALL, feel, forget_normals, sense_grid, touch_features
from numpy.typing import NDArray
from oracles import solids as oracles
from oracles.checker import check
from oracles.samples import STAND_INS, TESTS, draw

from palpate.recognizer import Belief, Contacts, PairTables, Polyhedron, Recognizer
from palpate.recognizer.models.features import Features, all_features, face_features
from palpate.recognizer.poses.fits.pose import kernel_contacts
from palpate.recognizer.tables.ranges import pack_tables
from palpate.recognizer.tree.mask_kernels import narrow, pair_readings
from palpate.recognizer.tree.tree import prune

Floats = NDArray[np.float64]
ROWS = ((np.pi / 12, 0.01), (np.pi / 10, 0.01), (np.pi / 8, 0.05), (np.pi / 8, 0.1))
"""Bounds on normals (radians) and positions (inches)."""


def pairs_that_fit(
    features: Features, tables: Floats, contacts: Contacts, pair: tuple[int, int], switches: int
) -> NDArray[np.bool_]:
    """(f, f) which features of two contacts `narrow` lets go together."""
    count, words = len(features), -(-len(features) // 64)
    errors, readings = contacts.normal_error, np.empty((len(contacts), len(contacts), 9))
    pair_readings(kernel_contacts(contacts), errors, readings)
    kept, everything = np.empty(words, np.uint64), np.zeros(64 * words, np.uint8)
    everything[:count] = 1
    domain = np.packbits(everything, bitorder="little").view(np.uint64)
    found = np.empty((count, count), bool)
    for a in range(count):
        half, (one, other) = features.half_angles[a], pair
        bounds = errors[one], errors[other]
        size = narrow(a, tables, half, readings[pair], *bounds, switches, domain, kept)
        found[a] = np.unpackbits(kept.view(np.uint8), bitorder="little")[:count]
        assert size == found[a].sum()
    return found


@pytest.mark.parametrize("name", ["L-block", "holed", "housing", "complex-hand"])
def test_pairs_of_faces_go_together_as_the_memo_has_it(name: str) -> None:
    model, rng = (SMALL | STAND_INS)[name], np.random.default_rng(13)
    features, tables = face_features(model), PairTables.of(model)
    packed, both = pack_tables(tables), Counter()
    for case in range(12):
        contacts, _ = oracles.random_contacts(
            model,
            oracles.random_pose(rng, 1.0),
            2,
            rng,
            position_error=rng.uniform(0.0, 0.003, 2) + 1e-6,
            normal_error=rng.choice([0.02, 0.3, 1.5, np.pi], 2),
            awkward=True,
            at_bounds=case % 2 == 0,
        )
        for chosen in (*((name,) for name in NAMES), NAMES[:3], NAMES):
            switches = only(chosen).bits
            found = pairs_that_fit(features, packed, contacts, (0, 1), switches)
            margins = oracles.pair_margins(tables, contacts, 0, 1, chosen)
            sure = np.abs(margins) > 1e-9
            np.testing.assert_array_equal(found[sure], margins[sure] >= 0.0)
            both.update(found.ravel().tolist())
    assert min(both.values()) > 100


def test_pairs_of_edges_and_vertices_that_were_touched_go_together() -> None:
    rng, rest = np.random.default_rng(14), []
    packed = [pack_tables(PairTables.of(model, test.features)) for model, test in TESTS]
    tests = [test for _, test in TESTS]
    for _ in range(60):
        sample = draw(rng, 2, 6)
        tables = packed[tests.index(sample.kernel)]
        for chosen in (*((name,) for name in NAMES), NAMES):
            switches = only(chosen).bits
            found = pairs_that_fit(sample.features, tables, sample.contacts, (0, 1), switches)
            if (sample.faces[:2] >= 0).all():
                assert found[tuple(sample.faces[:2])]
                rest.append(found.mean())
    assert np.mean(rest) < 0.8


def recognized(
    model: Polyhedron, contacts: Contacts, features: Literal["faces", "all"] = "faces"
) -> tuple[set[tuple[int, ...]], Belief]:
    belief = Recognizer([model], features=features).recognize(contacts)
    assert belief.complete
    return interpretations_of(belief), belief


@pytest.mark.parametrize("name", [*SMALL, "stapler", "housing"])
def test_the_search_finds_what_the_tree_and_the_model_test_find(name: str) -> None:
    # Of the cube it looks at one of the symmetric copies only; of the others, at poses early.
    model, rng = (SMALL | STAND_INS)[name], np.random.default_rng(15)
    tables, test = PairTables.of(model), Fitter(model)
    for case in range(2):
        touches = (
            sense_grid(model, rng, 5, 16)
            if name in STAND_INS
            else touch_features(model, test.features, rng, int(rng.integers(3, 7)))
        )
        row = ROWS[case % 2]
        contacts = feel(touches, rng, row[1] * INCH, row[0], at_bounds=case == 0)
        leaves = prune(tables, contacts, budget=200_000)
        assert leaves.complete
        poses = test.run(leaves.faces, contacts)
        expected = oracles.as_set(poses.faces)
        assert tuple(touches.faces.tolist()) in expected
        found, belief = recognized(model, contacts)
        assert found == expected
        proven = [hypothesis for hypothesis in belief.hypotheses if hypothesis.proven]
        assert proven
        for hypothesis in proven:
            first = hypothesis.interpretations[0]
            assert check(model, hypothesis.pose, contacts, first).passed


@pytest.mark.parametrize(("name", "count"), [("cube", 3), ("L-block", 5)])
def test_a_search_over_edges_and_vertices_finds_what_trying_all_of_them_finds(
    name: str, count: int
) -> None:
    model, rng = SMALL[name], np.random.default_rng(16)
    features = all_features(model)
    packed = pack_tables(PairTables.of(model, features))
    test = Fitter(model, features, nodes=10_000)
    touches = touch_features(model, features, rng, count)
    contacts = feel(touches, rng, 0.0002, 0.02)
    rows = np.zeros((1, 0), np.int32)
    for j in range(count):
        more = np.tile(np.arange(len(features), dtype=np.int32), len(rows))
        rows = np.column_stack([np.repeat(rows, len(features), axis=0), more])
        for i in range(j):
            fits = pairs_that_fit(features, packed, contacts, (i, j), 7)
            rows = rows[fits[rows[:, i], rows[:, j]]]
    poses = test.run(np.ascontiguousarray(rows), contacts)
    expected = oracles.as_set(poses.faces[poses.proven]) | {tuple(touches.faces.tolist())}
    assert expected <= recognized(model, contacts, "all")[0]


@pytest.mark.parametrize("name", ["cube", "L-block"])
def test_a_search_without_normals_finds_what_the_tree_and_the_model_test_find(name: str) -> None:
    model, rng = SMALL[name], np.random.default_rng(21)
    tables, test = PairTables.of(model), Fitter(model, nodes=10_000)
    touches = touch_features(model, test.features, rng, 5)
    contacts = forget_normals(feel(touches, rng, 0.0005, 0.1), np.arange(5) != 0)
    poses = test.run(prune(tables, contacts).faces, contacts)
    expected = oracles.as_set(poses.faces[poses.proven]) | {tuple(touches.faces.tolist())}
    assert expected <= recognized(model, contacts)[0]
