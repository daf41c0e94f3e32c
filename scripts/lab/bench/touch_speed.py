"""How long touching takes: triads of each sensor, and steps of the environment beside another's."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from time import process_time

import numpy as np
from numpy.typing import NDArray

from ....envs.library import load_library
from ....envs.probe_env import HALF_WIDTH, INCH, REACH, ProbeEnv
from ....envs.scene.placement import AcrossPlane
from ....envs.scene.scene import ProbeScene
from ....envs.sensors.noise import SensorNoise
from ....envs.sensors.sensors import make_sensor
from ....envs.sensors.touch import ProbeCommand, Sensor
from ....recognizer import Polyhedron
from ...timed import timed
from .report import Row, Section, median_and_tail, steps

TRIAD_GOAL = {"ray": 2e-5, "ball": 1e-3, "finger": 0.1}
"""Median time of a triad, seconds."""
STEP_GOAL = 200.0
"""Median steps a second, with the recogniser at work."""
RATE_GOAL = 10_000.0
"""Triads a second without it."""
TRIADS = 1000
PLACES = 20
"""Triads a scene, and how often the object is placed anew among them."""
ROBOTICS_STEPS = """
import importlib.metadata, json, sys, time
import gymnasium, gymnasium_robotics
gymnasium.register_envs(gymnasium_robotics)
env = gymnasium.make("HandManipulateBlock_ContinuousTouchSensors-v1")
env.reset(seed=0)
env.action_space.seed(0)
seconds = []
for _ in range(int(sys.argv[1])):
    action = env.action_space.sample()
    started = time.process_time()
    outcome = env.step(action)
    seconds.append(time.process_time() - started)
    if outcome[2] or outcome[3]:
        env.reset()
names = ("gymnasium-robotics", "mujoco")
print(json.dumps([seconds, [f"{name} {importlib.metadata.version(name)}" for name in names]]))
"""
"""Random actions in Gymnasium's environment of a hand with touch sensors."""


def measure_triads(seed: int) -> Section:
    """How long a triad of each sensor takes, around each stand-in."""
    rows = [_triad_row(name, model, seed) for name in TRIAD_GOAL for model in load_library()]
    return Section(
        "a triad, command to report, median / 99th percentile of processor time",
        rows,
        "Triads meet anywhere in the square that the environment sends them to, around objects"
        " placed as the environment places them.",
    )


def measure_steps(count: int, seed: int, robotics_python: Path | None) -> Section:
    """Steps a second of the environment, and of Gymnasium's that touches.

    Args:
        count: how many steps are timed.
        seed: of objects, poses, noise and actions.
        robotics_python: a Python that has gymnasium-robotics; None for this one.
    """
    return Section(
        "steps, random actions, five objects",
        [
            _step_row(count, seed),
            _rate_row(10 * count, seed),
            _robotics_row(count, robotics_python),
        ],
        "A step is a triad and all that the recogniser makes of it. The median is of all steps; the"
        " mean is carried by few, after the first touches of an episode, when thousands of"
        " interpretations are left. Without the recogniser a triad goes from command to report;"
        " the rate is that of all together.",
    )


def _triads(model: Polyhedron, name: str) -> tuple[Sensor, ProbeScene, AcrossPlane, float]:
    """A sensor, an object's scene, how it is placed and how far off triads are sent, metres."""
    noise = SensorNoise(position_error=0.01 * INCH, normal_error=np.pi / 10.0)
    half_width = HALF_WIDTH * model.diameter
    sensor = make_sensor(name, noise, REACH * model.diameter)
    return sensor, ProbeScene(model), AcrossPlane(offset=0.2 * half_width), half_width


def _command(half_width: float, rng: np.random.Generator) -> ProbeCommand:
    x, y, yaw = rng.uniform(-1.0, 1.0, 3) * (half_width, half_width, np.pi / 3.0)
    return ProbeCommand(float(x), float(y), float(yaw))


