"""What `render` shows of an episode under way: a picture of it so far."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from . import view as look
from .caption import Caption, add_caption, belief_text, length_text
from .episode import Episode
from .episode_picture import episode_so_far
from .picture_scene import PictureScene
from .renderer import Renderer
from .window import Window

__all__ = ["EpisodeView"]

SIZE = 800, 600
LETTERS = 1.3
"""Scale of the captions: letters must be legible in a small picture."""
ROOM = 1.12
"""How many times farther away the camera is than it must be, for rays to be seen."""


class EpisodeView:
    """Draws an environment's episodes, for as long as it lives, always from the same place."""

    def __init__(self, mode: str) -> None:
        """Prepare to draw; nothing starts and no window opens yet.

        Args:
            mode: "rgb_array" or "human".

        Raises:
            gymnasium.error.DependencyNotInstalled: "human" where no window can open.
        """
        self._window = Window("palpate") if mode == "human" else None
        self._renderer = Renderer()
        self._stage: look.Stage | None = None

    def picture(self, episode: Episode) -> NDArray[np.uint8]:
        """The episode so far, (600, 800, 3)."""
        scene = episode_so_far(episode)
        corners = scene.object_vertices_world
        fresh = not episode.touches  # an episode begins: its object lies elsewhere
        if self._stage is None or fresh or not self._stage.holds(corners, SIZE):
            self._stage = look.Stage.of(scene, SIZE, ROOM)
        picture = self._renderer.draw(scene, self._stage, SIZE)
        return np.array(add_caption(picture, _caption(episode, scene, self._stage)))

    def show(self, episode: Episode) -> None:
        """Show the picture in the window, if there is one."""
        if self._window is not None:
            self._window.show(self.picture(episode))

    def close(self) -> None:
        """End the renderer and close the window; both may have been already."""
        self._renderer.close()
        if self._window is not None:
            self._window.close()


def _caption(episode: Episode, scene: PictureScene, stage: look.Stage) -> Caption:
    number = len(episode.touches)
    title = f"Probe {number}" if number else f"An unknown object, one of {len(episode.library)}"
    rivals = [(colour, f"maybe {name}") for name, colour in look.ghost_colours(scene).items()]
    fixed = [(look.OBJECT, "the true object"), (look.CONTACT, "contact, felt normal")]
    fixed += [(look.RAY_HIT, "touched"), (look.RAY_MISSED, "touched nothing")]
    fixed.append((look.GRID, f"grid {length_text(stage.step)}"))
    return Caption(title, belief_text(episode.belief), (tuple(rivals), tuple(fixed)), LETTERS)
