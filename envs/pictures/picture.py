"""A picture of an episode, as a file."""

from __future__ import annotations

import os
from pathlib import Path

from PIL.Image import Image

from .caption import add_caption, caption_of
from .picture_scene import PictureScene
from .renderer import Renderer
from .view import Stage

__all__ = ["check_path", "draw", "renderer_note"]


def draw(scene: PictureScene, path: str | Path, size: tuple[int, int] = (1280, 960)) -> str:
    """Draw ``scene`` as a PNG of ``size`` (width, height) pixels.

    The file appears whole or not at all. ``MUJOCO_GL`` is respected where it is set.

    Returns:
        Who drew it: ``"MuJoCo"`` or ``"NumPy"``.

    Raises:
        ValueError: ``path`` does not end in ``.png``, or its folder does not exist.
    """
    path = Path(path)
    check_path(path)
    stage = Stage.of(scene, size)
    with Renderer() as renderer:
        image = renderer.draw(scene, stage, size)
        _save_whole(add_caption(image, caption_of(scene, stage)), path)
        return renderer.name


def check_path(path: Path) -> None:
    """Raise ValueError if no picture can be written to ``path``."""
    if path.suffix.lower() != ".png":
        raise ValueError(f"a picture is a PNG: {str(path)!r} should end in .png")
    if not path.parent.is_dir():
        raise ValueError(f"the picture {str(path)!r} cannot be written: its folder does not exist")


def renderer_note(renderer: str, what: str = "picture") -> str:
    """What a command should tell about `draw`'s answer; empty where there is nothing to tell."""
    if renderer == "MuJoCo":
        return ""
    return f"no GL library was found that works: the {what} was drawn by {renderer}"


def _save_whole(image: Image, path: Path) -> None:
    """Write under a temporary name beside ``path`` and rename, so that no half picture is left."""
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        image.save(part, format="PNG")
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)
