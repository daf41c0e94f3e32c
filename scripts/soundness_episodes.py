"""Whole episodes of the soundness campaign: is the truth still held when probing ends?

Random probes at 0.01 in and pi/10, at most 40 each, in the simulation that `palpate episode` plays.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from time import perf_counter

import numpy as np
from numpy.typing import NDArray
from rich.table import Table

from ..envs.probe_env import ProbeEnv
from ..envs.scene import OBJECT
from ..policies import make_policy
from ..recognizer import pose_difference
from ..recognizer.rays import cast_rays

NEAR_ROTATION = np.radians(3.0)
NEAR_TRANSLATION = 0.01
"""How near (radians; share of the diameter) a pose that the contacts fix has to be to the truth:
the recogniser's own tolerance for one pose."""


@dataclass(frozen=True)
class Episode:
    """How one episode ended."""

    object_name: str
    seed: int
    kept: bool
    """The true interpretation is among the hypotheses and, where it fixes the pose, so is that."""
    unique: bool
    empty: bool
    probes: int
    contacts: int
    seconds: float


@cache
def _environment(object_name: str) -> ProbeEnv:
    """One an object and process: its tables take a second to build."""
    return ProbeEnv(object_name=object_name)


def play(object_name: str, seed: int) -> Episode:
    """Play one episode on a given object."""
    env = _environment(object_name)
    policy = make_policy("random")
    rng = np.random.default_rng(np.random.SeedSequence(seed).spawn(1)[0])
    started = perf_counter()
    observation, _ = env.reset(seed=seed)
    ended = False
    while not ended:
        observation, _, terminated, truncated, _ = env.step(policy.act(observation, rng))
        ended = terminated or truncated
    belief = env.belief
    return Episode(
        object_name=object_name,
        seed=seed,
        kept=belief is None or _holds_truth(env),
        unique=belief is not None and belief.unique,
        empty=belief is not None and belief.empty,
        probes=len(env.touches),
        contacts=len(env.contacts),
        seconds=perf_counter() - started,
    )


def _true_faces(env: ProbeEnv) -> NDArray[np.int64]:
    """(n,) the face that each contact so far was really on."""
    faces = []
    for touch in env.touches:
        meeting = touch.starts_world.mean(axis=0) * (1.0, 1.0, 0.0)
        directions = meeting - touch.starts_world
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        hits = cast_rays(env.true_object, env.T_world_object, touch.starts_world, directions)
        faces.append(hits.faces[touch.outcomes == OBJECT])
    return np.concatenate(faces)


def _holds_truth(env: ProbeEnv) -> bool:
    """Whether some hypothesis has the true interpretation and, if it fixes the pose, that too."""
    model, true_faces = env.true_object, _true_faces(env)
    for hypothesis in env.belief.hypotheses if env.belief else ():
        if hypothesis.object_name != model.name:
            continue
        if (hypothesis.interpretations == true_faces).all(axis=1).any():
            error = pose_difference(model, hypothesis.pose, env.T_world_object)
            near = (
                error.rotation < NEAR_ROTATION
                and error.translation < NEAR_TRANSLATION * model.diameter
            )
            return near or not hypothesis.determined
    return False


def episode_table(outcomes: Sequence[Episode]) -> Table:
    """A row an object, of the episodes played on it."""
    table = Table(
        "object", "truth kept", "empty", "wrong", "unique", "probes", "contacts", "s", box=None
    )
    for column in table.columns[1:]:
        column.justify = "right"
    for name in dict.fromkeys(outcome.object_name for outcome in outcomes):
        own = [outcome for outcome in outcomes if outcome.object_name == name]
        table.add_row(
            name,
            f"{sum(o.kept for o in own)}/{len(own)}",
            str(sum(o.empty for o in own)),
            str(sum(o.unique and not o.kept for o in own)),
            f"{np.mean([o.unique for o in own]):.0%}",
            f"{np.mean([o.probes for o in own]):.1f}",
            f"{np.mean([o.contacts for o in own]):.1f}",
            f"{np.mean([o.seconds for o in own]):.1f}",
        )
    return table
