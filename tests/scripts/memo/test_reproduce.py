"""The memo's experiments, rerun: its figures as data, how rows are judged, what is counted."""

from __future__ import annotations

import itertools
import json
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from helpers.shown_page import Shown
from rich.console import Console
from scipy.spatial.transform import Rotation

from palpate.assets import memo
from palpate.envs.sensors.grid import sense_grid
from palpate.envs.sensors.noise import SensorNoise
from palpate.recognizer import Constraints
from palpate.recognizer.tree.tree import prune
from palpate.scripts.commands.reproduce import ORDER, groups, reproduce
from palpate.scripts.memo import constraints as memo_constraints
from palpate.scripts.memo import grid as memo_grid
from palpate.scripts.memo import levels as memo_levels
from palpate.scripts.memo import planar as memo_planar
from palpate.scripts.memo import triads as memo_triads
from palpate.scripts.memo.coarse import SHARE, memo_left, memo_poses
from palpate.scripts.memo.groups import count_groups, directions_of
from palpate.scripts.memo.judge import Row, four, judge
from palpate.scripts.memo.page import as_data, verdict, write_sections
from palpate.scripts.memo.plan import Trials
from palpate.scripts.memo.pool import open_plan
from palpate.scripts.memo.section import Comparison, Section
from palpate.scripts.memo.trial import Spec, count_stages, prepared

INCH = 0.0254


@dataclass
class Here:
    """A plan that runs all cases where it is."""

    trials: int | None = 1
    seed: int = 5

    def map(
        self, function: Callable[[Any], Any], cases: Sequence[Any], label: str
    ) -> Iterable[Any]:
        return map(function, cases)


@pytest.fixture(scope="module")
def sections() -> dict[str, Section]:
    """Every experiment of these modules, one trial a row."""
    made = [
        memo_planar.run(Here()),
        *memo_grid.sections(Here(), memo_grid.NAMES),
        *memo_triads.sections(Here(), memo_triads.NAMES),
        *memo_levels.sections(Here(), memo_levels.NAMES),
        memo_constraints.run(Here()),
    ]
    return {section.name: section for section in made}


# --- The memo's figures -----------------------------------------------------------------------


def test_the_tables_have_as_many_rows_as_the_memo_prints():
    counts = {
        memo.table1: 6,
        memo.table2: 23,
        memo.table4: 23,
        memo.table5: 13,
        memo.table6: 8,
        memo.table7: 8,
        memo.table8: 8,
        memo.table9: 8,
        memo.table10: 14,
        memo.table11: 14,
        memo.range_views: 2,
    }
    assert {table: len(table()) for table in counts} == counts


def test_figures_of_a_row_are_in_order():
    tables = (memo.table2, memo.table4, memo.table6, memo.table7, memo.table8, memo.table9)
    levels = (memo.table10, memo.table11)
    for row in itertools.chain.from_iterable(table() for table in (*tables, *levels)):
        assert 1 <= row.smallest <= row.median <= row.p90 <= row.largest, row


def test_tables_of_the_same_runs_have_the_same_rows():
    def about(rows):
        return [(row.object_name, row.pi_over, row.position_error_in) for row in rows]

    assert about(memo.table2()) == about(memo.table4())
    assert about(memo.table7()) == about(memo.table8()) == about(memo.table9())
    # Each step leaves no more than the one before.
    for before, after in itertools.chain(
        zip(memo.table2(), memo.table4(), strict=True),
        zip(memo.table7(), memo.table8(), strict=True),
        zip(memo.table8(), memo.table9(), strict=True),
    ):
        assert after.median <= before.median
        assert after.largest <= before.largest


def test_histograms_of_table_1_have_the_medians_that_the_text_states():
    """The placing of cells that the print leaves open is checked by it."""
    ends = [*range(1, 11), *range(20, 101, 10), np.inf]
    for row in memo.table1():
        total = sum(row.runs)
        assert total == (247 if (row.object_name, row.direction) == ("wrench", False) else 250)
        at = int(np.searchsorted(np.cumsum(row.runs), total / 2))
        low = 1 if at == 0 else ends[at - 1] + 1
        assert low <= row.median <= ends[at], row
        if row.largest is not None:
            last = int(np.flatnonzero(row.runs)[-1])
            assert row.largest <= ends[last]
    assert len(memo.planar_bins()) == len(ends)


