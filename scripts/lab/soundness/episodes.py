"""Whole episodes of the soundness campaign: is the truth held from the first touch to the last?

Random probes, every sensor and every way to place an object. After each step the true pose has to
be in the belief, see `soundness_truth`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from time import perf_counter
from typing import Any

import numpy as np

from ....envs.planar.planar_env import PlanarProbeEnv
from ....envs.probe_env import ProbeEnv
from ....envs.truth import Truth
from ....recognizer import Belief, SearchLimits
from .case import Case
from .truth import false_reports, pose_error, possible_features, true_hypotheses

LIMITS = SearchLimits(budget=2000, nodes=1_000_000)
"""So that no step takes minutes, after two or three contacts on planes that are nearly parallel; an
environment's own are fifty and twenty times as much."""
SENSORS = {"ray": 25, "ball": 15, "finger": 15, "range": 4, "range-grid": 4, "planar": 25}
"""Every sensor, and how many probes an episode has; "planar" is `PlanarProbeEnv` and its rays."""
PLACEMENTS: dict[str, dict[str, Any]] = {
    "across": {"placement": "across"},
    "resting": {"placement": "resting"},
    "dropped": {"placement": "dropped"},
    "free": {"placement": "resting", "free": True, "force_threshold": 2.0},
}
"""Every way to place an object, as `ProbeEnv` takes it; one that is free is pushed about by the
finger, and what is judged is the pose after each probe, by the bounds that contacts then have."""
MOVERS = ("finger",)
"""Sensors that move what is free."""
MOST_OFF = 2.0
"""How far from the truth a pose that the contacts fix may be, in pose tolerances: one for what
counts as the same pose, one for what contacts leave open when they are said to fix it."""


def settings(
    sensors: Sequence[str] | None = None, placements: Sequence[str] | None = None
) -> tuple[str, ...]:
    """What episodes can be of, ``SENSOR/PLACEMENT``; by default all."""
    everything = [
        (sensor, placement)
        for sensor in SENSORS
        for placement in (("plane",) if sensor == "planar" else PLACEMENTS)
        if placement != "free" or sensor in MOVERS
    ]
    return tuple(
        f"{sensor}/{placement}"
        for sensor, placement in everything
        if sensor in (sensors or SENSORS) and placement in (placements or (*PLACEMENTS, "plane"))
    )


SETTINGS = settings()


@dataclass(frozen=True)
class Episode:
    """How one episode went."""

    name: str
    """``SENSOR/PLACEMENT:INDEX``."""
    object_name: str
    lost: int
    """After how many probes the true pose was not in the belief, though no limit had cut short the
    search of its object."""
    short: bool
    """A limit did cut short some search of the true object."""
    unique: bool
    """It ended with one hypothesis."""
    empty: bool
    """It ended with none."""
    untrue: tuple[str, ...]
    """What was reported, of contacts and paths, that breaks its own bounds."""
    off: float
    """How far the pose is off that is left, in pose tolerances, if one hypothesis is; else 0."""
    probes: int
    contacts: int
    seconds: float

    @property
    def index(self) -> int:
        """Its number in its setting."""
        return int(self.name.partition(":")[2])

    @property
    def kept(self) -> bool:
        """Whether the true pose was in every belief."""
        return self.lost == 0

    @property
    def wrong(self) -> bool:
        """Whether it ended with one hypothesis, and that not the truth."""
        return self.unique and (not self.kept or self.off > MOST_OFF)

    @property
    def failed(self) -> bool:
        """Whether anything was not as promised."""
        return not self.kept or self.wrong or bool(self.untrue)


def play(setting: str, seed: int, index: int, probes: int | None = None) -> Episode:
    """Play one episode.

    Args:
        setting: one of `SETTINGS`.
        seed: of the campaign.
        index: of the episode; every second has Gaussian noise, every second pair is told of free
            space (both of "planar" apart, which knows neither).
        probes: at most so many; None for the sensor's own number.
    """
    env = _environment(setting, bool(index & 1), bool(index & 2))
    placed, ways = np.random.SeedSequence((seed, index)).spawn(2)
    rng = np.random.default_rng(ways)
    most = probes or SENSORS[setting.partition("/")[0]]
    started = perf_counter()
    _, info = env.reset(seed=int(placed.generate_state(1)[0]))
    ended, short, lost = False, False, 0
    while not ended and len(env.touches) < most:
        before = env.belief
        action = rng.uniform(-1.0, 1.0, env.action_space.shape)
        _, _, ended, _, info = env.step(action)
        if env.belief is not None and env.belief is not before:
            complete, held = _verdict(_case(env, env.belief, info), env.belief)
            short |= not complete
            lost += complete and not held
    belief = env.belief
    return Episode(
        name=f"{setting}:{index}",
        object_name=info["truth"]["object"],
        lost=lost,
        short=short,
        unique=belief is not None and belief.unique,
        empty=belief is not None and belief.empty,
        untrue=() if belief is None else _untrue(_case(env, belief, info)),
        off=0.0 if belief is None else _off(_case(env, belief, info), belief),
        probes=len(env.touches),
        contacts=len(env.contacts),
        seconds=perf_counter() - started,
    )


