"""The film of an episode, as a file."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .caption import add_caption
from .film_script import FRAME_RATE, EpisodeRecord, FilmScript
from .renderer import Renderer
from .video import Video, check_video_path

__all__ = ["Film", "film_episode"]

SLOW_EVERY = 5
"""For how many frames a picture is shown where pictures are slow to draw."""


@dataclass(frozen=True)
class Film:
    """A film that has been made."""

    renderer: str
    """Who painted it: "MuJoCo" or "NumPy"."""
    seconds: float
    """How long it is."""


def film_episode(
    record: EpisodeRecord,
    path: Path,
    size: tuple[int, int] = (960, 720),
    progress: Callable[[int, int], None] | None = None,
) -> Film:
    """Make a film of an episode, an MP4 of ``size`` (width, height) pixels.

    Args:
        record: the episode.
        path: where to; the file appears whole or not at all.
        size: of the pictures, even numbers.
        progress: told after each picture how many are drawn, and of how many.

    Raises:
        ValueError: a path that can't be written, or an odd size.
    """
    check_video_path(path)
    with Renderer() as renderer, Video(path, size, FRAME_RATE) as video:
        script = FilmScript(record, size)
        renderer.draw(next(script.shots()).scene, script.stage, size)  # to see who paints
        if renderer.name != "MuJoCo":
            script = FilmScript(record, size, SLOW_EVERY)
        shots = list(script.shots())
        for number, shot in enumerate(shots, 1):
            picture = renderer.draw(shot.scene, script.stage, size)
            video.add(np.asarray(add_caption(picture, shot.caption)), shot.frames)
            if progress is not None:
                progress(number, len(shots))
        return Film(renderer.name, sum(shot.frames for shot in shots) / FRAME_RATE)
