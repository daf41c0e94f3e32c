"""`palpate benchmark`: the same rows, whoever plays them, and whatever is killed on the way."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from dataclasses import replace
from inspect import signature
from pathlib import Path

import numpy as np
import pytest
from helpers.made_up_rows import made_up_row, small

from palpate.scripts import cli
from palpate.scripts.benchmark import store as benchmark_store
from palpate.scripts.benchmark.config import BenchmarkConfig, parse_noise
from palpate.scripts.benchmark.playing import make_env, open_episode, play, task_of
from palpate.scripts.benchmark.row import GAVE_UP, SOLVED, EpisodeRow
from palpate.scripts.benchmark.run import run_benchmark
from palpate.scripts.benchmark.store import RowStore, only_writer
from palpate.scripts.commands.benchmark import MEMO_NOISE, benchmark

TESTS = Path(__file__).resolve().parents[2]
QUICK = ("--objects", "simple-hand", "--noise", "5deg,0.01in")


def palpate(monkeypatch, capsys, *arguments: str) -> tuple[int, str, str]:
    monkeypatch.setattr(sys, "argv", ["palpate", *arguments])
    with pytest.raises(SystemExit) as ended:
        cli.main()
    printed = capsys.readouterr()
    return int(ended.value.code or 0), printed.out, printed.err


def untimed(folder: Path) -> list:
    return [row.untimed() for row in RowStore(folder).rows()]


@pytest.mark.parametrize(
    ("text", "radians", "metres"),
    [
        ("pi/8,0.05in", np.pi / 8, 0.00127),
        ("π/10, .01 in", np.pi / 10, 0.000254),
        ("18deg,0.254mm", np.pi / 10, 0.000254),
        ("0.3rad,1e-4m", 0.3, 1e-4),
        ("22.5°,50um", np.pi / 8, 5e-5),
    ],
)
def test_bounds_are_read_with_their_units(text, radians, metres):
    noise = parse_noise(text)
    assert noise.normal_error == pytest.approx(radians, rel=1e-12)
    assert noise.position_error == pytest.approx(metres, rel=1e-12)


@pytest.mark.parametrize(
    "text",
    ["", "pi/8", "0.05in,pi/8", "18,0.01", "pi/0,1mm", "18deg,1ft", "18deg,1mm,2mm", "nan,1mm"],
)
def test_bounds_without_sense_are_refused_with_an_example(text):
    with pytest.raises(ValueError, match=re.escape(repr(text)) + ".*pi/8,0.05in"):
        parse_noise(text)


def test_by_default_the_rows_of_the_memo_are_played_200_times():
    assert signature(benchmark).parameters["episodes"].default == 200
    noises = [parse_noise(text) for text in MEMO_NOISE]
    assert [round(np.pi / noise.normal_error, 9) for noise in noises] == [10, 10, 8]
    assert [noise.position_error / 0.0254 for noise in noises] == [0.01, 0.05, 0.05]


def test_an_object_is_known_by_name_or_one_of_the_library_or_of_a_folder(tmp_path):
    config = small(objects=("stapler", "library", str(tmp_path)))
    assert [s.library for s in config.settings] == [("stapler",), None, str(tmp_path)]


def test_all_strategies_of_a_setting_have_the_same_seeds():
    config = small(objects=("housing", "library"), noise=("pi/8,1mm", "pi/9,1mm"), seed=7)
    jobs = list(config.jobs())
    assert len(jobs) == len(config) == 80
    assert [job.number for job in jobs] == list(range(80))
    for setting in config.settings:
        for policy in config.policies:
            own = [job.seed for job in jobs if (job.setting, job.policy) == (setting, policy)]
            assert own == list(range(7, 17))


@pytest.mark.parametrize(("sensor", "radius"), [("ray", 0.0), ("ball", 0.002), ("finger", 0.002)])
def test_a_task_has_the_probes_and_the_bounds_of_its_environment(sensor, radius):
    (setting,) = small(sensor=sensor, goal="object").settings
    env = make_env(setting)
    task = task_of(env, "object")
    assert (task.position_error, task.normal_error) == (0.00127, np.pi / 8)
    assert (task.radius, task.goal, task.library) == (radius, "object", env.library)
    env.reset(seed=0)
    action = np.array([0.3, -0.4, 0.7])
    env.step(action)
    rays = task.space.rays(action[None])
    assert np.allclose(rays.starts_world[0], env.touches[-1].starts_world, atol=1e-12)


class Wandering:
    """Goes where it is told, and wastes what randomness it is given."""

    def __init__(self, wasted: int):
        self.wasted, self.calls = wasted, 0

    def reset(self):
        self.calls = 0

    def act(self, observation, rng):
        rng.random(self.wasted)
        self.calls += 1
        return np.sin(np.array([1.0, 2.0, 3.0]) * self.calls)


def test_object_pose_first_probe_and_noise_are_the_same_whatever_the_strategy_draws():
    (setting,) = small(max_probes=5).settings
    env = make_env(setting)
    job = next(small(max_probes=5).jobs())
    rows, felt = [], []
    for wasted in (0, 17):
        rows.append(play(open_episode(env, job), Wandering(wasted), job).untimed())
        felt.append(env.contacts.positions.copy())
    assert rows[0] == rows[1]
    assert len(rows[0].hypotheses) == rows[0].probes
    assert np.array_equal(*felt)


def test_a_random_episode_is_the_one_that_the_episode_command_plays():
    from palpate.policies import make_policy

    (setting,) = small(max_probes=4).settings
    env = make_env(setting)
    job = next(small(max_probes=4, seed=3).jobs())
    row = play(open_episode(env, job), make_policy("random", task_of(env)), job)
    rng = np.random.default_rng(np.random.SeedSequence(3).spawn(1)[0])
    env.reset(seed=3)
    assert row.first_probe == tuple(rng.uniform(-1.0, 1.0, 3).astype(np.float32).tolist())
    left = []
    for action in (row.first_probe, *rng.uniform(-1.0, 1.0, (row.probes - 1, 3)).astype("f4")):
        env.step(np.asarray(action))
        left.append(len(env.belief.hypotheses) if env.belief else 0)
    assert row.hypotheses == tuple(left)


def test_an_answer_is_right_if_it_is_the_truth_and_wrong_if_it_is_another_object(monkeypatch):
    from types import SimpleNamespace

    from palpate.policies import make_policy
    from palpate.scripts.benchmark import playing

    config = small(noise=("5deg,0.01in",), max_probes=40)
    (setting,) = config.settings
    env = make_env(setting)
    policy, job = make_policy("random", task_of(env)), next(config.jobs())
    row = play(open_episode(env, job), policy, job)
    assert (row.ended, row.right) == (SOLVED, True)
    assert row.rotation_error < np.radians(3.0)
    far = SimpleNamespace(rotation=0.06, translation=0.0)
    monkeypatch.setattr(playing, "pose_difference", lambda *_: far)
    assert play(open_episode(env, job), policy, job).right is False
    knows = replace(setting, goal="object")
    knowing = replace(job, setting=knows)
    assert play(open_episode(env, knowing), policy, knowing).right is True
    monkeypatch.setattr(type(env), "true_object", SimpleNamespace(name="spoon"))
    assert playing._compared(env) == (False, None)


def test_the_goal_object_is_reached_at_the_first_contact_where_there_is_one_object():
    from palpate.policies import make_policy

    config = small(goal="object", episodes=3)
    (setting,) = config.settings
    env = make_env(setting)
    for job in list(config.jobs())[:6:2]:
        row = play(open_episode(env, job), make_policy("random", task_of(env, "object")), job)
        assert row.ended == SOLVED
        assert row.right
        assert row.contacts_felt[-1] > 0
        assert not any(row.contacts_felt[:-1])


def test_an_episode_without_an_answer_counts_as_one_probe_more_than_may_be_sent():
    job = next(small().jobs())
    given_up = made_up_row(job, probes=99)
    assert (given_up.ended, given_up.probes, given_up.probes_to_unique) == (GAVE_UP, 20, 21)
    assert made_up_row(job, probes=20).probes_to_unique == 20


def test_rows_come_back_from_disk_as_they_were(tmp_path):
    rows = [made_up_row(job) for job in small().jobs()]
    rows[3] = replace(rows[3], right=None, rotation_error=None, decision_median=None)
    store = RowStore(tmp_path)
    for row in rows[::-1]:
        store.add(row)
    assert store.rows() == rows
    store.gather()
    assert RowStore(tmp_path).rows() == rows
    assert [path.name for path in tmp_path.iterdir()] == ["episodes.parquet"]


def test_the_table_can_be_read_without_palpate(tmp_path):
    import pyarrow.parquet

    run_benchmark(small(), tmp_path, made_up_row)
    table = pyarrow.parquet.read_table(tmp_path / "episodes.parquet")
    assert table.num_rows == 20
    assert table["policy"].to_pylist()[:2] == ["random", "quick"]
    assert len(table["hypotheses"][0].as_py()) == table["probes"][0].as_py()


def test_rows_are_gathered_when_they_get_many(tmp_path, monkeypatch):
    monkeypatch.setattr(benchmark_store, "MOST_PARTS", 4)
    rows = [made_up_row(job) for job in small().jobs()][:10]
    store = RowStore(tmp_path)
    for row in rows:
        store.add(row)
    assert len(list((tmp_path / "parts").iterdir())) == 2
    assert store.rows() == rows


def test_rows_can_be_read_while_another_process_gathers_them(tmp_path, monkeypatch):
    rows = [made_up_row(job) for job in small().jobs()]
    writer, reader = RowStore(tmp_path), RowStore(tmp_path)
    for row in rows:
        writer.add(row)
    read = benchmark_store._read

    def read_late(path):
        if path.name == f"{rows[5].number:08d}.parquet":
            monkeypatch.setattr(benchmark_store, "_read", read)
            writer.gather()
        return read(path)

    monkeypatch.setattr(benchmark_store, "_read", read_late)
    assert reader.rows() == rows


def test_a_row_that_is_in_two_files_counts_once_and_the_older_one_stays(tmp_path):
    first, other = [made_up_row(job) for job in small().jobs()][:2]
    store = RowStore(tmp_path)
    store.add(first)
    store.gather()
    store.add(replace(first, contacts=99))
    store.add(other)
    assert store.rows() == [first, other]
    store.gather()
    assert store.rows() == [first, other]


def test_what_was_half_written_is_cleared_away_and_what_is_damaged_is_named(tmp_path):
    run_benchmark(small(episodes=1), tmp_path, made_up_row)
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / ".00000001.parquet.half").write_bytes(b"PAR1")
    run_benchmark(small(episodes=1), tmp_path, made_up_row)
    assert not (tmp_path / "parts").exists()
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "00000001.parquet").write_bytes(b"PAR1 cut short")
    with pytest.raises(ValueError, match=r"00000001\.parquet: not a whole table"):
        run_benchmark(small(episodes=1), tmp_path, made_up_row)


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
def test_bad_input_is_one_line_and_exit_code_2(tmp_path, monkeypatch, capsys, arguments, words):
    monkeypatch.chdir(tmp_path)
    base = ("benchmark", "--policies", "random", *QUICK, "--out", "out")
    doubled = {"--policies", "--objects", "--noise"} & set(arguments)
    if doubled:  # these add up where they are given twice
        at = base.index(doubled.pop())
        base = base[:at] + base[at + 2 :]
    code, out, err = palpate(monkeypatch, capsys, *base, *arguments)
    assert code == 2, err
    assert out == ""
    assert len(err.splitlines()) == 1
    for word in words:
        assert word in err


@pytest.mark.parametrize(
    ("module", "extra"), [("pyarrow", "benchmark"), ("joblib", "benchmark"), ("ray", "ray")]
)
def test_a_missing_package_is_named_with_how_to_get_it(tmp_path, monkeypatch, module, extra):
    monkeypatch.setitem(sys.modules, module, None)
    monkeypatch.setitem(sys.modules, f"{module}.parquet", None)
    backend = "ray" if module == "ray" else "joblib"
    with pytest.raises(ValueError, match=rf"{module}.*pip install 'palpate\[{extra}\]'"):
        run_benchmark(small(), tmp_path, made_up_row, workers=2, backend=backend)


def test_two_workers_bring_the_rows_that_one_does(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    for workers in ("1", "2"):
        options = (*QUICK, "--episodes", "2", "--workers", workers, "--out", f"by{workers}")
        code, out, err = palpate(monkeypatch, capsys, "benchmark", "--policies", "random", *options)
        assert code == 0, err
        assert "2 episodes are in" in out
    assert untimed(Path("by1")) == untimed(Path("by2"))
    assert len(untimed(Path("by1"))) == 2
    assert all(len(row.decision_seconds) == row.probes - 1 for row in RowStore(Path("by2")).rows())


def test_the_strategy_of_the_guide_is_played_and_reported(tmp_path, monkeypatch, capsys):
    guide = (TESTS.parent / "docs" / "own-policy.md").read_text(encoding="utf-8")
    (program,) = re.findall(r"```python\n(.*?)```", guide, re.DOTALL)
    (tmp_path / "near.py").write_text(program)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    play_it, report_it = re.findall(r"^    palpate (.*)$", guide, re.MULTILINE)
    play_it = play_it.replace("--episodes 20", "--episodes 1 --max-probes 4")
    assert palpate(monkeypatch, capsys, *play_it.split())[0] == 0
    assert [row.policy for row in RowStore(Path("mine")).rows()] == ["random", "near:Near"] * 3
    assert palpate(monkeypatch, capsys, *report_it.split())[0] == 0
    assert "near:Near" in Path("mine/report.md").read_text()


PROGRAM = """
import sys, time
from pathlib import Path
from helpers.made_up_rows import made_up_row, small
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
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(TESTS), *sys.path])}

    def start():
        arguments = [sys.executable, "-c", PROGRAM, str(tmp_path), str(episodes)]
        return subprocess.Popen(arguments, env=environment)

    kill_and_go_on(start, tmp_path, 3, np.random.default_rng(), spread=0.4)
    expected = [made_up_row(job).untimed() for job in small(episodes=episodes).jobs()]
    assert untimed(tmp_path) == expected
    assert not (tmp_path / "parts").exists()


