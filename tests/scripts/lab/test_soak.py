"""The soak: a small share of it, and whether it would find what it looks for."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import typer
from helpers.processes import HEAVY, loaded_by

from palpate.envs.planar.planar_env import PlanarProbeEnv
from palpate.envs.probe_env import ProbeEnv
from palpate.envs.scene.scene import OBJECT, PLANE
from palpate.recognizer import FreeSpace
from palpate.scripts.lab.soak import run as soak_run
from palpate.scripts.lab.soak.__main__ import MOST_GROWTH, failures, soak
from palpate.scripts.lab.soak.actions import EXTREMES, REFUSED
from palpate.scripts.lab.soak.cases import CUT_SHORT, MAIN, SETTINGS, VARIANTS
from palpate.scripts.lab.soak.paths import WatchedFinger, judge_last_probe
from palpate.scripts.lab.soak.run import Soak, Soaked

SMALL = ("housing-34", "simple-hand")
RAYS = 3


def soaked(env, steps: int) -> Soaked:
    return Soak(env, seed=0).run(range(steps))


def made(name: str) -> Any:
    """An environment; any, because tests put false reports into it."""
    return SETTINGS[name].make(cut_short=True)


def touching(env) -> tuple[np.ndarray, dict[str, Any]]:
    """An action of which a way has ended on the object, and what the environment told of it."""
    rng = np.random.default_rng(1)
    env.reset(seed=3)
    while True:
        action = 0.3 * rng.uniform(-1.0, 1.0, env.action_space.shape)
        *_, info = env.step(action)
        if len(env.touches[-1].contacts):
            return action, info


def say(env, touch) -> None:
    """Have the last probe have reported something else."""
    touches = (*env.touches[:-1], touch)
    env._known = replace(env._known, evidence=replace(env._known.evidence, touches=touches))


def test_the_commands_help_loads_nothing_heavy():
    assert not HEAVY & loaded_by("import palpate.scripts.lab.soak")


@pytest.mark.parametrize("name", MAIN)
def test_nothing_goes_wrong_in_the_environments_as_they_come(name):
    found = soaked(MAIN[name].make(cut_short=name != "planar"), 25)
    assert not failures(name, found)
    assert (found.steps, len(found.seconds)) == (25, 25)
    assert found.ways == (25 if name == "planar" else RAYS * 25)
    assert found.episodes > 1


@pytest.mark.parametrize("name", VARIANTS)
def test_nothing_goes_wrong_with_other_sensors_and_placements(name):
    setting = replace(VARIANTS[name], arguments={**VARIANTS[name].arguments, "library": SMALL})
    found = soaked(setting.make(cut_short=True), 6)
    assert not failures(name, found)
    assert found.steps == 6


def test_the_same_soak_comes_of_the_same_seed():
    one, again = (soaked(MAIN["planar"].make(cut_short=True), 80) for _ in range(2))
    for what in ("episodes", "refused", "ways", "beyond"):
        assert getattr(one, what) == getattr(again, what)
    assert one.refused > 0


@pytest.mark.parametrize("make", EXTREMES)
@pytest.mark.parametrize("kind", [ProbeEnv, PlanarProbeEnv])
def test_an_extreme_action_is_that_of_the_box_that_is_nearest(kind, make):
    env = kind(SMALL[1:] if kind is ProbeEnv else None, limits=CUT_SHORT)
    inside = np.array([0.3, -0.7, 0.1])[: env.action_space.shape[0]]
    extreme = make(inside)
    last = []
    for action in (extreme, np.clip(np.asarray(extreme, np.float64), -1.0, 1.0)):
        env.reset(seed=2)
        last.append(env.step(action)[0]["ray_ends"])
    assert np.array_equal(*last)


@pytest.mark.parametrize("make", REFUSED)
@pytest.mark.parametrize("kind", [ProbeEnv, PlanarProbeEnv])
def test_what_is_no_action_is_refused_and_leaves_no_trace(kind, make):
    env, same = (kind(SMALL[1:] if kind is ProbeEnv else None, limits=CUT_SHORT) for _ in range(2))
    inside = np.array([0.3, -0.7, 0.1])[: env.action_space.shape[0]]
    for one in (env, same):
        one.reset(seed=2)
    with pytest.raises(ValueError, match=r"finite numbers, not|could not convert|inhomogeneous"):
        env.step(make(inside))
    one, other = env.step(inside)[0], same.step(inside)[0]
    assert all(np.array_equal(one[key], other[key]) for key in one)


@pytest.mark.parametrize("name", ["probe", "ball", "finger", "planar"])
def test_a_way_through_the_object_is_found(name):
    env = made(name)
    action, info = touching(env)
    ways = judge_last_probe(env, action, info)
    assert all(way.sound for way in ways)
    touch = env.touches[-1]
    hits = [0]
    if isinstance(env, PlanarProbeEnv):
        farther = 1.01 * touch.end_world - 0.01 * touch.start_world
        env._touches[-1] = replace(touch, end_world=farther)
    else:
        farther = 1.01 * touch.ends_world - 0.01 * touch.starts_world
        say(env, replace(touch, ends_world=farther))
        hits = np.flatnonzero(touch.outcomes == OBJECT).tolist()
    worse = judge_last_probe(env, action, info)
    for row in hits:
        assert worse[row].beyond > ways[row].beyond + 5e-4
        assert not worse[row].sound


def test_a_ray_that_says_it_met_nothing_is_not_believed():
    env = made("probe")
    action, info = touching(env)
    touch = env.touches[-1]
    meeting = np.append(action[:2] * env.half_width, 0.0)
    through = np.tile(meeting, (RAYS, 1))
    say(env, replace(touch, ends_world=through, outcomes=np.full(RAYS, PLANE, np.int8)))
    assert not all(way.sound for way in judge_last_probe(env, action, info))


@pytest.mark.parametrize("name", ["range", "range-grid"])
def test_a_line_of_sight_through_the_object_is_found(name):
    env = made(name)
    action, info = touching(env)
    assert all(way.sound for way in judge_last_probe(env, action, info))
    touch = env.touches[-1]
    paths = touch.free_space
    farther = 1.02 * paths.ends - 0.02 * paths.starts
    say(env, replace(touch, free_space=FreeSpace(paths.starts, farther, error=paths.error)))
    assert not all(way.sound for way in judge_last_probe(env, action, info))


def test_a_watched_finger_touches_as_any_other():
    plain = ProbeEnv(SMALL[1:], sensor="finger", limits=CUT_SHORT)
    watched = ProbeEnv(SMALL[1:], sensor="finger", limits=CUT_SHORT)
    finger = WatchedFinger.like(plain.sensors[0])  # pyright: ignore
    watched.sensors = (finger,)
    for env in (plain, watched):
        touching(env)
    for key, value in plain._observe().items():
        assert np.array_equal(value, watched._observe()[key])
    assert 0.0 < finger.deepest < 0.1 * finger.design.radius


class Broken(PlanarProbeEnv):
    """Takes NaN for zero, raises at every fourth step, and else reports NaN."""

    def step(self, action):
        told = super().step(np.nan_to_num(np.asarray(action, float)))
        if len(self.touches) % 4 == 0:
            raise RuntimeError("broken")
        told[0]["ray_ends"][0] = np.nan
        return told


def test_what_is_broken_is_told():
    found = soaked(Broken(max_probes=10, limits=CUT_SHORT), 120)
    assert len(found.raised) > 3
    assert "RuntimeError: broken" in found.raised[0]
    assert "episode of seed" in found.raised[0]
    assert found.taken
    assert found.not_numbers == found.outside == 120 - len(found.raised)
    told = failures("broken", found)
    for words in ("raised", "no action, but not refused", "not finite", "outside their space"):
        assert any(words in line for line in told)


def test_memory_that_grows_is_told(monkeypatch):
    least = iter(10**9 + np.arange(1000) * int(MOST_GROWTH / 10))
    monkeypatch.setattr(soak_run, "resident_memory", lambda: int(next(least)))
    found = soaked(MAIN["planar"].make(), 300)
    assert found.episodes > 20
    assert ["memory grew" in line for line in failures("planar", found)] == [True]


def test_memory_that_comes_and_goes_is_none_that_grows():
    sizes = [100, 500, 300, 100, 100, 900, 200, 101, 400, 800, 101, 901]
    assert Soaked(memory=sizes).growth == 1


def test_an_interrupt_ends_a_run_with_what_was_found():
    def steps():
        yield from range(7)
        raise KeyboardInterrupt

    found = Soak(MAIN["planar"].make(cut_short=True), seed=0).run(steps())
    assert found.interrupted
    assert found.steps == 7
    assert not failures("planar", found)


def test_resident_memory_follows_what_is_held():
    before = soak_run.resident_memory()
    held = np.ones(8_000_000)
    assert soak_run.resident_memory() - before > 0.9 * held.nbytes


def test_the_command_prints_a_table_and_exits_by_what_it_found(capsys):
    with pytest.raises(typer.Exit) as ended:
        soak(steps=20, env=["planar"], seed=1, cut_short=True)
    assert ended.value.exit_code == 0
    told = capsys.readouterr().out
    assert "planar" in told.splitlines()[0]
    rows = [line for line in told.splitlines() if line.strip().startswith("steps ")]
    assert rows[0].split()[-2:] == ["steps", "20"]
    with pytest.raises(typer.BadParameter, match="'spoon' is none of: probe, rest"):
        soak(steps=1, env=["spoon"])
