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
