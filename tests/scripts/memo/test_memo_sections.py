"""The memo's experiments rerun: pose errors, range data, bounds on the tree, running times."""

from __future__ import annotations

import itertools
import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import pytest
from helpers.shown_page import Shown
from oracles import solids as oracles

from palpate.assets.memo import range_views, table5, timing
from palpate.recognizer import Contacts
from palpate.recognizer.tree.tree import Pruned
from palpate.scripts.memo import timing as memo_timing
from palpate.scripts.memo import timing_trials as memo_timing_trials
from palpate.scripts.memo.bounds import bounds as memo_bounds
from palpate.scripts.memo.bounds import counts as memo_bounds_counts
from palpate.scripts.memo.bounds.counts import (
    COUNTERS,
    LEVELS,
    SHAPES,
    count_chains,
    count_tuples,
    make_shape,
)
from palpate.scripts.memo.errors import errors as memo_errors
from palpate.scripts.memo.errors import trials as memo_errors_trials
from palpate.scripts.memo.page import write_sections
from palpate.scripts.memo.plan import Trials
from palpate.scripts.memo.range import range as memo_range
from palpate.scripts.memo.range import trials as memo_range_trials
from palpate.scripts.memo.range.trials import generator, interpret, memo_noise, readings, take_view
from palpate.scripts.memo.section import Experiment, Figure, Section
from palpate.scripts.memo.trial import Spec

EXPERIMENTS: dict[str, Experiment] = {
    "table5": memo_errors.run,
    "range": memo_range.run,
    "bounds": memo_bounds.run,
    "timing": memo_timing.run,
}
every_experiment = pytest.mark.parametrize("name", EXPERIMENTS)
TRIALS = 2


@dataclass
class Serial:
    """A plan without other processes, that counts what it was asked to do."""

    trials: int | None
    seed: int
    asked: int = 0

    def map(self, function: Callable, cases: Sequence, label: str) -> list[Any]:
        assert label
        self.asked += sum(case.count for case in cases)
        return [function(case) for case in cases]


@cache
def section(name: str) -> tuple[Section, int]:
    plan = Serial(TRIALS, seed=0)
    return EXPERIMENTS[name](plan), plan.asked


def figures(found: Section) -> list[Figure]:
    return [block for block in found.blocks if isinstance(block, Figure)]


# --- All of them ----------------------------------------------------------------------------


@every_experiment
def test_no_trial_loses_the_right_interpretation_and_every_trial_is_counted(name):
    found, asked = section(name)
    assert (found.checked, found.lost) == (asked, 0)
    assert found.checked >= 2 * TRIALS


@every_experiment
def test_a_section_says_what_it_is_about_and_makes_a_page(name, tmp_path):
    found, _ = section(name)
    assert found.name == name
    assert found.place.startswith("Section")
    for text in (found.title, found.asked, found.done, found.found):
        assert text
        assert "nan" not in text
    stem = write_sections([found], "palpate reproduce", tmp_path)
    shown = Shown(stem.with_suffix(".html").read_text(encoding="utf-8"))
    assert len(shown.drawings) == len(figures(found)) >= 1
    for text in (found.title, found.asked, found.done, found.found):
        assert text in shown.text
    for figure in figures(found):
        assert figure.caption in shown.text
    assert not [cell for line in shown.lines for cell in line if "nan" in cell]


@every_experiment
def test_figures_are_drawings_that_parse(name):
    drawn = figures(section(name)[0])
    assert len({figure.name for figure in drawn}) == len(drawn)
    for figure in drawn:
        assert figure.caption
        root = ElementTree.fromstring(figure.svg[figure.svg.index("<svg") :])
        assert len(list(root.iter())) > 50


@every_experiment
def test_every_row_has_a_verdict_and_a_reason_unless_it_is_within(name):
    rows = section(name)[0].comparisons
    assert rows
    assert len({row.key for row in rows}) == len(rows)
    for row in rows:
        assert len(row.names) == len(row.ours)
        assert (row.verdict == "within") == (not row.why)


