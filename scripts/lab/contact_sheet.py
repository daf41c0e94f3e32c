"""Draw the library: every stand-in, on one plane that is ruled to tell how large they are.

    python -m palpate.scripts.lab.contact_sheet [FILE]

The default FILE is docs/library.png in the working directory, which is the repository's root.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import ImageDraw
from PIL.Image import Image
from scipy.spatial.transform import RigidTransform, Rotation

from ...assets.stand_ins import METRES_PER_INCH, STAND_INS
from ...envs.library import load_library
from ...envs.pictures.caption import INK, Caption, add_caption, length_text, letters
from ...envs.pictures.episode_picture import bare_scene
from ...envs.pictures.renderer import Renderer
from ...envs.pictures.view import GRID, Stage, frame, grid
from ...recognizer import Contacts, Polyhedron

SIZE = 1600, 1000
LYING = [[0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]]
"""Of a hand, model to world: it lies with its fingers along x."""
TURN = Rotation.from_euler("z", 20.0, degrees=True)
"""Of what is long, so that its length is seen."""
PLACES = {
    "housing": (-0.18, -0.12, Rotation.identity()),
    "housing-34": (-0.03, -0.12, Rotation.identity()),
    "stapler": (0.16, -0.12, TURN),
    "simple-hand": (-0.12, 0.14, TURN * Rotation.from_matrix(LYING)),
    "complex-hand": (0.13, 0.17, TURN * Rotation.from_matrix(LYING)),
}
"""Of each, how far right and how far back its middle is, metres, and how it is turned."""


def contact_sheet(size: tuple[int, int]) -> Image:
    """The picture, of ``size`` (width, height) pixels."""
    models = load_library(None)
    each = [bare_scene(model, _pose(model), Contacts.none()) for model in models]
    starts = np.cumsum([0, *(len(model.vertices) for model in models[:-1])])
    triangles = [model.triangles + start for model, start in zip(models, starts, strict=True)]
    scene = replace(
        each[0],
        object_vertices_world=np.concatenate([one.object_vertices_world for one in each]),
        object_triangles=np.concatenate(triangles),
        object_edges_world=np.concatenate([one.object_edges_world for one in each]),
    )
    view = frame(scene, size)
    view = replace(view, radius=view.radius / 3)  # lines as thin as if one object were shown
    stage = Stage(view, *grid(scene, view))
    with Renderer() as renderer:
        pixels = renderer.draw(scene, stage, size)
    legend = (((GRID, f"grid {length_text(stage.step)}"),),)
    image = add_caption(pixels, Caption("The library", "stand-ins for the memo's objects", legend))
    for stand_in, one in zip(STAND_INS, each, strict=True):
        x, y, _ = stage.view.project(one.object_vertices_world, size).T
        inches = stand_in.diameter_in
        size_told = f"diameter {inches:g} in ({length_text(inches * METRES_PER_INCH)})"
        text = f"{stand_in.faces} faces, {size_told}"
        centre, below, unit = (x.min() + x.max()) / 2, y.max(), size[1] / 960
        canvas = ImageDraw.Draw(image)
        canvas.text((centre, below + 8 * unit), stand_in.name, INK, letters(20 * unit, True), "ma")
        canvas.text((centre, below + 34 * unit), text, INK, letters(16 * unit), "ma")
    return image


def _pose(model: Polyhedron) -> RigidTransform:
    """Where it stands, model to world."""
    right, back, turn = PLACES[model.name]
    corners = model.vertices @ turn.as_matrix().T
    low, high = corners.min(axis=0), corners.max(axis=0)
    # Where nothing was felt that it could face, the camera heads towards 135 degrees.
    place = [(right - back) / np.sqrt(2), (right + back) / np.sqrt(2), 0.0]
    middle = [*(low + high)[:2] / 2, low[2]]
    return RigidTransform.from_components(np.subtract(place, middle), turn)


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line. Returns the exit status."""
    parser = argparse.ArgumentParser(prog="python -m palpate.scripts.lab.contact_sheet")
    parser.add_argument("file", nargs="?", type=Path, default=Path("docs/library.png"))
    picture = contact_sheet(SIZE).quantize(256)  # a third of the bytes, and no difference to see
    picture.save(parser.parse_args(arguments).file, optimize=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
