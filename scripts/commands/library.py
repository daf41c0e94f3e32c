"""`palpate library`: is a folder of meshes fit to be recognised, and what in it looks alike?"""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .own_parts import DIGITS, UNITS, USUAL_ERROR, metres

if TYPE_CHECKING:
    from rich.console import Console

    from ...recognizer import Polyhedron

__all__ = ["library"]

HARD = 0.25
"""Share of draws that fit another part, too, from which the two are told as near-twins."""
SAME = 1e-3
"""Share of the diameter within which two parts' surfaces are one."""
GUESSES = (("m", 0.9), ("in", 12.0))
"""A diameter below the number is probably in that unit; above all, in millimetres."""


def library(
    folder: Annotated[
        Path, typer.Argument(metavar="FOLDER", help="A folder of meshes (OBJ, OFF, PLY or STL).")
    ],
    units: Annotated[str, typer.Option(metavar="mm|cm|m|in", help="Of the meshes.")] = "mm",
    position_error: Annotated[
        float | None,
        typer.Option(
            metavar="E",
            help="How far off touches will be, in those units. [dim]default: 0.1 mm[/]",
            show_default=False,
        ),
    ] = None,
    normal_error_deg: Annotated[
        float, typer.Option(metavar="A", help="How far off normals will be, degrees.")
    ] = 15.0,
    no_twins: Annotated[
        bool, typer.Option("--no-twins", help="Don't look for parts that look alike.")
    ] = False,
) -> None:
    """Check a folder of parts: faces, size, symmetry, faults, and which parts look alike.

    Touches are drawn on each part, and the parts that they fit as well are its near-twins; of each
    pair is told where the two differ most, which is where to touch.
    """
    from rich.console import Console
    from rich.table import Table

    from ...recognizer.models.folder import mesh_files

    scale, files = metres(units), mesh_files(folder)
    console = Console(highlight=False, soft_wrap=True)
    console.width = max(console.width, 100)
    table = Table("part", "faces", f"size ({units})", "symmetries", "remarks", box=None)
    models = []
    for file in files:
        model, remarks = _read(file, scale)
        if model is None:
            table.add_row(file.name, "", "", "", f"[bold]unusable[/]: {remarks}")
            continue
        models.append(model)
        size = model.diameter / scale
        guess = next((unit for unit, below in GUESSES if size < below), "mm")
        if guess != units:
            remarks = f"{remarks}; is it in {guess}?".removeprefix("; ")
        digits = DIGITS[units]
        count = str(len(model.symmetries))
        table.add_row(file.name, str(model.face_count), f"{size:.{digits}g}", count, remarks)
    console.print(table)
    if len(models) > 1 and not no_twins:
        bound = USUAL_ERROR if position_error is None else position_error * scale
        _tell_twins(console, models, units, bound, normal_error_deg)


def _read(file: Path, scale: float) -> tuple[Polyhedron | None, str]:
    """A model and what was noticed about its mesh; no model where there can be none, and why."""
    from ...recognizer import Polyhedron

    with warnings.catch_warnings(record=True) as noticed:
        warnings.simplefilter("always")
        try:
            model = Polyhedron.from_mesh(file, scale=scale)
        except ValueError as error:
            return None, str(error).removeprefix(f"{file}: ")
    return model, "; ".join(str(one.message).removeprefix(f"{file.stem}: ") for one in noticed)


def _tell_twins(
    console: Console, models: list[Polyhedron], units: str, bound: float, normal_error_deg: float
) -> None:
    import numpy as np
    from rich.progress import Progress

    from ...recognizer import Recognizer
    from ...recognizer.advice.twins import TOUCHES, near_twins
    from ...recognizer.tables.table_cache import default_folder

    recognizer = Recognizer(models, cache=default_folder())
    found = []
    with Progress(console=_on_stderr(), transient=True) as progress:
        task = progress.add_task("touching each part", total=len(models))
        for twins in near_twins(
            recognizer,
            np.random.default_rng(0),
            position_error=bound,
            normal_error=float(np.radians(normal_error_deg)),
        ):
            found += [one for one in twins if one.share >= HARD]
            progress.advance(task)
    if not found:
        console.print(f"\nNo two parts look alike to {TOUCHES} touches anywhere.")
        return
    console.print(f"\nLook alike to {TOUCHES} touches anywhere:")
    sizes = {model.name: model.diameter for model in models}
    for one in sorted(found, key=lambda twins: -twins.share):
        if one.apart < SAME * sizes[one.part]:
            if one.part < one.other:
                console.print(f"  {one.part} and {one.other} are the same part")
            continue
        place = " ".join(f"{value / UNITS[units]:.{DIGITS[units]}g}" for value in one.place)
        normal = " ".join(f"{-value:z.2f}" for value in one.normal)
        console.print(
            f"  {one.part} is taken for {one.other} in {one.share:.0%} of draws; they differ by"
            f" {one.apart / UNITS[units]:.3g} {units} where {one.part} has ({place}):"
            f" touch there along ({normal})"
        )


def _on_stderr() -> Console:
    """A console for progress, which is no part of the answer."""
    from rich.console import Console

    return Console(stderr=True)