@cache
def _environment(setting: str, gaussian: bool, free_space: bool) -> ProbeEnv | PlanarProbeEnv:
    """One a process: tables take up to a second to build."""
    sensor, _, placement = setting.partition("/")
    if sensor == "planar":
        return PlanarProbeEnv(limits=LIMITS)
    return ProbeEnv(
        sensor=sensor,
        distribution="gaussian" if gaussian else "uniform",
        use_free_space=free_space,
        limits=LIMITS,
        **PLACEMENTS[placement],
    )


def _verdict(case: Case, belief: Belief) -> tuple[bool, bool]:
    """Whether the search of the true object ran to its end, and whether the truth is held."""
    held = bool(true_hypotheses(case, belief, possible_features(case)))
    searches = {search.object_name: search for search in belief.searches}
    return searches[case.model.name].complete, held


def _untrue(case: Case) -> tuple[str, ...]:
    """What of all that was reported is not so."""
    return tuple(false_reports(case, possible_features(case)))


def _case(env: ProbeEnv | PlanarProbeEnv, belief: Belief, info: dict[str, Any]) -> Case:
    """What a belief is about, as the campaign's judge takes it."""
    planar = isinstance(env, PlanarProbeEnv)
    truth = Truth.of(env.library, info)
    return Case(
        name="",
        model=truth.model,
        recognizer=env.recognizer,
        truth=truth.T_world_object,
        interpretation=np.zeros(len(belief.contacts), np.int32),
        contacts=belief.contacts,
        free_space=None if planar else belief.free_space,
        support=belief.support,
    )


def _off(case: Case, belief: Belief) -> float:
    """How far the only pose that is left is off, in pose tolerances; infinite of another object."""
    if not belief.unique:
        return 0.0
    (hypothesis,) = belief.hypotheses
    if hypothesis.object_name != case.model.name:
        return np.inf
    turn, shift = pose_error(case.model, hypothesis.pose, case.truth)
    tolerance = case.recognizer.tolerance
    error = float(belief.contacts.position_error.max())
    most = tolerance.distance(case.model.diameter, error)
    return max(turn / tolerance.rotation, shift / most)


HEADS = ("truth kept", "cut short", "empty", "wrong", "unique", "off", "probes", "contacts", "s")
"""Columns of the table of episodes, after what they are of."""
WIDTH = 11
"""Of a column, characters."""


def raised(name: str, error: Exception) -> Episode:
    """The outcome of an episode that could not be played."""
    what = f"raised {type(error).__name__}: {error}"
    return Episode(name, "", 0, False, False, False, (what,), 0.0, 0, 0, 0.0)


def tell(episode: Episode) -> str:
    """What was not as promised in an episode, in words."""
    told = [f"the true pose was not in {episode.lost} beliefs"] if episode.lost else []
    if episode.wrong:
        told.append(f"ended with one hypothesis, off by {episode.off:.3g} pose tolerances")
    told += episode.untrue
    verdict = "; ".join(told) if told else "held"
    return (
        f"{verdict}\n    {episode.object_name}, {episode.probes} probes, {episode.contacts}"
        f" contacts, {'one hypothesis left, ' if episode.unique else ''}{episode.seconds:.1f} s"
    )


def head_line() -> str:
    """The heads of the table's columns."""
    return f"{'':<20}" + "".join(f"{head:>{WIDTH}}" for head in HEADS)


def line(setting: str, outcomes: Sequence[Episode]) -> str:
    """A line of the table: what became of a setting's episodes."""
    cells = (
        f"{sum(o.kept for o in outcomes)}/{len(outcomes)}",
        str(sum(o.short for o in outcomes)),
        str(sum(o.empty for o in outcomes)),
        str(sum(o.wrong for o in outcomes)),
        f"{np.mean([o.unique for o in outcomes]):.0%}",
        f"{max(o.off for o in outcomes):.2f}",
        f"{np.mean([o.probes for o in outcomes]):.1f}",
        f"{np.mean([o.contacts for o in outcomes]):.1f}",
        f"{np.mean([o.seconds for o in outcomes]):.2f}",
    )
    return f"{setting:<20}" + "".join(f"{cell:>{WIDTH}}" for cell in cells)
