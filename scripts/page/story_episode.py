"""The story of an episode in simulation, for a page to show."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ...envs.pictures.episode import Episode
from ...envs.pictures.episode_picture import RAY_LENGTH, last_stretch
from ...envs.pictures.film_script import EpisodeRecord
from ...envs.probe_env import ProbeEnv
from ...envs.scene.scene import NOTHING, OBJECT, PLANE
from ...envs.sensors.touch import Touch
from ...policies import Policy
from ...recognizer import Contacts
from ..benchmark.playing import probes
from .episode_story import verdict_in_short
from .story import HIT, MISSED, OTHER, Moment, Story, Ways

__all__ = ["episode_stories", "episode_story"]

NAMES = {OBJECT: "the object", PLANE: "the plane", NOTHING: "nothing"}
MET = {OBJECT: HIT, PLANE: OTHER, NOTHING: MISSED}


def episode_story(record: EpisodeRecord) -> Story:
    """Tell an episode that is over."""
    probed = [_moment(record, number) for number in range(1, len(record.probes) + 1)]
    return _story(record, (_untouched(record), *probed), record.verdict)


def episode_stories(env: ProbeEnv, policy: Policy, seed: int) -> Iterator[Story]:
    """Play an episode, and tell it before the first probe, after each, and at its end.

    Args:
        env: its episode starts when the first story is asked for.
        policy: what chooses the probes.
        seed: of the episode.
    """
    _, info = env.reset(seed=seed)  # as `probes` will, to the bit
    record = EpisodeRecord(Episode.of(env, info), (), ("", ""))
    moments = (_untouched(record),)
    yield _story(record, moments)
    for number, probed in enumerate(probes(env, policy, seed), 1):
        record = replace(record, probes=(*record.probes, probed))
        moments = (*moments, _moment(record, number))
        yield _story(record, moments)
    yield _story(record, moments, verdict_in_short(record.probes[-1]))


def _story(
    record: EpisodeRecord, moments: tuple[Moment, ...], ending: tuple[str, str] = ("", "")
) -> Story:
    library = record.start.library
    return Story(
        title="An unknown object",
        subtitle=f"one of {len(library)} that palpate knows; each touch rules some out",
        models=library,
        moments=moments,
        ending=ending,
        truth=record.start.true_object.name,
        plane=0.0,
    )


def _untouched(record: EpisodeRecord) -> Moment:
    told = "every object at every pose is possible"
    begun = record.start.T_world_object.as_matrix()
    nothing = Contacts.none()
    return Moment("Before the first probe", told, Ways.none(), nothing, 0, None, begun)


def _moment(record: EpisodeRecord, number: int) -> Moment:
    probed = record.probes[number - 1]
    touch = probed.touches[-1]
    return Moment(
        f"Probe {number}",
        _met(touch),
        _ways(touch, RAY_LENGTH * probed.true_object.diameter),
        probed.contacts,
        min(len(touch.contacts), len(probed.contacts)),
        probed.belief,
        probed.T_world_object.as_matrix(),
    )


def _ways(touch: Touch, length: float) -> Ways:
    """The last stretch of each ray: all of it would dwarf the object."""
    stretches = last_stretch(touch, length)
    met = [MET[int(outcome)] for outcome in touch.outcomes]
    return Ways(stretches[:, 0], stretches[:, 1], np.array(met, np.int8))


def _met(touch: Touch) -> str:
    """What the rays of a probe met, in words."""
    counted = Counter(int(outcome) for outcome in touch.outcomes)
    rays = len(touch.outcomes)
    if len(counted) > 1:
        met = ", ".join(f"{many} met {NAMES[what]}" for what, many in counted.most_common())
        return f"of its {rays} rays {met}"
    (only,) = counted
    return f"{f'all its {rays} rays' if rays > 1 else 'its ray'} met {NAMES[only]}"
