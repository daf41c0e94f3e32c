"""`palpate recognize`: your contacts, your parts: which part is it, and where does it lie?"""

from __future__ import annotations

import json as json_format
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

    from ..recognizer import Belief, FeltFile, Hypothesis, Recognizer

__all__ = ["recognize"]

UNITS = {"mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 0.0254}
USUAL_ERROR = 1e-4
"""Bound on positions where none is given, metres: a tenth of a millimetre."""
SHOWN = 10
"""Hypotheses in the table."""
WIDTH = 110
"""Columns of text that the table takes; a narrower terminal wraps it."""
DIGITS = {"mm": 3, "cm": 4, "m": 6, "in": 4}


def recognize(
    contacts: Annotated[
        Path,
        typer.Argument(
            metavar="CONTACTS.csv",
            help="A line for each touch, under a header: x,y,z and, where known, nx,ny,nz (the"
            " outward normal), position_error, normal_error (radians), sx,sy,sz (where the probe"
            " came from), kind (face, edge, vertex). A line with sx,sy,sz and ex,ey,ez alone is a"
            " way on which nothing was touched.",
        ),
    ],
    library: Annotated[
        Path,
        typer.Option(metavar="FOLDER", help="A folder of closed meshes (OBJ, OFF, PLY or STL)."),
    ],
    units: Annotated[
        str, typer.Option(metavar="mm|cm|m|in", help="Of the meshes, the contacts and the options.")
    ] = "mm",
    position_error: Annotated[
        float | None,
        typer.Option(
            metavar="E",
            help="Each point is within this of the truth, in those units."
            " [dim]default: 0.1 mm, or what the file says[/]",
            show_default=False,
        ),
    ] = None,
    normal_error_deg: Annotated[
        float,
        typer.Option(metavar="A", help="Each normal is within this of the truth, degrees."),
    ] = 15.0,
    plane: Annotated[
        float | None,
        typer.Option(
            metavar="Z",
            help="The part doesn't reach below this height.",
            show_default=False,
        ),
    ] = None,
    resting: Annotated[
        bool, typer.Option("--resting", help="It stands on that plane (--plane, or 0).")
    ] = False,
    outliers: Annotated[
        int, typer.Option(metavar="K", min=0, help="Up to so many touches were of something else.")
    ] = 0,
    edges: Annotated[
        bool,
        typer.Option("--edges", help="Touches may be on edges and corners, as a ball tip's are."),
    ] = False,
    json: Annotated[bool, typer.Option("--json", help="Print one JSON document instead.")] = False,
) -> None:
    """Say which part of a library was touched, and where it lies.

    Prints every part and pose that the contacts allow, and whether that is unique, ambiguous, still
    undetermined, or not in this library. Poses take the part's own coordinates to those of the
    contacts.
    """
    import numpy as np
    from rich.console import Console

    from ..recognizer import Recognizer, SupportPlane, load_folder, read_contacts
    from ..recognizer.table_cache import default_folder

    scale = metres(units)
    bound = USUAL_ERROR if position_error is None else position_error * scale
    felt = read_contacts(
        contacts, position_error=bound, normal_error=np.radians(normal_error_deg), scale=scale
    )
    if not len(felt.contacts):
        raise ValueError(f"{contacts}: no contact in it, only ways that met nothing")
    support = None
    if plane is not None or resting:
        height = 0.0 if plane is None else plane * scale
        support = SupportPlane(height=height, error=bound, resting=resting)
    recognizer = Recognizer(
        load_folder(library, scale=scale),
        features="all" if edges or (felt.contacts.kinds > 1).any() else "faces",
        cache=default_folder(),
    )
    belief = recognizer.recognize(
        felt.contacts, outliers=outliers, free_space=felt.free_space, support=support
    )
    if json:
        print(json_format.dumps(_document(recognizer, belief, units), indent=2))
        return
    console = Console(highlight=False, soft_wrap=True)
    console.width = max(console.width, WIDTH)
    _tell(console, recognizer, felt, belief, units)


def metres(units: str) -> float:
    """A unit of length in metres.

    Raises:
        ValueError: it isn't known.
    """
    if units not in UNITS:
        raise ValueError(f"units is {units!r}; it must be one of {', '.join(UNITS)}")
    return UNITS[units]


def _tell(
    console: Console, recognizer: Recognizer, felt: FeltFile, belief: Belief, units: str
) -> None:
    """The answer for a person to read."""
    from ..recognizer.verdict import Verdict, verdict

    misses = f" and {felt.misses} ways that met nothing" if felt.misses else ""
    console.print(
        f"{len(felt.contacts)} contacts{misses}, {len(recognizer.models)} parts in the library."
    )
    word, found = verdict(belief), belief.hypotheses
    if word is Verdict.UNKNOWN:
        _tell_why_nothing_fits(console, recognizer, belief)
        return
    parts = list(dict.fromkeys(hypothesis.object_name for hypothesis in found))
    said = {
        Verdict.UNIQUE: f"[bold]It is {parts[0]}[/], and this is how it lies.",
        Verdict.AMBIGUOUS: f"[bold]Ambiguous[/]: {len(found)} poses of {_some(parts)} fit alike.",
        Verdict.UNDERDETERMINED: f"[bold]Underdetermined[/]: {len(found)} ways for {_some(parts)}"
        " to lie fit, and some leave it free to shift or turn. Touch other faces.",
        Verdict.CUT_SHORT: "[bold]Cut short[/]: so many interpretations fit that not all were"
        " looked at. More contacts, or tighter bounds, help.",
    }
    console.print(said[word])
    console.print(_table(found[:SHOWN], recognizer, units))
    if len(found) > SHOWN:
        console.print(f"… and {len(found) - SHOWN} more (--json lists all)")
    console.print(f"\nmodel to world, of the first ({units}):")
    console.print(_matrix(found[0], units))


def _some(parts: list[str]) -> str:
    return ", ".join(parts[:4]) + (f" and {len(parts) - 4} others" if len(parts) > 4 else "")


def _tell_why_nothing_fits(console: Console, recognizer: Recognizer, belief: Belief) -> None:
    from ..recognizer.diagnosis import diagnose, too_far_apart

    console.print("[bold]Not in this library[/]: no part fits these contacts.")
    times = too_far_apart(recognizer, belief.contacts)
    if times is not None:
        console.print(f"They are {times:.1f} times as far apart as the largest part is long.")
    paths = belief.free_space if len(belief.free_space) else None
    for finding in diagnose(recognizer, belief.contacts, free_space=paths, support=belief.support):
        best = finding.belief.hypotheses[0].object_name
        console.print(f"Perhaps {finding.explanation} (then {best} fits).")


def _table(found: tuple[Hypothesis, ...], recognizer: Recognizer, units: str) -> Table:
    """Hypotheses as rows."""
    import numpy as np
    from rich.table import Table

    table = Table("part", "weight", f"position ({units})", "rotation vector (°)", box=None)
    table.add_column("± " + units)
    table.add_column("± °")
    table.add_column("free")
    for column in table.columns[1:]:
        column.justify = "right"
    digits, scale = DIGITS[units], UNITS[units]
    for one in found:
        position, turn = one.pose.translation / scale, np.degrees(one.pose.rotation.as_rotvec())
        shift, tilt = _uncertainty(one, recognizer)
        table.add_row(
            one.object_name,
            f"{one.weight:.2f}",
            " ".join(f"{value:.{digits}f}" for value in position),
            " ".join(f"{value:.2f}" for value in turn),
            f"{shift / scale:.{digits}f}" if one.determined else "open",
            f"{np.degrees(tilt):.2f}" if one.determined else "open",
            str(len(one.freedoms)) if len(one.freedoms) else "",
        )
    return table


def _uncertainty(one: Hypothesis, recognizer: Recognizer) -> tuple[float, float]:
    """Standard deviations of a pose along the worst direction: metres, and radians."""
    import numpy as np

    # Turns are kept as what they move at half the diameter.
    radius = next(m.diameter for m in recognizer.models if m.name == one.object_name) / 2.0
    shift, turn = (
        np.linalg.eigvalsh(part)[-1] for part in (one.covariance[3:, 3:], one.covariance[:3, :3])
    )
    return float(np.sqrt(shift)), float(np.sqrt(turn)) / radius


def _matrix(one: Hypothesis, units: str) -> str:
    matrix = one.T_world_object.copy()
    matrix[:3, 3] /= UNITS[units]
    return "\n".join("  ".join(f"{value:12.6f}" for value in row) for row in matrix)


def _document(recognizer: Recognizer, belief: Belief, units: str) -> dict[str, object]:
    """The answer as the --json document."""
    from ..recognizer.verdict import verdict

    scale = UNITS[units]
    listed = []
    for one in belief.hypotheses:
        matrix = one.T_world_object.copy()
        matrix[:3, 3] /= scale
        shift, turn = _uncertainty(one, recognizer)
        listed.append(
            {
                "object": one.object_name,
                "pose": matrix.tolist(),
                "position": matrix[:3, 3].tolist(),
                "rotation_vector": one.pose.rotation.as_rotvec().tolist(),
                "weight": one.weight,
                "determined": one.determined,
                "freedoms": len(one.freedoms),
                "position_deviation": shift / scale,
                "rotation_deviation": turn,
                "interpretation": one.interpretations[0].tolist(),
            }
        )
    return {
        "verdict": verdict(belief).value,
        "complete": belief.complete,
        "units": units,
        "hypotheses": listed,
    }