@pytest.mark.parametrize("name", ["table5", "range"])
def test_the_same_seed_gives_the_same_section_and_another_one_another(name):
    assert EXPERIMENTS[name](Serial(TRIALS, seed=0)) == section(name)[0]
    other = EXPERIMENTS[name](Serial(1, seed=1))
    assert other.comparisons != section(name)[0].comparisons


def find_nothing(*arguments: Any, **named: Any) -> Pruned:
    """A tree that drops everything."""
    contacts = next(one for one in arguments if isinstance(one, Contacts))
    return Pruned(np.zeros((0, len(contacts)), np.int32), np.zeros(len(contacts), np.int64), True)


@pytest.mark.parametrize(
    ("module", "measure"),
    [
        (
            memo_errors_trials,
            lambda: memo_errors.measure_errors(Trials(Spec("housing", 10, 0.05), 0, 0, 3)),
        ),
        (memo_range_trials, lambda: memo_range.scan_views(Trials(9, 0, 0, 3))),
        (memo_bounds_counts, lambda: memo_bounds.count_nodes(Trials("cube", 0, 0, 3))),
        (
            memo_timing_trials,
            lambda: memo_timing.measure_times(Trials(Spec("housing", 10, 0.05), 0, 0, 3)),
        ),
    ],
)
def test_a_tree_that_drops_the_right_interpretation_is_found_out(module, measure, monkeypatch):
    assert measure().lost == 0
    monkeypatch.setattr(module, "prune", find_nothing)
    assert measure().lost == 3


# --- Table V --------------------------------------------------------------------------------


def test_every_row_of_table_v_is_there_and_damaged_ones_are_not_judged():
    rows = section("table5")[0].comparisons
    assert [row.key for row in rows] == [
        (row.object_name, f"π/{row.pi_over}", f"{row.position_error_in:.2f} in") for row in table5()
    ]
    assert len(rows) == 13
    for row, printed in zip(rows, table5(), strict=True):
        assert row.memo == (printed.direction_deg, printed.angle_deg, printed.translation_in)
        assert (row.verdict == "not judged") == (not printed.sure)


# --- Section 5 ------------------------------------------------------------------------------


def test_both_views_have_as_many_points_as_the_memos():
    rows = section("range")[0].comparisons
    assert [row.memo for row in rows] == [(9.0, 3.0), (11.0, 2.0)]
    for view in range_views():
        seen = take_view(view.points, generator(3, view.points, 0))
        assert len(seen.contacts) == view.points
        triples = itertools.combinations(seen.model.normals[seen.faces], 3)
        assert max(abs(np.linalg.det(triple)) for triple in triples) > 0.1


def test_what_the_recogniser_is_given_of_a_view_is_within_its_bounds():
    bounds, spread = memo_noise(), []
    for trial in range(6):
        rng = generator(4, 9, trial)
        seen = take_view(9, rng)
        pose, rows = seen.T_world_object, seen.faces
        for given in readings(seen, rng):
            # The nearest the point may be to its face is its distance from the face's plane.
            local = pose.inv().apply(given.positions)
            heights = (local * seen.model.normals[rows]).sum(axis=1) - seen.model.offsets[rows]
            assert (np.abs(heights) <= given.position_error).all()
            right = pose.rotation.apply(seen.model.normals[rows])
            leans = [
                oracles.angle_between(*pair) for pair in zip(given.normals, right, strict=True)
            ]
            assert (leans <= given.normal_error).all()
            spread.append(max(leans))
            assert interpret(seen, given)[2]
    # As read, filling the memo's bounds, in the scanner's own.
    as_read, filled, own = np.reshape(spread, (6, 3)).T
    np.testing.assert_array_equal(as_read, own)
    assert as_read.max() < 0.2 * bounds.normal_error < filled.min()


# --- Section 6 ------------------------------------------------------------------------------


