"""Play one episode with a strategy, and say how it went."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from time import perf_counter, process_time

import numpy as np
from numpy.typing import NDArray

from ...envs.pictures.episode import Episode
from ...envs.probe_env import REACH, ProbeEnv
from ...envs.sensors.ball_sensor import BallSensor
from ...envs.sensors.finger_sensor import FingerSensor
from ...envs.sensors.touch import Sensor
from ...envs.truth import Truth
from ...policies import Policy, RandomProbe
from ...policies.outcomes.task import Goal, Task
from ...recognizer import Belief, Polyhedron, pose_difference
from ...recognizer.predict.probes import ProbeSpace
from .config import Job, Setting, versions
from .row import GAVE_UP, NOTHING_FITS, SOLVED, EpisodeRow


@dataclass
class _Story:
    """What an episode's probes led to, in the making."""

    contacts_felt: list[int]
    hypotheses: list[int]
    interpretations: list[int]
    seconds: list[float]
    processor_seconds: list[float]
    complete: bool = True

    def add(self, env: ProbeEnv) -> None:
        """Note what is left after a probe."""
        belief = env.belief
        self.contacts_felt.append(len(env.contacts))
        self.hypotheses.append(len(belief.hypotheses) if belief else 0)
        self.interpretations.append(belief.interpretations if belief else 0)
        self.complete &= belief is None or belief.complete


def task_of(env: ProbeEnv, goal: Goal = "both") -> Task:
    """What a strategy may know of an environment before the first probe.

    Args:
        env: with one sensor.
        goal: what is to be found out.

    Raises:
        ValueError: an unknown goal.
    """
    sensor = env.sensors[0]
    largest = max(model.diameter for model in env.library)
    return Task(
        library=env.library,
        space=ProbeSpace(half_width=env.half_width, reach=REACH * largest),
        position_error=sensor.noise.position_error,
        normal_error=sensor.noise.normal_error,
        radius=_radius(sensor),
        goal=goal,
        tolerance=env.recognizer.tolerance,
        free_space=env.use_free_space,
    )


def _radius(sensor: Sensor) -> float:
    """Of what a sensor moves along its rays, metres."""
    if isinstance(sensor, FingerSensor):
        return sensor.design.radius
    return sensor.radius if isinstance(sensor, BallSensor) else 0.0


def make_env(setting: Setting) -> ProbeEnv:
    """The environment of a setting.

    Raises:
        ValueError: what `ProbeEnv` doesn't take.
    """
    return ProbeEnv(
        setting.library,
        placement=setting.placement,  # pyright: ignore[reportArgumentType]  it checks
        sensor=setting.sensor,
        position_error=setting.noise.position_error,
        normal_error=setting.noise.normal_error,
        max_probes=setting.max_probes,
    )


def probes(env: ProbeEnv, policy: Policy, seed: int) -> Iterator[Episode]:
    """Play an episode until the environment ends it; how it stands after each probe.

    Args:
        env: its episode starts when the first probe is asked for.
        policy: what chooses the probes.
        seed: of object, pose and noise; the strategy's stream is a child of it, and never meets
            the environment's own.
    """
    rng = np.random.default_rng(np.random.SeedSequence(seed).spawn(1)[0])
    observation, _ = env.reset(seed=seed)
    ended = False
    while not ended:
        observation, _, terminated, truncated, info = env.step(policy.act(observation, rng))
        ended = terminated or truncated
        yield Episode.of(env, info)


@dataclass
class Opening:
    """An episode after its first probe, which no strategy has a say in."""

    env: ProbeEnv
    observation: dict[str, NDArray[np.generic]]
    rng: np.random.Generator
    first: NDArray[np.floating]
    """The action of the first probe."""
    story: _Story
    ended: str
    """How the episode has ended already; empty if it hasn't."""
    truth: Truth[Polyhedron]


def open_episode(env: ProbeEnv, job: Job) -> Opening:
    """Begin an episode, as every strategy finds it.

    Object, pose, first probe and the noise of each probe are the seed's, whatever the strategy: the
    first probe is that of `RandomProbe`, from the stream that the strategy goes on with. It is a
    child of the seed's, not the environment's own.

    Args:
        env: of the job's setting.
        job: which episode.
    """
    rng = np.random.default_rng(np.random.SeedSequence(job.seed).spawn(1)[0])
    observation, _ = env.reset(seed=job.seed)
    first = RandomProbe(task_of(env, job.setting.goal)).act(observation, rng)
    observation, _, _, truncated, info = env.step(first)
    story = _Story([], [], [], [], [])
    story.add(env)
    ended = _outcome(env.belief, job.setting.goal) or (GAVE_UP if truncated else "")
    return Opening(env, observation, rng, first, story, ended, Truth.of(env.library, info))


