"""The picture of the library."""

from __future__ import annotations

import numpy as np
from PIL import Image

from palpate.envs.pictures.view import EDGE, OBJECT
from palpate.scripts.lab import contact_sheet


def test_the_library_is_drawn_as_a_picture(tmp_path, monkeypatch):
    monkeypatch.setattr(contact_sheet, "SIZE", (400, 250))
    assert contact_sheet.main([str(tmp_path / "library.png")]) == 0
    with Image.open(tmp_path / "library.png") as image:
        pixels = np.asarray(image.convert("RGB")) / 255
    assert pixels.shape == (250, 400, 3)
    for colour in (OBJECT, EDGE):
        assert (np.abs(pixels - colour).max(axis=-1) < 0.2).mean() > 0.01
