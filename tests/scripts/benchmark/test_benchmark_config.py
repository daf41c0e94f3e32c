"""What a benchmark plays: bounds as they are written, objects, strategies, seeds."""

from __future__ import annotations

import re
from inspect import signature

import numpy as np
import pytest
from helpers.made_up_rows import small

from palpate.scripts.benchmark.config import BenchmarkConfig, parse_noise
from palpate.scripts.commands.benchmark import MEMO_NOISE, benchmark


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


def test_a_configuration_without_sense_is_refused():
    with pytest.raises(ValueError, match="episodes is 0"):
        small(episodes=0)
    with pytest.raises(ValueError, match="policies is empty"):
        BenchmarkConfig(policies=(), objects=("housing",), noise=("pi/8,1mm",))
