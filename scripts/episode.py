"""`palpate episode`: one probing episode in simulation, told probe by probe, with a picture."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

__all__ = ["episode"]


def episode(
    object_name: Annotated[
        str | None,
        typer.Option(
            "--object",
            metavar="NAME",
            help="The object to touch, from the library. [dim]default: drawn by the seed[/]",
            show_default=False,
        ),
    ] = None,
    library: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER",
            help="A folder of closed meshes (OBJ or STL, metres) to tell apart. "
            "[dim]default: the library that comes with palpate[/]",
            show_default=False,
        ),
    ] = None,
    policy: Annotated[
        str, typer.Option(metavar="NAME", help="The strategy that chooses the probes.")
    ] = "random",
    seed: Annotated[
        int, typer.Option(metavar="N", min=0, help="Same seed, same episode, to the bit.")
    ] = 0,
    picture: Annotated[
        Path,
        typer.Option(metavar="FILE", help="Where to draw the end of the episode, as a PNG."),
    ] = Path("episode.png"),
    no_picture: Annotated[bool, typer.Option("--no-picture", help="Draw nothing.")] = False,
    position_error: Annotated[
        float,
        typer.Option(
            metavar="M",
            min=0.0,
            help="A contact is felt within this distance of the truth, metres.",
        ),
    ] = 0.000254,
    normal_error_deg: Annotated[
        float,
        typer.Option(
            metavar="A",
            min=0.0,
            max=90.0,
            help="A normal is felt within this angle of the truth, degrees.",
        ),
    ] = 18.0,
    max_probes: Annotated[
        int, typer.Option(metavar="N", min=1, help="Give up after this many probes.")
    ] = 40,
    json: Annotated[
        bool, typer.Option("--json", help="Print one JSON document instead of the story.")
    ] = False,
) -> None:
    """Touch an object in simulation until palpate knows which one it is and where it lies.

    Prints what could still be true after each probe, and draws the end as a picture.
    """
    raise NotImplementedError
