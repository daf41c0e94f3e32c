"""What shows an episode, by render mode."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .episode_view import EpisodeView


def view_in(mode: str | None, known: Sequence[str]) -> EpisodeView | None:
    """What shows episodes in a render mode; None if nothing is to.

    Raises:
        ValueError: no known mode.
        gymnasium.error.DependencyNotInstalled: "human" where no window can open.
    """
    if mode is None:
        return None
    if mode not in known:
        raise ValueError(f"render_mode is {mode!r}; it must be one of {(None, *known)}")
    from .episode_view import EpisodeView  # matplotlib comes with it

    return EpisodeView(mode)
