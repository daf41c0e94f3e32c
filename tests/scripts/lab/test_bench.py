"""The benchmark counts what it says, sees the same cases each time, and says what was missed."""

from __future__ import annotations

from time import perf_counter

import numpy as np
from helpers.processes import HEAVY, loaded_by
from oracles.solids import model, tables

from palpate.envs.probe_env import INCH
from palpate.envs.sensors.noise import SensorNoise
from palpate.recognizer import Belief, Recognizer, pose_difference
from palpate.recognizer.tree.tree import prune
from palpate.scripts.lab.bench import accuracy as bench_accuracy
from palpate.scripts.lab.bench import icp as bench_icp
from palpate.scripts.lab.bench import limit as bench_limit
from palpate.scripts.lab.bench import report as bench_report
from palpate.scripts.lab.bench import scale as bench_scale
from palpate.scripts.lab.bench import speed as bench_speed
from palpate.scripts.lab.bench import start as bench_start
from palpate.scripts.lab.bench.report import Row, Section, Settings, draw_cases
from palpate.scripts.memo.noise import noise_of


def test_the_commands_help_loads_nothing_heavy():
    assert not HEAVY & loaded_by("import palpate.scripts.lab.bench")


def test_operations_are_counted_as_by_hand():
    # Three contacts, 70 faces in two words: 5 interpretations of one contact meet two contacts
    # more, 7 of two meet one, each with a row of 70 faces.
    assert bench_speed.operations(70, np.array([5, 7, 2])) == (8 * 17 * 70, 17 * 2)
    # However many interpretations, a contact has no more rows than there are faces.
    assert bench_speed.operations(6, np.array([6, 100, 9])) == (8 * 18 * 6, 6 * 2 + 100)


def test_floor_counts_the_interpretations_that_pruning_sees():
    noise = noise_of(10, 0.05)
    (case,) = draw_cases([model("housing")], noise, (16, 16), Settings(cases=1))
    nodes = prune(tables("housing"), case.contacts).nodes
    assert nodes[0] == 40
    assert bench_speed.operations(40, nodes)[1] >= 40 * 15


def test_shares_are_of_the_time_by_the_clock_and_add_up():
    (case,) = draw_cases([model("housing")], noise_of(10, 0.05), (16, 16), Settings(cases=1))
    recognizer = Recognizer([model("housing")])
    started = perf_counter()
    belief = recognizer.recognize(case.contacts)
    spent = perf_counter() - started
    said = bench_speed.shares([belief], spent)
    percents = [int(part.split()[-1].rstrip("%")) for part in said.split(", ")[-2:]]
    assert all(0 <= percent <= 100 for percent in percents)
    assert "rest 50%" in bench_speed.shares([belief], 2.0 * _stages(belief))


def _stages(belief: Belief) -> float:
    return sum(bench_speed.stage_seconds(belief).values())


def test_rates_are_those_of_a_processor():
    rates = list(bench_speed.rates())
    assert rates
    for rate in rates:
        assert 1e7 < rate < 1e12


def test_cases_are_the_same_for_a_seed_and_take_models_in_turn():
    models = [model("l-block"), model("housing")]
    noise = SensorNoise(position_error=0.001, normal_error=0.2)
    one, again = (draw_cases(models, noise, (6, 12), Settings(cases=5)) for _ in range(2))
    assert [case.model.name for case in one] == ["l-block", "housing"] * 2 + ["l-block"]
    for a, b in zip(one, again, strict=True):
        assert np.array_equal(a.contacts.positions, b.contacts.positions)
        assert 6 <= len(a.contacts) <= 12
    other = draw_cases(models, noise, (6, 12), Settings(cases=1, seed=1))[0]
    assert not np.array_equal(other.contacts.normals[:6], one[0].contacts.normals[:6])


