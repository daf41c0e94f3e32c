"""A file of touches that grows: recognised again whenever it has changed."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from math import radians
from pathlib import Path
from time import sleep
from typing import Literal

from ...recognizer import Contacts, FeltFile, FreeSpace, Recognizer, read_contacts
from ...recognizer.tables.table_cache import default_folder
from ..page.story import Story
from ..page.story_contacts import Beliefs, contacts_story
from .own_parts import USUAL_ERROR, metres, read_given

__all__ = ["Watched", "watched_stories"]

LOOK_EVERY = 0.3
"""Seconds between two looks at the file."""


@dataclass(frozen=True, kw_only=True)
class Watched:
    """A file of touches, and what is known beside it; as the options of the same names say."""

    path: Path
    library: Path
    units: str = "mm"
    position_error: float | None = None
    normal_error_deg: float = 15.0
    plane: float | None = None
    resting: bool = False
    outliers: int = 0
    edges: bool = False


def watched_stories(
    watched: Watched, notice: Callable[[str], object], wait: Callable[[float], object] = sleep
) -> Iterator[Story]:
    """What the file tells, at first and each time that it has changed. It never ends.

    A file that isn't there yet, or is empty, says that nothing was touched yet.

    Args:
        watched: the file, and the library.
        notice: told in a line why a file can't be read; what it said before then stands.
        wait: called between two looks, with seconds.

    Raises:
        ValueError: a library that can't be read, an option that won't do.
    """
    given = read_given(
        None,
        watched.library,
        units=watched.units,
        position_error=watched.position_error,
        normal_error_deg=watched.normal_error_deg,
        plane=watched.plane,
        resting=watched.resting,
        edges=watched.edges,
    )

    @cache
    def recognizer_of(features: Literal["faces", "all"]) -> Recognizer:
        return Recognizer(given.models, features=features, cache=default_folder())

    beliefs, seen = None, object()
    while True:
        print_of_file = _fingerprint(watched.path)
        if print_of_file == seen:
            wait(LOOK_EVERY)
            continue
        seen = print_of_file
        try:
            felt = _read(watched)
        except ValueError as wrong:
            notice(f"{wrong}; waiting for another version")
            if beliefs is not None:
                continue
            felt = _nothing()
        sharp = given.features == "all" or bool((felt.contacts.kinds > 1).any())
        recognizer = recognizer_of("all" if sharp else "faces")
        belief = None
        if len(felt.contacts):
            belief = recognizer.recognize(
                felt.contacts,
                outliers=watched.outliers,
                free_space=felt.free_space,
                support=given.support,
            )
        beliefs = Beliefs.of(felt, belief, recognizer, beliefs)
        unit = (watched.units, metres(watched.units))
        yield contacts_story(watched.path.name, recognizer, beliefs, unit, ended=False)


def _fingerprint(path: Path) -> tuple[int, int] | None:
    """What changes when the file does; None while it isn't there."""
    try:
        state = path.stat()
    except OSError:
        return None
    return state.st_mtime_ns, state.st_size


def _read(watched: Watched) -> FeltFile:
    """The touches so far."""
    path, scale = watched.path, metres(watched.units)
    try:
        begun = len(path.read_text(encoding="utf-8-sig").split("\n", 1)[-1].strip()) > 0
    except (OSError, UnicodeDecodeError):
        begun = path.exists()
    if not begun:
        return _nothing()
    bound = USUAL_ERROR if watched.position_error is None else watched.position_error * scale
    return read_contacts(
        path,
        position_error=bound,
        normal_error=radians(watched.normal_error_deg),
        scale=scale,
    )


def _nothing() -> FeltFile:
    return FeltFile(Contacts.none(), FreeSpace.none(), (), 0)
