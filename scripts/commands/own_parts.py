"""Your own contacts, your own parts: the options and the input that commands about them share."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

if TYPE_CHECKING:
    from ...recognizer import FeltFile, Polyhedron, SupportPlane

UNITS = {"mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 0.0254}
DIGITS = {"mm": 3, "cm": 4, "m": 6, "in": 4}
"""Of lengths, after the point: micrometres."""
USUAL_ERROR = 1e-4
"""Bound on positions where none is given, metres: a tenth of a millimetre."""
WIDTH = 110
"""Columns of text that a table takes; a narrower terminal wraps it."""

CONTACTS_NAME = "CONTACTS.csv"
CONTACTS_HELP = (
    "A line for each touch, under a header: x,y,z and, where known, nx,ny,nz (the outward normal),"
    " position_error, normal_error (radians), sx,sy,sz (where the probe came from), kind (face,"
    " edge, vertex). A line with sx,sy,sz and ex,ey,ez alone is a way on which nothing was touched."
)

ContactsFile = Annotated[Path, typer.Argument(metavar=CONTACTS_NAME, help=CONTACTS_HELP)]
Library = Annotated[
    Path, typer.Option(metavar="FOLDER", help="A folder of closed meshes (OBJ, OFF, PLY or STL).")
]
Units = Annotated[
    str, typer.Option(metavar="mm|cm|m|in", help="Of the meshes, the contacts and the options.")
]
PositionError = Annotated[
    float | None,
    typer.Option(
        metavar="E",
        help="Each point is within this of the truth, in those units."
        " [dim]default: 0.1 mm, or what the file says[/]",
        show_default=False,
    ),
]
NormalErrorDeg = Annotated[
    float, typer.Option(metavar="A", help="Each normal is within this of the truth, degrees.")
]
PlaneHeight = Annotated[
    float | None,
    typer.Option(metavar="Z", help="The part doesn't reach below this height.", show_default=False),
]
Resting = Annotated[
    bool, typer.Option("--resting", help="It stands on that plane (--plane, or 0).")
]
Outliers = Annotated[
    int, typer.Option(metavar="K", min=0, help="Up to so many touches were of something else.")
]
Edges = Annotated[
    bool, typer.Option("--edges", help="Touches may be on edges and corners, as a ball tip's are.")
]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON document instead.")]


@dataclass(frozen=True, eq=False)
class Given:
    """What the shared options and files come to, in metres."""

    felt: FeltFile | None
    """The touches; None without a file."""
    models: tuple[Polyhedron, ...]
    features: Literal["faces", "all"]
    support: SupportPlane | None


def read_given(
    contacts: Path | None,
    library: Path,
    *,
    units: str,
    position_error: float | None,
    normal_error_deg: float,
    plane: float | None,
    resting: bool,
    edges: bool,
) -> Given:
    """Read the files that a command was given, and turn its options into what the library takes.

    Raises:
        ValueError: a file that can't be read, units that aren't known.
    """
    from math import radians

    from ...recognizer import SupportPlane, load_folder, read_contacts

    scale = metres(units)
    bound = USUAL_ERROR if position_error is None else position_error * scale
    if not bound > 0.0:
        raise ValueError(f"--position-error is {position_error:g}; it must be above zero")
    if not 0.0 < normal_error_deg <= 180.0:
        raise ValueError(
            f"--normal-error-deg is {normal_error_deg:g}; it must be above 0 and at most 180"
        )
    felt = None
    if contacts is not None:
        felt = read_contacts(
            contacts, position_error=bound, normal_error=radians(normal_error_deg), scale=scale
        )
    support = None
    if plane is not None or resting:
        height = 0.0 if plane is None else plane * scale
        support = SupportPlane(height=height, error=bound, resting=resting)
    sharp = felt is not None and bool((felt.contacts.kinds > 1).any())
    models = load_folder(library, scale=scale)
    if contacts is not None and felt is not None:
        _warn_of_missing_normals(contacts, felt)
    return Given(felt, models, "all" if edges or sharp else "faces", support)


def _warn_of_missing_normals(path: Path, felt: FeltFile) -> None:
    from math import pi

    if len(felt.contacts) and (felt.contacts.normal_error >= pi).all():
        warnings.warn(
            f"{path}: no normals in it (nx,ny,nz), so this takes more touches, and minutes if there"
            " are many parts; even rough ones help a lot, with --normal-error-deg 45",
            UserWarning,
            stacklevel=3,
        )


def metres(units: str) -> float:
    """A unit of length in metres.

    Raises:
        ValueError: it isn't known.
    """
    if units not in UNITS:
        raise ValueError(f"units is {units!r}; it must be one of {', '.join(UNITS)}")
    return UNITS[units]
