"""`palpate suggest`: your contacts, your parts: where to touch next, and what that would tell."""

from __future__ import annotations

import json as json_format
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .own_parts import (
    CONTACTS_HELP,
    CONTACTS_NAME,
    DIGITS,
    UNITS,
    WIDTH,
    Edges,
    Json,
    Library,
    NormalErrorDeg,
    Outliers,
    PlaneHeight,
    PositionError,
    Resting,
    Units,
    read_given,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from rich.console import Console

    from ...policies.outcomes.reports import Report, Suggestion
    from ...policies.session import Session
    from ...policies.straight import Region
    from ...recognizer import FeltFile

__all__ = ["suggest"]

REPORTS = 4
"""Reports of a touch in the table."""


def suggest(
    library: Library,
    contacts: Annotated[
        Path | None,
        typer.Argument(
            metavar=f"[{CONTACTS_NAME}]",
            help=f"{CONTACTS_HELP} Without it nothing has been touched yet.",
            show_default=False,
        ),
    ] = None,
    policy: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help="What makes a touch a good one: information, pruning, pairs, separation, minimax,"
            " decision-region, lookahead, rate or refine.",
        ),
    ] = "information",
    region: Annotated[
        str | None,
        typer.Option(
            metavar="X0,X1,Y0,Y1,Z0,Z1",
            help="The box that the probe's tip can reach. [dim]default: around all that is still"
            " possible[/]",
            show_default=False,
        ),
    ] = None,
    directions: Annotated[
        str | None,
        typer.Option(
            metavar="+x,-x,+y,-y,-z",
            help="The directions in which the probe can move. [dim]default: any but upwards[/]",
            show_default=False,
        ),
    ] = None,
    count: Annotated[int, typer.Option(metavar="N", min=1, help="How many touches to name.")] = 3,
    units: Units = "mm",
    position_error: PositionError = None,
    normal_error_deg: NormalErrorDeg = 15.0,
    plane: PlaneHeight = None,
    resting: Resting = False,
    outliers: Outliers = 0,
    edges: Edges = False,
    json: Json = False,
) -> None:
    """Say where to touch next, and what each part that it may be predicts there.

    A touch starts at a point and goes straight on until it meets the part. Named are those that
    tell most, the best first, each with all that it may report, how likely that is, and which parts
    would say so. Add what you felt to the file, and ask again.
    """
    from rich.console import Console

    from ...policies.session import Session
    from ...recognizer.tables.table_cache import default_folder

    given = read_given(
        contacts,
        library,
        units=units,
        position_error=position_error,
        normal_error_deg=normal_error_deg,
        plane=plane,
        resting=resting,
        edges=edges,
    )
    session = Session(
        given.models,
        features=given.features,
        support=given.support,
        outliers=outliers,
        cache=default_folder(),
    )
    if given.felt is not None:
        session.add(given.felt.contacts, free_space=given.felt.free_space)
    box = None if region is None else _region(region, UNITS[units])
    if session.belief is None and box is None:
        raise ValueError(
            "nothing was touched yet, so nobody knows where the part is: say where the probe can"
            " reach with --region X0,X1,Y0,Y1,Z0,Z1"
        )
    named = session.suggest(count, policy=policy, region=box, directions=_directions(directions))
    if json:
        print(json_format.dumps(_document(session, named, units), indent=2))
        return
    console = Console(highlight=False, soft_wrap=True)
    console.width = max(console.width, WIDTH)
    _tell(console, session, given.felt, named, units)


def _region(text: str, scale: float) -> Region:
    from ...policies.straight import Region

    try:
        numbers = [float(part) * scale for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) != 6:
        raise ValueError(f"--region is {text!r}; it must be six numbers: X0,X1,Y0,Y1,Z0,Z1")
    for axis, low, high in zip("XYZ", numbers[::2], numbers[1::2], strict=True):
        if not low < high:
            raise ValueError(f"--region is {text!r}; {axis}0 must be below {axis}1")
    return Region(numbers[::2], numbers[1::2])


def _directions(text: str | None) -> list[tuple[float, ...]] | None:
    from ...policies.straight import AXES

    if text is None:
        return None
    names = [part.strip().lower() for part in text.split(",")]
    unknown = [name for name in names if name not in AXES]
    if unknown:
        raise ValueError(f"--directions is {text!r}; {unknown[0]!r} isn't one of {', '.join(AXES)}")
    return [AXES[name] for name in names]