def random_fits(rng: np.random.Generator, faces: int) -> dict[tuple[int, int], np.ndarray]:
    pairs = itertools.combinations(range(LEVELS), 2)
    return {pair: rng.random((faces, faces)) < 0.6 for pair in pairs}


def test_counts_are_those_of_a_plain_enumeration():
    rng = np.random.default_rng(0)
    for faces in (1, 2, 5):
        fits = random_fits(rng, faces)
        for level in range(1, LEVELS + 1):
            everything = list(itertools.product(range(faces), repeat=level))
            together = [
                all(fits[i, j][t[i], t[j]] for i, j in itertools.combinations(range(level), 2))
                for t in everything
            ]
            in_row = [
                all(fits[i, i + 1][t[i], t[i + 1]] for i in range(level - 1)) for t in everything
            ]
            assert count_tuples(fits, level) == sum(together)
            assert count_chains(fits)[level - 1] == sum(in_row)


def test_each_counter_counts_no_more_than_the_one_before():
    nodes = np.concatenate([memo_bounds.count_nodes(case).nodes for case in some_cases()])
    middles, ranges, distances, everything = nodes.swapaxes(0, 1)
    assert COUNTERS[0] == "chain of middles"
    assert (ranges <= middles).all()
    assert (distances <= ranges).all()
    assert (everything <= distances).all()
    assert (everything >= 1).all()


def some_cases() -> list[Trials[str]]:
    return [Trials(name, 0, 0, 3) for name in ("cube", "housing", "50-gon", "gator")]


def test_shapes_of_equal_faces_have_equal_faces():
    for name in SHAPES:
        shape = make_shape(name)
        model: Any = shape.model
        sizes = model.lengths if hasattr(model, "lengths") else model.areas
        assert shape.equal == (sizes.max() < 1.3 * sizes.min())
    assert make_shape("sphere").model.face_count == 320


def test_a_formula_is_broken_only_by_a_mean_that_is_surely_above_it():
    formula = np.array([1.0, 10.0, 10.0, 10.0])
    steady = np.tile([1.0, 11.0, 10.0, 9.0], (20, 1))
    assert memo_bounds.exceeds(steady, formula).tolist() == [False, True, False, False]
    rng = np.random.default_rng(0)
    scattered = 11.0 + 20.0 * rng.standard_normal((20, LEVELS))
    assert not memo_bounds.exceeds(scattered, formula)[1:].any()
    assert not memo_bounds.exceeds(steady[:1], formula).any()


def test_the_printed_corollary_is_broken_on_solids_and_proposition_1_is_not():
    for name in ("cube", "icosahedron", "housing", "stapler"):
        nodes = memo_bounds.count_nodes(Trials(name, 0, 0, 12)).nodes
        first, corollary = memo_bounds.compare(make_shape(name), nodes)
        assert first.key == (name, "Proposition 1")
        assert first.verdict == "within"
        assert corollary.verdict == "outside"
        assert corollary.memo is not None
        assert np.greater(corollary.ours, corollary.memo).all()


# --- Section 7 ------------------------------------------------------------------------------


def test_times_are_beside_the_memos_and_are_not_judged():
    (row,) = section("timing")[0].comparisons
    memo = timing()
    assert row.memo == (memo.prune_seconds, memo.test_seconds, memo.seconds_a_test)
    assert row.verdict == "not judged"
    prune, tests, a_test = row.ours
    assert 0.0 < a_test <= tests < memo.test_seconds
    assert 0.0 < prune < memo.prune_seconds


def test_growth_is_the_power_of_the_number_of_interpretations():
    counts = np.array([1.0, 3.0, 10.0, 40.0, 200.0, 1000.0])
    rows = np.column_stack([counts, 2.0 * counts**0.3, 5.0 * counts, counts, counts])
    # What fewer than ten interpretations take is not looked at.
    rows[:2, 1:] = 7.0
    assert memo_timing.growth(rows, 1) == pytest.approx(0.3)
    assert memo_timing.growth(rows, 2) == pytest.approx(1.0)
    assert math.isnan(memo_timing.growth(rows[:3], 1))
