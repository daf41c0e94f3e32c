"""The ready-made environments: each keeps the contract, and its docstring says what it takes."""

from __future__ import annotations

import inspect
import re
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import palpate.envs
from palpate.envs.planar.planar_env import PlanarProbeEnv
from palpate.envs.probe_env import ProbeEnv
from palpate.recognizer import EDGE, FACE, VERTEX

gymnasium.register_envs(palpate.envs)

READY: dict[str, dict[str, Any]] = {
    "palpate/ProbeRest-v0": {"placement": "resting"},
    "palpate/ProbeFinger-v0": {"sensor": "finger"},
}
SECTIONS = (
    "Description",
    "Action Space",
    "Observation Space",
    "Rewards",
    "Starting State",
    "Episode End",
    "Info",
    "Arguments",
    "References",
    "Version History",
)
every_env = pytest.mark.parametrize("kind", [ProbeEnv, PlanarProbeEnv])


@pytest.mark.parametrize("name", READY)
def test_a_ready_made_environment_keeps_gymnasiums_contract(name):
    made = gymnasium.make(name, library=("simple-hand",), max_probes=3)
    check_env(made.unwrapped, skip_render_check=True)


@pytest.mark.parametrize("name", READY)
def test_a_ready_made_environment_is_probe_env_with_arguments_that_others_may_replace(name):
    rng = np.random.default_rng(0)
    ready = gymnasium.make(name, library=("simple-hand",), max_probes=3)
    plain = ProbeEnv(("simple-hand",), max_probes=3, **READY[name])
    other = gymnasium.make(name, library=("simple-hand",), max_probes=3, distribution="gaussian")
    for env in (ready, plain, other):
        env.reset(seed=4)
    probe = rng.uniform(-1.0, 1.0, 3).astype(np.float32)
    seen = [env.step(probe)[0] for env in (ready, plain, other)]
    assert seen[0]["contact_count"] > 0
    assert all(np.array_equal(seen[0][key], seen[1][key]) for key in seen[0])
    assert not np.array_equal(seen[0]["contact_positions"], seen[2]["contact_positions"])


def test_the_table_of_environments_tells_what_is_registered():
    text = inspect.getdoc(palpate.envs)
    assert text is not None
    told = re.findall(r"^\| (palpate/\S+) \|.*\| (.*?): ", text, re.M)
    registered = {name: spec.kwargs for name, spec in gymnasium.registry.items()}
    assert [name for name, _ in told] == [n for n in registered if n.startswith("palpate/")]
    for name, arguments in told:
        assert arguments == (
            ", ".join(f'{key}="{value}"' for key, value in registered[name].items()) or "none"
        )


@every_env
def test_the_docstring_has_every_section_and_every_argument(kind):
    text = inspect.getdoc(kind)
    assert text is not None
    headings = re.findall(r"^## (.*)$", text, re.M)
    assert [heading for heading in headings if heading != "Rendering"] == list(SECTIONS)
    table = text.split("## Arguments")[1].split("## ")[0]
    told = re.findall(r"^\| (\w+) \|", table, re.M)[1:]
    assert told == [name for name in inspect.signature(kind).parameters if name != "self"]


@every_env
def test_the_docstring_tells_every_observation(kind):
    text = inspect.getdoc(kind)
    assert text is not None
    table = text.split("## Observation Space")[1].split("## ")[0]
    rows = re.findall(r"^\| ([\w, ]+) \| \(", table, re.M)
    told = {key for row in rows for key in row.split(", ")}
    assert told == set(kind(max_probes=1).observation_space)


def test_a_resting_object_is_told_apart_by_fewer_probes_than_one_held_anyhow():
    probes = {}
    for placement in ("resting", "across"):
        env = ProbeEnv(("housing-34", "simple-hand"), placement=placement, max_probes=20)
        count = 0
        for seed in range(12):
            rng = np.random.default_rng(seed)
            env.reset(seed=seed)
            ended = False
            while not ended:
                _, _, unique, over, _ = env.step(rng.uniform(-1, 1, 3))
                count += 1
                ended = unique or over
        probes[placement] = count
    assert probes["resting"] < probes["across"]


def test_a_finger_reports_what_it_touched():
    env = ProbeEnv(("simple-hand",), sensor="finger", placement="resting", max_probes=12)
    rng, kinds = np.random.default_rng(0), set()
    for seed in range(3):
        observation, _ = env.reset(seed=seed)
        for _ in range(6):
            observation, _, ended, _, _ = env.step(rng.uniform(-1, 1, 3))
            if ended:
                break
        count = observation["contact_count"][0]
        kinds |= set(observation["contact_kinds"][:count].tolist())
        assert not observation["contact_kinds"][count:].any()
    assert FACE in kinds
    assert kinds <= {FACE, EDGE, VERTEX}