@pytest.mark.slow
def test_ten_kills_of_the_command_itself_lose_no_row_and_change_none(tmp_path):
    options = ("--policies", "random", *QUICK, "--episodes", "400", "--workers", "2")
    program = "from palpate.scripts.cli import main; main()"

    def start():
        arguments = [sys.executable, "-c", program, "benchmark", *options, "--out", "killed"]
        return subprocess.Popen(
            arguments, cwd=tmp_path, env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
        )

    kill_and_go_on(start, tmp_path / "killed", 10, np.random.default_rng(), spread=3.0)
    assert len(untimed(tmp_path / "killed")) == 400


def test_a_configuration_without_sense_is_refused():
    with pytest.raises(ValueError, match="episodes is 0"):
        small(episodes=0)
    with pytest.raises(ValueError, match="policies is empty"):
        BenchmarkConfig(policies=(), objects=("housing",), noise=("pi/8,1mm",))


@pytest.mark.parametrize(("sensor", "placement"), [("ray", "across"), ("finger", "resting")])
def test_an_episode_that_begins_with_a_copy_goes_on_as_the_episode_itself(sensor, placement):
    from palpate.policies import make_policy
    from palpate.scripts.benchmark.workers import player

    config = small(
        objects=("simple-hand",),
        noise=("pi/10,0.05in",),
        policies=("random", "information"),
        sensor=sensor,
        placement=placement,
        episodes=2,
        max_probes=5,
    )
    (setting,) = config.settings
    env = make_env(setting)
    shared = player("")
    for job in config.jobs():
        policy = make_policy(job.policy, task_of(env))
        assert shared(job).untimed() == play(open_episode(env, job), policy, job).untimed()
