"""Title, subtitle and legend, written onto a picture that a renderer drew."""

from __future__ import annotations

from pathlib import Path

import matplotlib
from PIL import Image as ImageLib
from PIL import ImageDraw, ImageFont
from PIL.Image import Image

from .picture import PictureScene
from .picture_view import (
    CONTACT,
    GRID,
    OBJECT,
    RAY_HIT,
    RAY_MISSED,
    Colour,
    frame,
    ghost_colours,
    grid,
)

__all__ = ["add_caption"]

INK = (30, 42, 51)
PALE_INK = (92, 102, 110)
MOST_LABELS = 5


def add_caption(image: Image, scene: PictureScene) -> Image:
    """A copy of ``image`` with the scene's title, subtitle and legend."""
    unit = image.height / 960  # sizes below are for 960 pixels of height
    margin = 36 * unit
    room = image.width - 2 * margin
    font = _font(17 * unit)
    _, step = grid(scene, frame(scene, image.size))
    rows = _rows(_legend(scene, step), font, room, unit)

    image = _with_bands(image, 106 * unit, (24 + 30 * len(rows)) * unit)
    canvas = ImageDraw.Draw(image)
    canvas.text((margin, 26 * unit), scene.title, INK, _fitting(scene.title, 30 * unit, room, True))
    subtitle = _fitting(scene.subtitle, 20 * unit, room)
    canvas.text((margin, 66 * unit), scene.subtitle, PALE_INK, subtitle)

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


def _legend(scene: PictureScene, step: float) -> list[tuple[Colour, str]]:
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
    return [*entries, (GRID, f"grid {_length(step)}")]


def _rows(
    entries: list[tuple[Colour, str]], font: ImageFont.FreeTypeFont, room: float, unit: float
) -> list[list[tuple[Colour, str]]]:
    """The entries in as many rows as they need."""
    rows: list[list[tuple[Colour, str]]] = [[]]
    used = 0.0
    for colour, text in entries:
        width = 58 * unit + font.getlength(text)
        if rows[-1] and used + width > room:
            rows.append([])
            used = 0.0
        rows[-1].append((colour, text))
        used += width
    return rows


def _length(metres: float) -> str:
    for unit, name in ((1.0, "m"), (1e-2, "cm"), (1e-3, "mm")):
        if metres > 0.999 * unit:
            return f"{metres / unit:.3g} {name}"
    return f"{metres:.3g} m"


def _fitting(text: str, size: float, room: float, bold: bool = False) -> ImageFont.FreeTypeFont:
    """The font, made smaller where the text would not fit."""
    font = _font(size, bold)
    length = font.getlength(text)
    return font if length <= room else _font(size * room / length, bold)


def _font(size: float, bold: bool = False) -> ImageFont.FreeTypeFont:
    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    path = Path(matplotlib.get_data_path(), "fonts", "ttf", name)
    return ImageFont.truetype(str(path), max(size, 5))