def test_what_misses_its_goal_is_marked(capsys):
    rows = [
        Row("one", "3 ms", "2 ms", False, ["why"]),
        Row("two", "1 s", "2 s", True),
        Row("x", ""),
    ]
    bench_report.show(Section("title", rows, "note"))
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[-1] for line in lines if line] == [
        "title", "MISSED", "why", "met", "x", "note",
    ]  # fmt: skip


def test_icp_and_the_recogniser_are_given_the_same_contacts(monkeypatch):
    monkeypatch.setattr(bench_icp, "SETTINGS", (bench_icp.Setting("simple-hand", 10, 0.05, 12),))
    (row,) = bench_icp.measure_icp(Settings(cases=3)).rows
    assert row.what == "simple-hand, π/10, 0.05 in, 12 contacts"
    assert row.met is None
    assert "held in 100.0%" in row.details[0]


def test_icp_is_beside_each_speed_goal_of_one_object():
    counted = [(s.name, s.pi_over, s.inches) for s in bench_icp.SETTINGS if s.counts]
    assert counted == [("housing", 10, 0.05), ("complex-hand", 10, 0.05), ("stapler", 8, 0.10)]
    ours, theirs, sure = [0.001], [0.026], [True]
    setting = bench_icp.SETTINGS[0]
    for first, rival, met in ((sure, [False], True), (sure, sure, False), ([False], sure, False)):
        assert bench_icp._row(setting, ours, theirs, [first, sure, rival]).met is met
    assert bench_icp._row(setting, ours, [0.024], [sure, sure, [False]]).met is False


def test_a_library_is_built_once_and_then_read(tmp_path):
    settings = Settings(cases=10, library=5, folder=tmp_path)
    first, again = (bench_scale.measure_scale(settings).rows for _ in range(2))
    assert first[0].what == "tables of 5 models, built"
    assert len(list(tmp_path.iterdir())) == 5
    assert [row.what for row in again] == [row.what for row in first[1:]]
    (belief,) = (row for row in first if row.goal == "1 s")
    assert belief.met
    assert "held in 2 of 2" in belief.details[-1]
    assert [row.what.split(",")[-1] for row in first[-4:]] == [
        f" {touches} contacts (mean)" for touches in (4, 8, 12, 16)
    ]


def test_the_first_belief_is_of_a_process_of_its_own(monkeypatch):
    monkeypatch.setattr(bench_start, "RUNS", 1)
    row, parts_row = bench_start.measure_start(Settings(cases=1)).rows
    assert float(parts_row.here.split()[0]) > 0.0
    whole = float(row.here.split()[0])
    parts = [float(part.split()[-2]) for part in row.details[0].split(";")[0].split(", ")]
    assert len(parts) == 3
    assert 0.0 < sum(parts) < whole


def test_the_mean_of_all_poses_is_nearer_than_the_bounds_and_the_same_for_a_seed():
    cases = draw_cases([model("simple-hand")], noise_of(10, 0.05), (16, 16), Settings(cases=4))
    errors = []
    for case in cases:
        pose = bench_limit.mean_pose(case)
        assert np.array_equal(bench_limit.mean_pose(case).as_matrix(), pose.as_matrix())
        other = bench_limit.mean_pose(case, seed=1)
        assert pose_difference(case.model, pose, other).rotation < np.radians(0.2)
        errors.append(pose_difference(case.model, pose, case.truth.T_world_object))
    assert 0.0 < np.mean([error.rotation for error in errors]) < np.radians(1.2)
    assert 0.0 < np.mean([error.translation for error in errors]) < 0.05 * INCH


def test_errors_are_near_what_the_noise_allows(monkeypatch):
    first = bench_accuracy.table5()[:1]
    monkeypatch.setattr(bench_accuracy, "table5", lambda: first)
    monkeypatch.setattr(bench_accuracy, "PLAIN_ROWS", ())
    (row,) = bench_accuracy.measure_accuracy(Settings(cases=12)).rows
    degrees, inches = (float(part.split()[0].rstrip("°")) for part in row.here.split(","))
    assert 0.02 < degrees < 0.3
    assert 0.0005 < inches < 0.01
    assert row.met