def test_some_figures_are_those_of_the_print():
    assert memo.table4()[2] == memo.CountRow("housing", 15, 0.1, 1, 1, 2, 12)
    assert memo.table6()[4] == memo.ClusterRow("stapler", 10, 0.01, 0.01, 1, 4, 14, 57)
    assert memo.table8()[-1] == memo.CountRow("housing-34", 8, 0.05, 1, 32, 104, 377)
    assert memo.table10()[3] == memo.LevelRow(5, 4, 40, 244, memo.LARGEST_PRINTED)
    assert memo.timing().prune_seconds == 1.27


def test_what_ails_the_print_is_said():
    assert "no figure of it can be trusted" in memo.place("table3").damage
    assert memo.place("table2").section == "4.3"
    with pytest.raises(ValueError, match=r"no 'table12'; there are: table1"):
        memo.place("table12")


# --- The rule ---------------------------------------------------------------------------------


def row(level: float, memo_median: float | None, ours: float) -> Row:
    printed = None if memo_median is None else (1.0, memo_median, 1e4, 1e4)
    return Row((f"{level}",), "box", (level,), printed, (1.0, ours, 1e4, 1e4))


def judged(*rows: Row) -> list[str]:
    comparisons = judge(rows, lambda _: "far", lambda *_: "disordered", "nothing printed")
    return [f"{each.verdict}: {each.why}" if each.why else each.verdict for each in comparisons]


def test_a_median_may_be_off_by_a_factor_of_four_and_no_more():
    assert judged(row(1, 10, 40)) == judged(row(1, 10, 2.5)) == ["within"]
    assert judged(row(1, 10, 40.1)) == ["outside: median 4 times the memo's: far"]
    assert judged(row(1, 10, 2.4)) == ["outside: median 0.24 times the memo's: far"]


def test_a_median_may_not_fall_where_the_memos_rises():
    assert judged(row(1, 10, 12), row(2, 20, 12)) == ["within", "within"]
    first, second = judged(row(1, 10, 12), row(2, 20, 11))
    assert first == "within"
    assert re.match(r"outside: .* from 10 to 20 after 1, ours from 12 to 11: disordered", second)


def test_rows_in_any_order_where_the_memos_are_even():
    assert judged(row(1, 10, 12), row(2, 10, 11)) == ["within", "within"]


def test_a_row_is_compared_with_the_next_lower_one():
    assert judged(row(3, 30, 12), row(1, 10, 20), row(2, 20, 11))[0] == "within"


def test_what_the_memo_does_not_print_is_not_judged():
    assert judged(row(1, None, 12)) == ["not judged: nothing printed"]


def test_four_figures_of_counts():
    assert four(range(1, 102)) == (1.0, 51.0, 91.0, 101.0)


# --- Counting ---------------------------------------------------------------------------------


def test_groups_are_around_the_first_of_each():
    angles = np.radians([0.0, 1.0, 2.0, 10.0, 11.4])
    axes = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(5)])
    # The third is near the second, but not near the first, which leads its group.
    assert count_groups(axes, np.cos(np.radians(1.5))) == 3
    places = INCH * np.array([[0.0, 0, 0], [0.02, 0, 0], [0, 0, 0], [0, 0, 0], [0, 0, 0]])
    assert count_groups(axes, np.cos(np.radians(1.5)), places, 0.01) == 4


