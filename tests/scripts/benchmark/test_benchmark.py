"""`palpate benchmark`: the same rows, whoever plays them, and whatever is killed on the way."""

from __future__ import annotations

import json
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from helpers.checkout import ROOT
from helpers.command import run_here
from helpers.made_up_rows import made_up_row, small
from helpers.processes import python

from palpate.scripts.benchmark.row import EpisodeRow
from palpate.scripts.benchmark.run import run_benchmark
from palpate.scripts.benchmark.store import RowStore, only_writer

QUICK = ("--objects", "simple-hand", "--noise", "5deg,0.01in")


def untimed(folder: Path) -> list:
    return [row.untimed() for row in RowStore(folder).rows()]


def test_only_what_is_missing_is_played(tmp_path):
    played = []

    def noting(job):
        played.append(job.number)
        return made_up_row(job)

    store = RowStore(tmp_path)
    kept = [made_up_row(job) for job in small().jobs()][3:8]
    for row in kept:
        store.add(row)
    run_benchmark(small(), tmp_path, noting)
    assert played == [0, 1, 2, *range(8, 20)]
    assert store.rows()[3:8] == kept


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"episodes": 11}, "episodes are 10, not 11"),
        ({"policies": ("random",)}, "policies are random quick, not random"),
        ({"noise": ("pi/8,0.05in", "pi/9,1mm")}, "noise is pi/8,0.05in, not"),
        ({"seed": 1}, "seed is 0, not 1"),
    ],
)
def test_a_folder_of_another_benchmark_is_refused(tmp_path, change, says):
    run_benchmark(small(), tmp_path, made_up_row)
    before = (tmp_path / "episodes.parquet").read_bytes()
    with pytest.raises(ValueError, match=f"{says}.*another --out"):
        run_benchmark(small(**change), tmp_path, made_up_row)
    assert (tmp_path / "episodes.parquet").read_bytes() == before


def test_a_benchmark_isnt_gone_on_with_in_other_versions(tmp_path):
    run_benchmark(small(), tmp_path, made_up_row)
    path = tmp_path / "config.json"
    document = json.loads(path.read_text())
    document["versions"]["numpy"] = "1.0"
    path.write_text(json.dumps(document))
    with pytest.raises(ValueError, match=r"versions are .*numpy 1\.0"):
        run_benchmark(small(), tmp_path, made_up_row)


def test_two_benchmarks_dont_write_to_one_folder(tmp_path):
    with only_writer(tmp_path), pytest.raises(ValueError, match="another benchmark is writing"):
        run_benchmark(small(), tmp_path, made_up_row)


def test_an_episode_that_raises_loses_none_that_are_done(tmp_path):
    def stumbling(job):
        if job.number == 5:
            raise RuntimeError("a bug")
        return made_up_row(job)

    with pytest.raises(RuntimeError, match="a bug"):
        run_benchmark(small(), tmp_path, stumbling)
    assert [row.number for row in RowStore(tmp_path).rows()] == [0, 1, 2, 3, 4]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--policies", "psychic"), ("'psychic'", "random")),
        (("--policies", "no_such_module:Policy"), ("no_such_module",)),
        (("--policies", "json:Policy"), ("json",)),
        (("--policies", "random,random"), ("random, random", "twice")),
        (("--objects", "spoon"), ("'spoon'", "simple-hand", "library")),
        (("--noise", "18,0.01"), ("'18,0.01'", "pi/8,0.05in")),
        (("--noise", "18deg,0in"), ("position error", "above zero")),
        (("--noise", "100deg,1mm"), ("normal error", "at most pi/2")),
        (("--sensor", "foot"), ("'foot'", "ray")),
        (("--goal", "fame"), ("'fame'", "both")),
        (("--placement", "flying"), ("'flying'",)),
        (("--episodes", "0"), ("--episodes",)),
        (("--backend", "pigeon"), ("'pigeon'", "joblib, ray")),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(tmp_path, arguments, words):
    base = ("benchmark", "--policies", "random", *QUICK, "--out", "out")
    doubled = {"--policies", "--objects", "--noise"} & set(arguments)
    if doubled:  # these add up where they are given twice
        at = base.index(doubled.pop())
        base = base[:at] + base[at + 2 :]
    told = run_here(*base, *arguments, cwd=tmp_path)
    assert told.code == 2, told.err
    assert told.out == ""
    assert len(told.err.splitlines()) == 1
    for word in words:
        assert word in told.err


