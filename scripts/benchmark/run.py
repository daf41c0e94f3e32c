"""A benchmark that is played: what its folder lacks of its episodes."""

from __future__ import annotations

from pathlib import Path

from rich.console import Console

from ...policies import make_policy
from ..progress_bar import under_a_bar
from .config import BenchmarkConfig
from .playing import task_of
from .settings import settle
from .store import RowStore, only_writer
from .workers import Play, environment, play_all

__all__ = ["check", "run_benchmark"]


def check(config: BenchmarkConfig) -> None:
    """Refuse what would only fail once it is played.

    Raises:
        ValueError: objects, bounds, a sensor, a placement or a strategy that won't do.
    """
    settings = config.settings
    for setting in settings:
        if setting.noise == settings[0].noise or setting.objects == settings[0].objects:
            environment(setting)
    task = task_of(environment(settings[0]), settings[0].goal)
    for name in config.policies:
        make_policy(name, task)


def run_benchmark(
    config: BenchmarkConfig,
    folder: Path,
    play: Play,
    *,
    workers: int = 1,
    backend: str = "joblib",
    console: Console | None = None,
) -> None:
    """Play what a folder lacks of a benchmark's episodes.

    Args:
        config: the benchmark.
        folder: where its rows are, or will be.
        play: what plays an episode.
        workers: how many at a time.
        backend: see `workers`.
        console: where to draw a progress bar; none, and nothing is drawn.

    Raises:
        ValueError: the folder holds another benchmark, or another process writes to it; a package
            is missing.
    """
    store = RowStore(folder)
    with only_writer(folder):
        settle(config, folder)
        store.clear_leftovers()
        done = {row.number for row in store.rows()}
        missing = [job for job in config.jobs() if job.number not in done]
        rows = play_all(play, missing, workers=workers, backend=backend)
        for row in under_a_bar(rows, len(config), "episodes", console, done=len(done)):
            store.add(row)
        store.gather()