def _triad_row(name: str, model: Polyhedron, seed: int) -> Row:
    rng = np.random.default_rng(seed)
    sensor, scene, placement, half_width = _triads(model, name)
    seconds, contacts = [], 0
    for index in steps(range(TRIADS), f"speed: {name}, {model.name}"):
        if index % (TRIADS // PLACES) == 0:
            scene.place(placement.draw(rng, model))
        touch, spent = timed(sensor.touch, scene, _command(half_width, rng), rng)
        seconds.append(spent)
        contacts += len(touch.contacts)
    median, tail = median_and_tail(seconds)
    goal = 1e3 * TRIAD_GOAL[name]
    return Row(
        f"{name}, {model.name}",
        f"{median:.3f} / {tail:.2f} ms",
        f"{goal:g} ms",
        median <= goal,
        [f"{contacts / TRIADS:.2f} contacts a triad"],
    )


def _step_row(count: int, seed: int) -> Row:
    env, rng = ProbeEnv(), np.random.default_rng(seed)
    env.reset(seed=seed)
    _warm(env, rng)
    seconds, touched, episodes = [], [], 0
    ended = True
    for _ in steps(range(count), "steps: palpate/Probe-v0"):
        if ended:
            env.reset()
            episodes += 1
        action = rng.uniform(-1.0, 1.0, 3)
        (_, _, terminated, truncated, _), spent = timed(env.step, action)
        ended = terminated or truncated
        seconds.append(spent)
        touched.append(len(env.touches[-1].contacts) > 0)
    median = float(np.median(seconds))
    recognised = np.array(seconds)[np.array(touched)]
    return Row(
        "palpate/Probe-v0, ray, recognising",
        f"{1.0 / median:,.0f} steps/s",
        f"{STEP_GOAL:,.0f} steps/s",
        median * STEP_GOAL <= 1.0,
        [
            f"median {1e3 * median:.2f} ms; {_mean_and_worst(np.array(seconds))}",
            f"{count} steps, {episodes} episodes; median of the {len(recognised)} that touched the"
            f" object {1e3 * np.median(recognised):.2f} ms",
        ],
    )


def _warm(env: ProbeEnv, rng: np.random.Generator) -> None:
    """Step until the recogniser has run, which loads its kernels."""
    while env.belief is None:
        env.step(rng.uniform(-1.0, 1.0, 3))


def _mean_and_worst(seconds: NDArray[np.float64]) -> str:
    mean = float(seconds.mean())
    return (
        f"mean {1e3 * mean:.1f} ms ({1.0 / mean:,.0f} steps/s); worst {1e3 * seconds.max():,.1f} ms"
    )


def _rate_row(count: int, seed: int) -> Row:
    rng, spent = np.random.default_rng(seed), 0.0
    models = load_library()
    each = max(count // (len(models) * PLACES), 1)
    for model in steps(models, "steps: triads without the recogniser"):
        sensor, scene, placement, half_width = _triads(model, "ray")
        for _ in range(PLACES):
            scene.place(placement.draw(rng, model))
            commands = [_command(half_width, rng) for _ in range(each)]
            started = process_time()
            for command in commands:
                sensor.touch(scene, command, rng)
            spent += process_time() - started
    rate = each * PLACES * len(models) / spent
    return Row(
        "ray triads, without the recogniser", f"{rate:,.0f} /s", "10,000 /s", rate >= RATE_GOAL
    )


def _robotics_row(count: int, python: Path | None) -> Row:
    what = "HandManipulateBlock with touch sensors"
    command = [str(python or sys.executable), "-c", ROBOTICS_STEPS, str(count)]
    try:
        run = subprocess.run(command, capture_output=True, text=True, check=False)
    except OSError as error:
        return Row(what, "not measured", details=[f"{python}: {error.strerror}"])
    if run.returncode:
        reason = run.stderr.strip().splitlines()[-1:]
        missing = "No module named" in "".join(reason)
        return Row(what, "not installed" if missing else "does not run", details=reason)
    seconds, versions = json.loads(run.stdout.splitlines()[-1])
    median = float(np.median(seconds))
    return Row(
        what,
        f"{1.0 / median:,.0f} steps/s",
        details=[
            f"median {1e3 * median:.2f} ms; {_mean_and_worst(np.array(seconds))}",
            f"no recognition; {', '.join(versions)}",
        ],
    )
