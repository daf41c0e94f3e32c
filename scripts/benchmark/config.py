"""What a benchmark plays: strategies, objects, bounds, seeds, and the episodes these make."""

from __future__ import annotations

import json
import math
import platform
import re
import shlex
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, cast

from ...assets import STAND_IN_NAMES

if TYPE_CHECKING:
    from ...policies.outcomes.task import Goal

ALL_OBJECTS = "library"
"""The name of all stand-ins together, any of which it may be."""
VERSIONS_OF = ("palpate", "numpy", "scipy", "numba", "mujoco", "gymnasium")
METRES = {"in": 0.0254, "mm": 1e-3, "um": 1e-6, "µm": 1e-6, "m": 1.0}
RADIANS = {"deg": math.pi / 180.0, "°": math.pi / 180.0, "rad": 1.0}
NUMBER = re.compile(r"(\d+\.?\d*|\.\d+)(e-?\d+)?")
SHARE_OF_PI = re.compile(r"(?:pi|π)/([1-9]\d*(?:\.\d+)?)")


@dataclass(frozen=True)
class Noise:
    """Bounds on what is felt."""

    label: str
    """As they were asked for."""
    position_error: float
    """Metres."""
    normal_error: float
    """Radians."""


@dataclass(frozen=True)
class Setting:
    """What is touched, and how."""

    objects: str
    """As it was asked for."""
    noise: Noise
    sensor: str
    placement: str
    goal: Goal
    max_probes: int

    @property
    def library(self) -> tuple[str, ...] | str | None:
        """What the object may be, as `load_library` takes it."""
        if self.objects == ALL_OBJECTS:
            return None
        return (self.objects,) if self.objects in STAND_IN_NAMES else self.objects


@dataclass(frozen=True)
class Job:
    """One episode of a benchmark, to be played."""

    number: int
    setting: Setting
    policy: str
    episode: int
    seed: int


@dataclass(frozen=True, kw_only=True)
class BenchmarkConfig:
    """All that decides the rows of a benchmark."""

    policies: tuple[str, ...]
    """Names, or ``module:Class``."""
    objects: tuple[str, ...]
    """Names of stand-ins, `ALL_OBJECTS`, or folders of meshes."""
    noise: tuple[str, ...]
    """See `parse_noise`."""
    sensor: str = "ray"
    placement: str = "across"
    goal: str = "both"
    episodes: int = 200
    """A strategy and setting."""
    seed: int = 0
    """Of the first episode; the others' follow."""
    max_probes: int = 40

    def __post_init__(self) -> None:
        for name in ("policies", "objects", "noise"):
            given = getattr(self, name)
            if not given or len(set(given)) < len(given):
                raise ValueError(
                    f"{name} is {', '.join(given) or 'empty'}; name at least one, none twice"
                )
        if self.goal not in ("object", "pose", "both"):
            raise ValueError(f"goal is {self.goal!r}; it must be one of object, pose, both")
        if self.episodes < 1 or self.max_probes < 1 or self.seed < 0:
            raise ValueError(
                f"episodes is {self.episodes}, max_probes {self.max_probes}, seed {self.seed};"
                " the first two must be at least 1, the seed at least 0"
            )
        for name in self.objects:
            known = name in STAND_IN_NAMES or name == ALL_OBJECTS
            if not known and not Path(name).is_dir():
                raise ValueError(
                    f"no object is called {name!r}, nor is it a folder; there are:"
                    f" {', '.join(STAND_IN_NAMES)}, and {ALL_OBJECTS} for all of them"
                )
        for text in self.noise:
            parse_noise(text)

    @property
    def settings(self) -> tuple[Setting, ...]:
        """Objects by bounds."""
        return tuple(
            Setting(
                objects,
                parse_noise(text),
                self.sensor,
                self.placement,
                cast("Goal", self.goal),
                self.max_probes,
            )
            for objects in self.objects
            for text in self.noise
        )

    def jobs(self) -> Iterator[Job]:
        """All episodes, in order: an episode of every strategy and setting before the next."""
        number = 0
        for episode in range(self.episodes):
            for setting in self.settings:
                for policy in self.policies:
                    yield Job(number, setting, policy, episode, self.seed + episode)
                    number += 1

    def __len__(self) -> int:
        """How many episodes there are."""
        return self.episodes * len(self.objects) * len(self.noise) * len(self.policies)

    def command(self, folder: Path) -> str:
        """The command line that plays it."""
        words = ["palpate", "benchmark", "--policies", ",".join(self.policies)]
        for objects in self.objects:
            words += ["--objects", objects]
        for noise in self.noise:
            words += ["--noise", noise]
        for name in ("sensor", "placement", "goal", "episodes", "seed", "max_probes"):
            words += ["--" + name.replace("_", "-"), str(getattr(self, name))]
        return shlex.join([*words, "--out", str(folder)])


def parse_noise(text: str) -> Noise:
    """Bounds from text: on normals, then on positions, each with its unit.

    Args:
        text: as in ``pi/8,0.05in`` (the memo's way), ``22.5deg,1.27mm``, ``0.3rad,1e-4m``.

    Raises:
        ValueError: anything else.
    """
    angle, _, length = (word.strip() for word in text.partition(","))
    share = SHARE_OF_PI.fullmatch(angle)
    normal_error = math.pi / float(share[1]) if share else _measured(angle, RADIANS)
    position_error = _measured(length, METRES)
    if normal_error is None or position_error is None:
        raise ValueError(
            f"noise is {text!r}; it is a bound on normals and one on positions, with their units,"
            " such as pi/8,0.05in or 22.5deg,1.27mm"
        )
    return Noise(f"{angle},{length}", position_error, normal_error)


def _measured(text: str, units: Mapping[str, float]) -> float | None:
    """A number with its unit; None if it isn't one."""
    read = NUMBER.match(text)
    unit = units.get(text[read.end() :].strip()) if read else None
    return float(read[0]) * unit if read and unit else None


@cache
def versions() -> str:
    """What plays an episode, as JSON."""
    found = {name: _version(name) for name in VERSIONS_OF}
    own = {"python": platform.python_version(), "machine": platform.machine()}
    return json.dumps(found | own)


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:  # imported from a checkout
        return "not installed"
