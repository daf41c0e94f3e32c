"""What it is worth to know that an object rests on the plane: probes until one hypothesis is left.

The same random probes, object for object and seed for seed, three ways: held across the plane at
any orientation; resting, and the recogniser isn't told; resting, and it is told.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import bootstrap

from ....envs.library import load_library
from ....envs.probe_env import HALF_WIDTH, INCH, REACH
from ....envs.scene.placement import AcrossPlane, Placement, Resting
from ....envs.scene.scene import ProbeScene
from ....envs.sensors.noise import SensorNoise
from ....envs.sensors.ray_sensor import RaySensor
from ....envs.sensors.touch import ProbeCommand
from ....recognizer import Contacts, Polyhedron, Recognizer, SearchLimits
from .report import Row, Section, steps

Floats = NDArray[np.float64]

MOST_PROBES = 40
"""Where an episode ends without an answer; it then counts as so many."""
LIMITS = SearchLimits(budget=10_000, nodes=1_000_000)
"""So that no step takes minutes; where they cut a search short nothing is called unique."""
CONFIDENCE = 0.95
ACROSS, UNTOLD, TOLD = "across", "resting, not told", "resting, told"


@dataclass(frozen=True)
class Ending:
    """How one episode ended."""

    probes: int
    unique: bool


def measure_placement(episodes: int, seed: int) -> list[Section]:
    """How many probes fewer a resting object needs, by object and in all.

    Args:
        episodes: of each object and each of the three ways.
        seed: of poses, probes and noise.
    """
    models = load_library()
    recognizer = Recognizer(models)
    found: dict[str, dict[str, list[Ending]]] = {}
    for model in models:
        ways = [(way, k) for k in range(episodes) for way in (ACROSS, UNTOLD, TOLD)]
        found[model.name] = {ACROSS: [], UNTOLD: [], TOLD: []}
        for way, index in steps(ways, f"placement: {model.name}"):
            ending = _play(recognizer, model, way, np.random.SeedSequence((seed, index)))
            found[model.name][way].append(ending)
    note = (
        f"Ray sensor, 0.01 in and pi/10, {episodes} random episodes an object, the same probes in"
        f" each; one that has no answer after {MOST_PROBES} probes counts as {MOST_PROBES}. Mean"
        f" difference, and the interval that holds it with {CONFIDENCE:.0%} (bootstrap over pairs)."
    )
    return [
        Section(
            "probes until one hypothesis is left: resting on the known plane, less across it",
            _rows(found, ACROSS, seed),
            note,
        ),
        Section(
            "the same: resting on the known plane, less resting on a plane that isn't told",
            _rows(found, UNTOLD, seed),
            "Here the touches are the same, and only what the recogniser knows differs.",
        ),
    ]


def _play(
    recognizer: Recognizer, model: Polyhedron, way: str, seeds: np.random.SeedSequence
) -> Ending:
    posed, sent, read = (np.random.default_rng(s) for s in seeds.spawn(3))
    largest = max(one.diameter for one in recognizer.models)
    half_width = HALF_WIDTH * largest
    offset = 0.2 * half_width
    placement: Placement = AcrossPlane(offset=offset) if way == ACROSS else Resting(offset=offset)
    scene = ProbeScene(model)
    scene.place(placement.draw(posed, model))
    noise = SensorNoise(position_error=0.01 * INCH, normal_error=np.pi / 10.0)
    sensor = RaySensor(noise, REACH * largest)
    # As the environment does it: one plane for all, whose error is that of the largest object.
    plane = Resting(offset=offset).support(max(recognizer.models, key=lambda one: one.diameter))
    contacts = Contacts.none()
    for probe in range(1, MOST_PROBES + 1):
        x, y, yaw = sent.uniform(-1.0, 1.0, 3) * (half_width, half_width, np.pi / 3.0)
        touch = sensor.touch(scene, ProbeCommand(float(x), float(y), float(yaw)), read)
        if not len(touch.contacts):
            continue
        contacts = Contacts.join([contacts, touch.contacts])
        belief = recognizer.recognize(contacts, support=plane if way == TOLD else None)
        if belief.unique or belief.empty:
            return Ending(probe, belief.unique)
    return Ending(MOST_PROBES, False)


def _rows(found: dict[str, dict[str, list[Ending]]], other: str, seed: int) -> list[Row]:
    rows = [_row(name, ways[TOLD], ways[other], other, seed) for name, ways in found.items()]
    told = [ending for ways in found.values() for ending in ways[TOLD]]
    others = [ending for ways in found.values() for ending in ways[other]]
    return [*rows, _row("all", told, others, other, seed)]


def _row(name: str, told: Sequence[Ending], others: Sequence[Ending], other: str, seed: int) -> Row:
    differences = np.array([float(a.probes - b.probes) for a, b in zip(told, others, strict=True)])
    low, high = interval(differences, np.random.default_rng(seed))
    return Row(
        name,
        f"{differences.mean():+.1f} ({low:+.1f} to {high:+.1f})",
        "fewer" if other == ACROSS else "",
        high < 0.0 if other == ACROSS else None,
        [f"{_words(TOLD, told)}; {_words(other, others)}"],
    )


def _words(way: str, endings: Sequence[Ending]) -> str:
    probes = np.mean([ending.probes for ending in endings])
    return f"{way}: {probes:.1f} probes, unique {np.mean([e.unique for e in endings]):.0%}"


def interval(differences: Floats, rng: np.random.Generator) -> tuple[float, float]:
    """The bootstrap's interval of a mean, by percentiles; of equal numbers it is the number."""
    if np.ptp(differences) == 0.0:
        return float(differences[0]), float(differences[0])
    found = bootstrap(
        (differences,), np.mean, confidence_level=CONFIDENCE, method="percentile", rng=rng
    ).confidence_interval
    return float(found.low), float(found.high)
