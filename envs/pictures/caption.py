"""Title, subtitle and legend, written onto a picture that a renderer drew."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib
import numpy as np
from numpy.typing import NDArray
from PIL import Image as ImageLib
from PIL import ImageDraw, ImageFont
from PIL.Image import Image

from .picture_scene import PictureScene
from .view import CONTACT, GRID, OBJECT, RAY_HIT, RAY_MISSED, Colour, Stage, ghost_colours

if TYPE_CHECKING:
    from ...recognizer import Belief

__all__ = ["Caption", "add_caption", "belief_text", "caption_of", "length_text", "letters"]

Entry = tuple[Colour, str]

INK = (30, 42, 51)
PALE_INK = (92, 102, 110)
MOST_LABELS = 5


@dataclass(frozen=True)
class Caption:
    """What is written onto a picture.

    Attributes:
        title: one line, large.
        subtitle: one line below it.
        legend: colour and text of each entry, a tuple a row; a row that is too long goes on below.
        scale: of all letters, 1 for a picture of 960 lines that is looked at closely.
    """

    title: str
    subtitle: str
    legend: tuple[tuple[Entry, ...], ...]
    scale: float = 1.0


def caption_of(scene: PictureScene, stage: Stage) -> Caption:
    """The caption of a scene that is looked at by itself."""
    return Caption(scene.title, scene.subtitle, (tuple(_legend(scene, stage.step)),))


def add_caption(picture: NDArray[np.uint8], caption: Caption) -> Image:
    """A picture, ``(h, w, 3)``, with its caption."""
    image = ImageLib.fromarray(picture)
    unit = caption.scale * image.height / 960  # sizes below are for 960 pixels of height
    margin = 36 * unit
    room = image.width - 2 * margin
    font = letters(17 * unit)
    rows = [row for entries in caption.legend for row in _rows(entries, font, room, unit)]

    image = _with_bands(image, 106 * unit, (24 + 30 * len(rows)) * unit)
    canvas = ImageDraw.Draw(image)
    title = _fitting(caption.title, 30 * unit, room, True)
    canvas.text((margin, 26 * unit), caption.title, INK, title)
    subtitle = _fitting(caption.subtitle, 20 * unit, room)
    canvas.text((margin, 66 * unit), caption.subtitle, PALE_INK, subtitle)

    y = image.height - (27 + 30 * (len(rows) - 1)) * unit
    for row in rows:
        x = margin
        for colour, text in row:
            box = (x, y - 7 * unit, x + 22 * unit, y + 7 * unit)
            canvas.rounded_rectangle(box, 4 * unit, tuple(round(255 * c) for c in colour))
            canvas.text((x + 30 * unit, y), text, INK, font, anchor="lm")
            x += 58 * unit + font.getlength(text)
        y += 30 * unit
    return image


def _with_bands(image: Image, top: float, bottom: float) -> Image:
    """A copy with paler bands at top and bottom, on which text is easy to read."""
    veil = ImageLib.new("L", image.size, 0)
    shade = ImageDraw.Draw(veil)
    shade.rectangle((0, 0, image.width, top), fill=200)
    shade.rectangle((0, image.height - bottom, image.width, image.height), fill=200)
    return ImageLib.composite(ImageLib.new("RGB", image.size, "white"), image.convert("RGB"), veil)


def _legend(scene: PictureScene, step: float) -> list[Entry]:
    """Colour and text of each entry; only what is in the scene."""
    entries = [(OBJECT, "the object as it lies")]
    if len(scene.contacts_world):
        entries.append((CONTACT, "contact and felt normal"))
    if scene.ray_hits.any():
        entries.append((RAY_HIT, "finger touched"))
    if not scene.ray_hits.all():
        entries.append((RAY_MISSED, "finger touched nothing"))
    ghosts = [(colour, label) for label, colour in ghost_colours(scene).items()]
    entries += ghosts[:MOST_LABELS]
    if len(ghosts) > MOST_LABELS:
        entries.append((GRID, f"and {len(ghosts) - MOST_LABELS} more"))
    return [*entries, (GRID, f"grid {length_text(step)}")]


def belief_text(belief: Belief | None) -> str:
    """What is left, in one line."""
    if belief is None:
        return "Nothing touched yet"
    left = len(belief.hypotheses)
    if not left:
        return "No hypothesis left: not in the library"
    if left == 1:
        only = belief.hypotheses[0]
        return f"1 hypothesis left: {only.object_name}" + (
            "" if only.determined else ", its pose still open"
        )
    counts = Counter(hypothesis.object_name for hypothesis in belief.hypotheses)
    named = [f"{name} {count}" for name, count in counts.most_common(4)]
    return f"{left} hypotheses left: {', '.join(named + ['…'] * (len(counts) > 4))}"


def _rows(
    entries: tuple[Entry, ...], font: ImageFont.FreeTypeFont, room: float, unit: float
) -> list[list[Entry]]:
    """The entries in as many rows as they need."""
    rows: list[list[Entry]] = [[]]
    used = 0.0
    for colour, text in entries:
        width = 58 * unit + font.getlength(text)
        if rows[-1] and used + width > room:
            rows.append([])
            used = 0.0
        rows[-1].append((colour, text))
        used += width
    return rows


def length_text(metres: float) -> str:
    """A length in the unit that suits it."""
    for unit, name in ((1.0, "m"), (1e-2, "cm"), (1e-3, "mm")):
        if metres > 0.999 * unit:
            return f"{metres / unit:.3g} {name}"
    return f"{metres:.3g} m"


def _fitting(text: str, size: float, room: float, bold: bool = False) -> ImageFont.FreeTypeFont:
    """The font, made smaller where the text would not fit."""
    font = letters(size, bold)
    length = font.getlength(text)
    return font if length <= room else letters(size * room / length, bold)


@cache
def letters(size: float, bold: bool = False) -> ImageFont.FreeTypeFont:
    """The font of everything that is written, ``size`` pixels high."""
    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    path = Path(matplotlib.get_data_path(), "fonts", "ttf", name)
    return ImageFont.truetype(str(path), max(size, 5))
