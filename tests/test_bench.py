"""The benchmark counts what it says, sees the same cases each time, and says what was missed."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
from oracles import model, tables

from palpate.envs.sensor import SensorNoise
from palpate.recognizer.tree import prune
from palpate.scripts import bench_accuracy, bench_icp, bench_report, bench_speed
from palpate.scripts.bench_report import Row, Section, Settings, draw_cases, noise_of


def test_the_commands_help_loads_nothing_heavy():
    run = (
        "import sys, palpate.scripts.bench\n"
        "heavy = {'numpy', 'scipy', 'mujoco', 'numba', 'trimesh', 'gymnasium'}\n"
        "assert not heavy & set(sys.modules)\n"
    )
    assert subprocess.run([sys.executable, "-c", run], check=False, timeout=60).returncode == 0


def test_operations_are_counted_as_by_hand():
    # Three contacts, 70 faces in two words: 3 pairs of 70 x 70 faces; 5 interpretations of one
    # contact meet two contacts more, 7 of two meet one.
    assert bench_speed.operations(70, np.array([5, 7, 2])) == (8 * 3 * 4900, (5 * 2 + 7) * 2)


def test_floor_counts_the_interpretations_that_pruning_sees():
    noise = noise_of(10, 0.05)
    (case,) = draw_cases([model("housing")], noise, (16, 16), Settings(cases=1))
    nodes = prune(tables("housing"), case.contacts).nodes
    assert nodes[0] == 40
    assert bench_speed.operations(40, nodes)[1] >= 40 * 15


def test_rates_are_those_of_a_processor():
    for rate in bench_speed.rates():
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
    monkeypatch.setattr(bench_icp, "ROWS", (("simple-hand", 12),))
    (row,) = bench_icp.measure_icp(Settings(cases=3)).rows
    assert row.what == "simple-hand, 12 contacts"
    assert "held in 100.0%" in row.details[0]


def test_errors_are_near_what_the_noise_allows(monkeypatch):
    monkeypatch.setattr(bench_accuracy, "TABLE_V", bench_accuracy.TABLE_V[:1])
    monkeypatch.setattr(bench_accuracy, "PLAIN_ROWS", ())
    (row,) = bench_accuracy.measure_accuracy(Settings(cases=12)).rows
    degrees, inches = (float(part.split()[0].rstrip("°")) for part in row.here.split(","))
    assert 0.02 < degrees < 0.3
    assert 0.0005 < inches < 0.01
    assert row.met
