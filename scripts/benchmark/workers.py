"""Who plays the episodes: this process, others of this machine, or a Ray cluster."""

from __future__ import annotations

import io
import os
import pickle
import sys
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import cache, lru_cache, partial
from importlib import import_module
from itertools import islice
from typing import TYPE_CHECKING, Any

from .config import Job, Setting
from .row import EpisodeRow

if TYPE_CHECKING:
    from ...envs.probe_env import ProbeEnv
    from .playing import Opening

BACKENDS = ("joblib", "ray")
AHEAD = 2
"""Episodes handed out a worker before the first is back."""

Play = Callable[[Job], EpisodeRow]


def play_all(
    play: Play, jobs: Iterable[Job], *, workers: int, backend: str
) -> Iterator[EpisodeRow]:
    """Play jobs and give their rows as they end, in any order.

    Args:
        play: what plays one.
        jobs: which.
        workers: how many at a time.
        backend: one of `BACKENDS`.

    Raises:
        ValueError: an unknown backend, or one that isn't installed.
    """
    if backend not in BACKENDS:
        raise ValueError(f"backend is {backend!r}; it must be one of {', '.join(BACKENDS)}")
    if backend == "ray":
        return _on_ray(play, jobs, workers)
    return map(play, jobs) if workers == 1 else _on_joblib(play, jobs, workers)


def _on_joblib(play: Play, jobs: Iterable[Job], workers: int) -> Iterator[EpisodeRow]:
    joblib = _installed("joblib", "benchmark")
    run = joblib.Parallel(n_jobs=workers, return_as="generator_unordered", batch_size=1)
    return run(joblib.delayed(play)(job) for job in jobs)


def _on_ray(play: Play, jobs: Iterable[Job], workers: int) -> Iterator[EpisodeRow]:
    """A task an episode. One whose machine dies is played again elsewhere, to the same row."""
    ray = _installed("ray", "ray")
    if not ray.is_initialized():
        # Ray's own variable names a cluster that is there; without it one is started here.
        there = {"address": "auto"} if "RAY_ADDRESS" in os.environ else {"num_cpus": workers}
        here = {"address": "local", "include_dashboard": False}
        ray.init(**(here | there), log_to_driver=False, logging_level="ERROR")
    task = ray.remote(max_retries=-1)(_call)
    waiting, running = iter(jobs), []
    while True:
        running += [
            task.remote(play, job) for job in islice(waiting, AHEAD * workers - len(running))
        ]
        if not running:
            return
        ended, running = ray.wait(running)
        yield from ray.get(ended)


def _call(play: Play, job: Job) -> EpisodeRow:
    return play(job)


def _installed(module: str, extra: str) -> Any:
    try:
        return import_module(module)
    except ImportError as missing:
        raise ValueError(f"{module} isn't installed: pip install 'palpate[{extra}]'") from missing


def player(folder: str) -> Play:
    """What plays a job in any process; strategies are also looked for in ``folder``."""
    return partial(_play_job, folder)


def _play_job(folder: str, job: Job) -> EpisodeRow:
    from ..one_thread import keep_to_one_thread

    keep_to_one_thread()
    look_in(folder)
    from ...policies import make_policy
    from .playing import play, task_of

    _warm_up(job.policy)
    opening = _opening(job)
    # A fresh one for each episode: whatever it remembers, rows don't depend on who played before.
    policy = make_policy(job.policy, task_of(opening.env, job.setting.goal))
    return play(opening, policy, job)


class _Sparing(pickle.Pickler):
    """Leaves out what never changes: tables are most of an environment."""

    def __init__(self, file: io.BytesIO, env: ProbeEnv) -> None:
        super().__init__(file, pickle.HIGHEST_PROTOCOL)
        self._places = {id(one): place for place, one in enumerate(_unchanging(env))}

    def persistent_id(self, obj: object) -> int | None:
        return self._places.get(id(obj))


class _Restoring(pickle.Unpickler):
    """Puts it in again."""

    def __init__(self, file: io.BytesIO, env: ProbeEnv) -> None:
        super().__init__(file)
        self._unchanging = _unchanging(env)

    def persistent_load(self, pid: int) -> object:
        return self._unchanging[pid]


def _unchanging(env: ProbeEnv) -> list[object]:
    return [env.recognizer, *env.library]


def _opening(job: Job) -> Opening:
    """The beginning of a job's episode, a copy of its own.

    What is felt first is the same for every strategy, and often takes longest to make sense of.
    """
    kept = _kept_opening(replace(job, number=0, policy=""))
    return _Restoring(io.BytesIO(kept), environment(job.setting)).load()


@lru_cache(maxsize=1)  # the strategies of an episode come one after another
def _kept_opening(job: Job) -> bytes:
    from .playing import open_episode

    env = environment(job.setting)
    kept = io.BytesIO()
    _Sparing(kept, env).dump(open_episode(env, job))
    return kept.getvalue()


def look_in(folder: str) -> None:
    """Have modules found in a folder too, behind all others."""
    if folder not in sys.path:
        sys.path.append(folder)


@cache
def environment(setting: Setting) -> ProbeEnv:
    """The environment of a setting, one a process: its tables take a second to build.

    Raises:
        ValueError: see `make_env`.
    """
    from .playing import make_env

    return make_env(setting)


@cache
def _warm_up(policy_name: str) -> None:
    """Let what happens once a process (imports, kernels that load) happen outside the clock."""
    from ...policies import make_policy
    from .config import parse_noise
    from .playing import open_episode, play, task_of

    setting = Setting("simple-hand", parse_noise("pi/10,0.01in"), "ray", "across", "both", 3)
    env = environment(setting)
    job = Job(0, setting, policy_name, 0, 0)
    play(open_episode(env, job), make_policy(policy_name, task_of(env)), job)