def test_directions_of_rotation_are_singular_near_half_a_turn_where_poses_are_not():
    """The memo's rule takes two turns by almost π the other way round for different."""
    turns = Rotation.from_rotvec([[0, 0, np.radians(179.8)], [0, 0, np.radians(-179.8)]])
    axes = directions_of(turns.as_matrix())
    np.testing.assert_allclose(axes, [[0, 0, 1], [0, 0, -1]], atol=1e-9)
    tolerance = np.radians(1.5)
    assert count_groups(axes, np.cos(tolerance)) == 2
    assert (turns[0].inv() * turns[1]).magnitude() < tolerance
    flat = turns.as_matrix().reshape(-1, 9)
    assert count_groups(flat, 1.0 + 2.0 * np.cos(tolerance)) == 1


def test_groups_of_poses_are_those_of_the_angle_between_rotations():
    rng = np.random.default_rng(3)
    turns = Rotation.from_rotvec(0.03 * rng.standard_normal((60, 3)))
    leaders: list[int] = []
    for index in range(60):
        if not any((turns[k].inv() * turns[index]).magnitude() <= 0.026 for k in leaders):
            leaders.append(index)
    assert 5 < len(leaders) < 55
    flat = turns.as_matrix().reshape(-1, 9)
    assert count_groups(flat, 1.0 + 2.0 * np.cos(0.026)) == len(leaders)


def test_bins_of_table_1_take_tens_after_ten():
    counted = dict(
        zip(memo.planar_bins(), memo_planar.binned([1, 10, 11, 20, 21, 100, 101, 900]), strict=True)
    )
    expected = {"1": 1, "10": 1, "11-20": 2, "21-30": 1, "91-100": 1, "over 100": 2}
    assert {name: number for name, number in counted.items() if number} == expected


def test_contacts_sorted_by_pairs_start_with_those_farthest_apart():
    line = np.column_stack([[0.0, 1.0, 5.0, 9.0, 10.0], np.zeros((5, 2))[:, 0], np.zeros(5)])
    # 0-4 are 10 apart, then 0-3 and 1-4 nine, then 1-3 eight.
    assert memo_levels.by_pairs(line).tolist() == [0, 4, 3, 1, 2]


# --- The trials -------------------------------------------------------------------------------


def test_a_trial_of_triads_has_7_to_9_contacts_above_the_plane_on_their_faces():
    model = prepared("simple-hand").model
    for seed in range(20):
        truth = memo_triads.sense_triads("simple-hand", np.random.default_rng(seed))
        assert 7 <= len(truth) <= 9
        assert (truth.points_world[:, 2] > 0.0).all()
        points = truth.T_world_object.inv().apply(truth.points_world)
        above = (points * model.normals[truth.faces]).sum(axis=1) - model.offsets[truth.faces]
        np.testing.assert_allclose(above, 0.0, atol=1e-9)


def test_a_planar_contact_is_the_farthest_crossing_of_its_ray():
    model, _ = memo_planar._prepared("gator")
    for seed in range(20):
        contacts, edges = memo_planar._sense(model, np.random.default_rng(seed))
        # The centroid is the origin; by how much each edge could be off is in the bounds.
        farthest = np.linalg.norm(contacts.positions, axis=1)
        reach = np.linalg.norm(model.segments[edges] - model.centroid, axis=2)
        assert (farthest <= reach.max(axis=1) + 0.1 * INCH).all()
        rays = np.arctan2(*contacts.positions.T[::-1]) - 2 * np.pi * np.arange(5) / 5
        off = np.abs((rays + np.pi) % (2 * np.pi) - np.pi) * farthest
        assert (off <= 0.1 * INCH + 1e-9).all()


def test_levels_of_the_tree_are_trees_of_the_first_contacts():
    thing, spec = prepared("simple-hand"), memo_levels.SPEC
    rng = np.random.default_rng(2)
    truth = memo_triads.sense_triads("simple-hand", rng)
    contacts = truth.noisy(spec.noise(), rng)
    alive, last = memo_levels._grown(thing.tables, contacts)
    for level in range(1, len(contacts) + 1):
        alone = prune(thing.tables, contacts[:level], constraints=Constraints(), sort=False)
        assert alive[level - 1] == len(alone.faces)
    assert (last == truth.faces).all(axis=1).any()