@pytest.mark.parametrize(
    ("module", "extra"), [("pyarrow", "benchmark"), ("joblib", "benchmark"), ("ray", "ray")]
)
def test_a_missing_package_is_named_with_how_to_get_it(tmp_path, monkeypatch, module, extra):
    monkeypatch.setitem(sys.modules, module, None)
    monkeypatch.setitem(sys.modules, f"{module}.parquet", None)
    backend = "ray" if module == "ray" else "joblib"
    with pytest.raises(ValueError, match=rf"{module}.*pip install 'palpate\[{extra}\]'"):
        run_benchmark(small(), tmp_path, made_up_row, workers=2, backend=backend)


def test_two_workers_bring_the_rows_that_one_does(tmp_path):
    for workers in ("1", "2"):
        options = (*QUICK, "--episodes", "2", "--workers", workers, "--out", f"by{workers}")
        told = run_here("benchmark", "--policies", "random", *options, cwd=tmp_path)
        assert told.code == 0, told.err
        assert "2 episodes are in" in told.out
    assert untimed(tmp_path / "by1") == untimed(tmp_path / "by2")
    rows = RowStore(tmp_path / "by2").rows()
    assert [len(row.decision_seconds) for row in rows] == [row.probes - 1 for row in rows]
    assert len(rows) == 2


def test_the_strategy_of_the_guide_is_played_and_reported(tmp_path, monkeypatch):
    guide = (ROOT / "docs" / "own-policy.md").read_text(encoding="utf-8")
    (program,) = re.findall(r"```python\n(.*?)```", guide, re.DOTALL)
    (tmp_path / "near.py").write_text(program)
    monkeypatch.setattr(sys, "path", [*sys.path])
    play_it, report_it = re.findall(r"^    palpate (.*)$", guide, re.MULTILINE)
    play_it = play_it.replace("--episodes 20", "--episodes 1 --max-probes 4")
    assert run_here(*play_it.split(), cwd=tmp_path).code == 0
    rows = RowStore(tmp_path / "mine").rows()
    assert [row.policy for row in rows] == ["random", "near:Near"] * 3
    assert run_here(*report_it.split(), cwd=tmp_path).code == 0
    assert "near:Near" in (tmp_path / "mine" / "report.md").read_text()


PROGRAM = """
import sys, time
from pathlib import Path
from helpers.checkout import ROOT
from helpers.command import run_here
from helpers.made_up_rows import made_up_row, small
from helpers.processes import python
from palpate.scripts.benchmark import store
from palpate.scripts.benchmark.run import run_benchmark

store.MOST_PARTS = 6

def play(job):
    time.sleep(0.002)
    return made_up_row(job)

run_benchmark(small(episodes=int(sys.argv[2])), Path(sys.argv[1]), play)
"""


def files(folder: Path) -> set[str]:
    return {path.name for path in folder.glob("**/*.parquet")}


def kill_and_go_on(
    start, folder: Path, kills: int, rng: np.random.Generator, spread: float
) -> None:
    """Kill what is started at random moments, then let it end; no row may be lost or change."""
    known: dict[int, EpisodeRow] = {}
    for _ in range(kills):
        before = files(folder)
        process = start()
        begun = time.monotonic()
        while process.poll() is None and files(folder) == before:
            assert time.monotonic() - begun < 120.0
            time.sleep(0.01)
        time.sleep(rng.uniform(0.0, spread))
        process.send_signal(signal.SIGKILL)
        assert process.wait() == -signal.SIGKILL, "it had ended before it could be killed"
        left = {row.number: row for row in RowStore(folder).rows()}
        assert known.items() < left.items()
        known = left
    ended = start()
    assert ended.wait(timeout=600) == 0
    assert known.items() <= {row.number: row for row in RowStore(folder).rows()}.items()


def test_killed_at_random_moments_no_row_is_lost_or_changed(tmp_path):
    episodes = 120

    def start():
        return subprocess.Popen(python(PROGRAM, str(tmp_path), str(episodes)))

    kill_and_go_on(start, tmp_path, 3, np.random.default_rng(), spread=0.4)
    expected = [made_up_row(job).untimed() for job in small(episodes=episodes).jobs()]
    assert untimed(tmp_path) == expected
    assert not (tmp_path / "parts").exists()


@pytest.mark.slow
def test_ten_kills_of_the_command_itself_lose_no_row_and_change_none(tmp_path):
    options = ("--policies", "random", *QUICK, "--episodes", "400", "--workers", "2")
    program = "from palpate.scripts.cli import main; main()"

    def start():
        arguments = python(program, "benchmark", *options, "--out", "killed")
        return subprocess.Popen(arguments, cwd=tmp_path)

    kill_and_go_on(start, tmp_path / "killed", 10, np.random.default_rng(), spread=3.0)
    assert len(untimed(tmp_path / "killed")) == 400
