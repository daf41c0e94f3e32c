"""Benchmarks whose episodes nobody has to play."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

from palpate.scripts.benchmark.config import BenchmarkConfig, Job
from palpate.scripts.benchmark.row import GAVE_UP, SOLVED, EpisodeRow

MOST = 20


def small(**changes) -> BenchmarkConfig:
    """One object, one noise, two strategies."""
    config = BenchmarkConfig(
        policies=("random", "quick"),
        objects=("simple-hand",),
        noise=("pi/8,0.05in",),
        episodes=10,
        max_probes=MOST,
    )
    return replace(config, **changes)


def made_up_row(job: Job, probes: int | None = None, **changes) -> EpisodeRow:
    """An episode solved with ``probes``, more than allowed is never; by default the seed's."""
    setting, rng = job.setting, np.random.default_rng(job.seed)
    wanted = int(rng.integers(2, MOST + 3)) if probes is None else probes
    sent = min(wanted, setting.max_probes)
    solved = wanted <= setting.max_probes
    left = [2 + sent - number for number in range(1, sent)] + [1 if solved else 2]
    times = tuple(time.perf_counter() + number for number in range(sent - 1))
    row = EpisodeRow(
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
        diameter=0.2,
        episode=job.episode,
        seed=job.seed,
        true_object="simple-hand",
        ended=SOLVED if solved else GAVE_UP,
        probes=sent,
        contacts=2 * sent,
        right=True if solved else None,
        rotation_error=0.01,
        translation_error=None,
        complete=True,
        first_probe=(0.25, -0.5, 1.0),
        contacts_felt=tuple(range(2, 2 * sent + 2, 2)),
        hypotheses=tuple(left),
        interpretations=tuple(left),
        decision_seconds=times,
        decision_processor_seconds=times,
        decision_median=0.001,
        decision_p99=0.002,
        versions='{"palpate": "0.1.0", "python": "3.11"}',
    )
    return replace(row, **changes)