def test_the_memos_pose_of_exact_contacts_puts_them_on_their_faces():
    thing, rng = prepared("housing"), np.random.default_rng(4)
    truth = sense_grid(thing.model, rng)
    contacts = truth.noisy(SensorNoise(position_error=1e-9, normal_error=1e-7), rng)
    others = prune(thing.tables, truth.noisy(Spec("housing", 8, 0.1).noise(), rng)).faces
    rows = np.unique(np.vstack([others[:20], truth.faces]), axis=0)
    poses = memo_poses(thing.model, rows, truth.faces, contacts)
    assert (rows[poses.right] == truth.faces).all()
    assert poses.misses_in[poses.right] < 1e-4
    turn = truth.T_world_object.rotation.as_rotvec()
    along = turn / np.linalg.norm(turn) @ poses.directions[poses.right]
    assert along == pytest.approx(1.0, abs=1e-6)
    wrong = np.delete(poses.misses_in, poses.right)
    assert (wrong > 10 * poses.misses_in[poses.right]).all()


def test_the_memos_range_lets_the_right_one_pass_in_nine_trials_of_ten():
    counts = memo_triads.run_piece(Trials((Spec("simple-hand", 10, 0.01), "memo"), 0, 0, 10))
    trials = [trial.memo_poses for trial in counts if trial.memo_poses is not None]
    left = memo_left(trials)
    passed = [trial.misses_in[trial.right] <= left.range_in for trial in trials]
    assert SHARE <= np.mean(passed) < 1.0
    for trial, kept, transforms in zip(counts, left.interpretations, left.directions, strict=True):
        assert kept <= trial.pruned
        assert 1 <= transforms <= max(kept, 1)


def test_a_trial_that_loses_the_right_interpretation_says_so():
    rng = np.random.default_rng(6)
    truth = memo_triads.sense_triads("simple-hand", rng)
    contacts = truth.noisy(Spec("simple-hand", 10, 0.01).noise(), rng)
    wrong = replace(truth, faces=truth.faces[::-1].copy())
    for stage in ("tree", "test"):
        assert count_stages("simple-hand", truth, contacts, stage).kept
        assert not count_stages("simple-hand", wrong, contacts, stage).kept


def test_no_stage_leaves_more_than_the_one_before():
    for trial in memo_triads.run_piece(Trials((Spec("housing-34", 8, 0.05), "test"), 0, 0, 5)):
        assert trial.kept
        assert trial.pruned >= trial.tested >= trial.poses[0] >= trial.poses[1] >= 1
        assert trial.tested >= trial.shifted[0] >= trial.shifted[1] >= trial.directions >= 1


# --- The sections -----------------------------------------------------------------------------


def test_every_printed_row_is_in_its_section(sections):
    for name in ("table2", "table4", "table7", "table8", "table9"):
        rows = getattr(memo, name)()
        assert [each.key for each in sections[name].comparisons] == [
            (r.object_name, f"π/{r.pi_over}", f"{r.position_error_in:.2f} in") for r in rows
        ]
        printed = [(r.smallest, r.median, r.p90, r.largest) for r in rows]
        assert [each.memo for each in sections[name].comparisons] == printed
    for name, count in (("table1", 6), ("table3", 23), ("table6", 8), ("figure8", 6)):
        assert len(sections[name].comparisons) == count
    for name in ("table10", "table11"):
        assert [each.key for each in sections[name].comparisons] == [
            (f"{level}",) for level in range(2, 16)
        ]


def test_table_3_shows_no_figure_of_the_damaged_print(sections):
    assert all(each.memo is None for each in sections["table3"].comparisons)
    assert "damaged" in sections["table3"].done


def test_the_right_interpretation_is_never_discarded(sections):
    for section in sections.values():
        assert section.checked > 0, section.name
        assert section.lost == 0, section.name


def test_a_row_outside_the_rule_says_why(sections):
    for section in sections.values():
        for each in section.comparisons:
            assert bool(each.why) == (each.verdict != "within"), (section.name, each)