def play(opening: Opening, policy: Policy, job: Job) -> EpisodeRow:
    """Play an episode until the goal is reached, nothing fits, or no probe is left.

    Args:
        opening: of the job's episode; it is used up.
        policy: what chooses the probes after the first; if it has a ``reset``, that is called.
        job: which episode.
    """
    env, observation, story = opening.env, opening.observation, opening.story
    ended, truth = opening.ended, opening.truth
    getattr(policy, "reset", lambda: None)()
    while not ended:
        action = _timed_choice(policy, observation, opening.rng, story)
        observation, _, _, truncated, info = env.step(action)
        truth = Truth.of(env.library, info)
        story.add(env)
        ended = _outcome(env.belief, job.setting.goal) or (GAVE_UP if truncated else "")
    return _row(env, truth, job, ended, opening.first, story)


def _timed_choice(
    policy: Policy,
    observation: dict[str, NDArray[np.generic]],
    rng: np.random.Generator,
    story: _Story,
) -> NDArray[np.floating]:
    clock, processor = perf_counter(), process_time()
    action = policy.act(observation, rng)
    story.processor_seconds.append(process_time() - processor)
    story.seconds.append(perf_counter() - clock)
    return action


def _outcome(belief: Belief | None, goal: Goal) -> str:
    """How an episode with this belief has ended; empty if it hasn't."""
    if belief is None:
        return ""
    if belief.empty:
        return NOTHING_FITS
    one_object = len({hypothesis.object_name for hypothesis in belief.hypotheses}) == 1
    known = belief.unique or (goal == "object" and one_object and belief.complete)
    return SOLVED if known else ""


def _row(
    env: ProbeEnv,
    truth: Truth[Polyhedron],
    job: Job,
    ended: str,
    first: NDArray[np.floating],
    story: _Story,
) -> EpisodeRow:
    setting = job.setting
    found, errors = _compared(env.belief, truth)
    near = False
    if errors:
        tolerance = env.recognizer.tolerance
        most = tolerance.distance(truth.model.diameter, setting.noise.position_error)
        near = errors[0] <= tolerance.rotation and errors[1] <= most
    right = {SOLVED: found and (near or setting.goal == "object"), NOTHING_FITS: False}
    median, tail = (
        (float(value) for value in np.percentile(story.processor_seconds, (50, 99)))
        if story.processor_seconds
        else (None, None)
    )
    return EpisodeRow(
        number=job.number,
        policy=job.policy,
        objects=setting.objects,
        noise=setting.noise.label,
        position_error=setting.noise.position_error,
        normal_error=setting.noise.normal_error,
        sensor=setting.sensor,
        placement=setting.placement,
        goal=setting.goal,
        max_probes=setting.max_probes,
        diameter=max(model.diameter for model in env.library),
        episode=job.episode,
        seed=job.seed,
        true_object=truth.model.name,
        ended=ended,
        probes=len(env.touches),
        contacts=story.contacts_felt[-1],
        right=right.get(ended),
        rotation_error=errors[0] if errors else None,
        translation_error=errors[1] if errors else None,
        complete=story.complete,
        first_probe=tuple(float(number) for number in first),
        contacts_felt=tuple(story.contacts_felt),
        hypotheses=tuple(story.hypotheses),
        interpretations=tuple(story.interpretations),
        decision_seconds=tuple(story.seconds),
        decision_processor_seconds=tuple(story.processor_seconds),
        decision_median=median,
        decision_p99=tail,
        versions=versions(),
    )


def _compared(
    belief: Belief | None, truth: Truth[Polyhedron]
) -> tuple[bool, tuple[float, float] | None]:
    """Whether the heaviest hypothesis is of the true object; then, by how much its pose is off."""
    model = truth.model
    if belief is None or belief.empty or belief.hypotheses[0].object_name != model.name:
        return False, None
    error = pose_difference(model, belief.hypotheses[0].pose, truth.T_world_object)
    return True, (float(error.rotation), float(error.translation))