def _tell(
    console: Console,
    session: Session,
    felt: FeltFile | None,
    named: tuple[Suggestion, ...],
    units: str,
) -> None:
    """The answer for a person to read."""
    from ...policies.outcomes.reports import Purpose
    from ...recognizer.advice.verdict import Verdict, verdict
    from .recognize import tell_verdict

    belief = session.belief
    if belief is None or felt is None:
        console.print("Nothing was touched yet.")
    else:
        tell_verdict(console, session.recognizer, felt, belief)
        if belief.empty:
            return
    if not named:
        console.print(
            "No straight touch there tells anything: a wider --region, or more --directions?"
        )
        return
    if named[0].purpose is Purpose.FIND:
        console.print(f"To find it ({units}), one after the other until one meets it:")
    elif verdict(belief) is Verdict.UNIQUE:
        console.print(f"Nothing is left to tell apart. What fixes its pose best ({units}):")
    elif named[0].purpose is Purpose.REFINE:
        console.print(f"No touch tells more apart. What fixes the poses best ({units}):")
    else:
        console.print(f"Touches that tell most ({units}):")
    for number, one in enumerate(named, 1):
        _tell_touch(console, number, one, units)
    console.print(
        "\nTo the file goes what was felt, as x,y,z (and nx,ny,nz), with the start as sx,sy,sz;"
        "\nif nothing was, the start and where it ended, as ex,ey,ez."
    )


def _tell_touch(console: Console, number: int, one: Suggestion, units: str) -> None:
    """A touch, and under it all that it may report."""
    from rich.padding import Padding
    from rich.table import Table

    from ...policies.outcomes.reports import Purpose

    told = ""
    if one.purpose is Purpose.TELL_APART:
        told = f", likely to rule out {one.rules_out:.0%}"
    console.print(
        f"\n[bold]{number}[/]  from ({_lengths(one.start_world, units)})"
        f" along {_direction(one.direction_world)}, at most"
        f" {one.length / UNITS[units]:.{_places(units)}f}{told}"
    )
    if not one.reports:
        return
    table = Table(
        "", "met after", "at", "normal", "if it is (× poses)", box=None, padding=(0, 2, 0, 0)
    )
    for column in table.columns[:4]:
        column.justify = "right"
        column.no_wrap = True
    for report in one.reports[:REPORTS]:
        table.add_row(*_row(report, units))
    others = one.reports[REPORTS:]
    if others:
        table.add_row(_share(sum(report.chance for report in others)), f"{len(others)} others")
    console.print(Padding(table, (0, 0, 0, 3)))


def _row(report: Report, units: str) -> list[str]:
    who = ", ".join(
        rival.object_name + (f" ×{len(rival.hypotheses)}" if len(rival.hypotheses) > 1 else "")
        for rival in report.rivals
    )
    if not report.touches:
        return [_share(report.chance), "nothing", "", "", who]
    least, most = (f"{depth / UNITS[units]:.{_places(units)}f}" for depth in report.depths)
    normal = " ".join(f"{value:z.2f}" for value in report.normal_world)
    after = least if least == most else f"{least} to {most}"
    return [_share(report.chance), after, _lengths(report.point_world, units), normal, who]


def _share(chance: float) -> str:
    return f"{chance:.0%}" if chance >= 0.005 else "<1%"


def _places(units: str) -> int:
    """Digits after the point of lengths that a hand sets: a hundredth of a millimetre or so."""
    return DIGITS[units] - 1


def _lengths(values: NDArray, units: str) -> str:
    return " ".join(f"{value / UNITS[units]:z.{_places(units)}f}" for value in values)


def _direction(direction: NDArray) -> str:
    from ...policies.straight import direction_name

    return direction_name(direction) or " ".join(f"{value:z.4f}" for value in direction)


def _document(session: Session, named: tuple[Suggestion, ...], units: str) -> dict[str, object]:
    """The answer as the --json document."""
    from ...recognizer.advice.verdict import verdict

    scale = UNITS[units]
    return {
        "verdict": verdict(session.belief).value,
        "units": units,
        "suggestions": [
            {
                "start": (one.start_world / scale).tolist(),
                "direction": one.direction_world.tolist(),
                "end": (one.end_world / scale).tolist(),
                "purpose": one.purpose.value,
                "score": one.score,
                "rules_out": one.rules_out,
                "reports": [_report(report, scale) for report in one.reports],
            }
            for one in named
        ],
    }


def _report(report: Report, scale: float) -> dict[str, object]:
    return {
        "touches": report.touches,
        "chance": report.chance,
        "after": [depth / scale for depth in report.depths],
        "deviation": report.spread / scale,
        "point": (report.point_world / scale).tolist() if report.touches else None,
        "normal": report.normal_world.tolist() if report.touches else None,
        "rivals": [
            {
                "object": rival.object_name,
                "hypotheses": list(rival.hypotheses),
                "chance": rival.chance,
            }
            for rival in report.rivals
        ],
    }