def test_the_direction_constraint_leaves_no_more_than_its_absence(sections):
    ours = {each.key: each.ours for each in sections["table1"].comparisons}
    for name in ("wrench", "gator", "hand"):
        assert ours[name, "with direction"][0] <= ours[name, "without"][0]


def test_adding_a_constraint_never_leaves_more():
    piece = Trials((Spec("simple-hand", 10, 0.05), "triads"), 3, 0, 3)
    sets = list(memo_constraints.SETS.values())
    for trial in memo_constraints.run_piece(piece):
        for (fewer, a), (more, b) in itertools.permutations(zip(sets, trial.left, strict=True), 2):
            if set(fewer) < set(more):
                assert b <= a, (fewer, more)


def test_a_trial_does_not_depend_on_the_piece_that_it_is_in():
    def run(first: int, stop: int) -> list[Any]:
        return memo_planar.run_piece(Trials("gator", 7, first, stop - first))

    assert run(0, 4) == run(0, 1) + run(1, 3) + run(3, 4)
    assert run(0, 4) != run(4, 8)


def test_two_processes_give_results_in_the_order_of_their_cases():
    cases = [[1], [11, 12], [500], [3, 3, 3]]
    with open_plan(None, 0, 2, Console(quiet=True)) as plan:
        assert [*plan.map(memo_planar.binned, cases, "")] == [*map(memo_planar.binned, cases)]


# --- The page and the command -----------------------------------------------------------------


def test_the_page_stands_alone_and_says_the_same_in_all_forms(sections, tmp_path):
    shown = [sections["table1"], sections["table2"]]
    stem = write_sections(
        shown, "palpate reproduce table1 table2 --out FOLDER", tmp_path / "new", 2
    )
    page = Shown(stem.with_suffix(".html").read_text(encoding="utf-8"))
    text = stem.with_suffix(".md").read_text(encoding="utf-8")
    data = json.loads(stem.with_suffix(".json").read_text(encoding="utf-8"))
    assert page.loaded == []
    for word in (shown[0].found, verdict(shown), "--out FOLDER"):
        assert word in text
        assert word in page.text
    drawings = re.findall(r"\]\(([^)]*\.svg)\)", text)
    assert page.drawings == [(stem.parent / drawing).read_bytes() for drawing in drawings]
    assert len(drawings) == 2
    assert [each["name"] for each in data["experiments"]] == ["table1", "table2"]
    assert len(data["experiments"][1]["rows"]) == 23


def test_what_is_no_number_is_null_in_json(sections):
    row = Comparison(("a",), ("x", "y"), None, (float("nan"), 1.0), "not judged", "why")
    odd = replace(sections["table1"], comparisons=(row,))
    assert as_data([odd], "")["experiments"][0]["rows"][0]["memo"] is None
    assert as_data([odd], "")["experiments"][0]["rows"][0]["ours"] == [None, 1.0]


def test_a_lost_interpretation_would_be_told(sections):
    assert "missing 3 times" in verdict([replace(sections["table1"], lost=3)])


def test_the_command_prints_rows_and_writes_the_page(tmp_path, capsys):
    reproduce(["table10"], trials=2, seed=0, workers=1, out=tmp_path)
    printed = capsys.readouterr().out
    assert "Table X" in printed
    assert "discarded in 0 of 2 trials" in " ".join(printed.split())
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "memo738-table10.svg",
        "memo738.html",
        "memo738.json",
        "memo738.md",
    ]


def test_a_wrong_experiment_or_folder_is_refused_before_anything_runs(tmp_path):
    with pytest.raises(ValueError, match=r"no experiment is called 'table0'; there are: table1, "):
        reproduce(["table2", "table0"], trials=1, seed=0)
    file = tmp_path / "page"
    file.write_text("")
    with pytest.raises(ValueError, match="is a file: --out takes a folder"):
        reproduce(["table2"], trials=1, seed=0, out=file)


def test_every_experiment_has_one_module_that_runs_it():
    names = [name for group in groups() for name in group]
    assert sorted(names) == sorted(ORDER)
