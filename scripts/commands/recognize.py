"""`palpate recognize`: your contacts, your parts: which part is it, and where does it lie?"""

from __future__ import annotations

import json as json_format
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .own_parts import (
    DIGITS,
    UNITS,
    WIDTH,
    ContactsFile,
    Edges,
    Json,
    Library,
    NormalErrorDeg,
    Outliers,
    PlaneHeight,
    PositionError,
    Resting,
    Units,
    metres,
    read_given,
)

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

    from ...recognizer import Belief, FeltFile, Hypothesis, Recognizer

__all__ = ["recognize"]

MOST_COMPARED = 50
"""Parts that are looked at for two that are the same."""
SHOWN = 10
"""Hypotheses in the table."""


def recognize(
    contacts: ContactsFile,
    library: Library,
    units: Units = "mm",
    position_error: PositionError = None,
    normal_error_deg: NormalErrorDeg = 15.0,
    plane: PlaneHeight = None,
    resting: Resting = False,
    outliers: Outliers = 0,
    edges: Edges = False,
    html: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.html",
            help="Write a page to look at, touch by touch; opens offline in a browser.",
            show_default=False,
        ),
    ] = None,
    json: Json = False,
) -> None:
    """Say which part of a library was touched, and where it lies.

    Prints every part and pose that the contacts allow, and whether that is unique, ambiguous, still
    undetermined, or not in this library. Poses take the part's own coordinates to those of the
    contacts.
    """
    from rich.console import Console

    from ...recognizer import Recognizer
    from ...recognizer.tables.table_cache import default_folder

    if html is not None:
        from ..page.page import check_page_path

        check_page_path(html)
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
    felt = given.felt
    if felt is None or not len(felt.contacts):
        raise ValueError(f"{contacts}: no contact in it, only ways that met nothing")
    recognizer = Recognizer(given.models, features=given.features, cache=default_folder())
    belief = recognizer.recognize(
        felt.contacts, outliers=outliers, free_space=felt.free_space, support=given.support
    )
    console = Console(highlight=False, soft_wrap=True, quiet=json)
    if json:
        print(json_format.dumps(_document(recognizer, belief, units), indent=2))
    else:
        console.width = max(console.width, WIDTH)
        _tell(console, recognizer, felt, belief, units)
    if html is not None:
        from ..page.page import write_page
        from ..page.story_contacts import Beliefs, contacts_story

        told = Beliefs.of(felt, belief, recognizer)
        story = contacts_story(contacts.name, recognizer, told, (units, metres(units)))
        console.print(
            f"\npage: {html}, {1e-6 * write_page(story, html):.1f} MB, opens in a browser"
        )


def _tell(
    console: Console, recognizer: Recognizer, felt: FeltFile, belief: Belief, units: str
) -> None:
    """The answer for a person to read."""
    tell_verdict(console, recognizer, felt, belief)
    found = belief.hypotheses
    if not found:
        return
    console.print(_table(found[:SHOWN], recognizer, units))
    if len(found) > SHOWN:
        console.print(f"… and {len(found) - SHOWN} more (--json lists all)")
    console.print(f"\nmodel to world, of the first ({units}):")
    console.print(_matrix(found[0], units))


def tell_verdict(console: Console, recognizer: Recognizer, felt: FeltFile, belief: Belief) -> None:
    """What there is, what it amounts to, and if nothing fits, why that may be."""
    from ...recognizer.advice.verdict import Verdict, verdict

    misses = f" and {felt.misses} ways that met nothing" if felt.misses else ""
    console.print(
        f"{len(felt.contacts)} contacts{misses}, {len(recognizer.models)} parts in the library."
    )
    word, found = verdict(belief), belief.hypotheses
    if not found:
        if word is Verdict.UNKNOWN:
            _tell_why_nothing_fits(console, recognizer, felt, belief)
        else:
            console.print(
                "[bold]Cut short[/]: nothing was found before a budget ran out, which rules nothing"
                " out. More contacts, or tighter bounds, help."
            )
        return
    parts = list(dict.fromkeys(hypothesis.object_name for hypothesis in found))
    ways, fit = ("1 way", "fits") if len(found) == 1 else (f"{len(found)} ways", "fit")
    said = {
        Verdict.UNIQUE: f"[bold]It is {parts[0]}[/], and its pose is fixed.",
        Verdict.AMBIGUOUS: f"[bold]Ambiguous[/]: {len(found)} poses of {_some(parts)} fit alike.",
        Verdict.UNDERDETERMINED: f"[bold]Underdetermined[/]: {ways} for {_some(parts)} to lie"
        f" {fit}, with freedom left to shift or turn. Touch other faces.",
        Verdict.CUT_SHORT: "[bold]Cut short[/]: so many interpretations fit that not all were"
        " looked at. More contacts, or tighter bounds, help.",
    }
    console.print(said[word])
    if word is not Verdict.UNIQUE:
        _tell_same_parts(console, belief, parts)


def _tell_same_parts(console: Console, belief: Belief, parts: list[str]) -> None:
    """Say which of the parts left are one in two files: no touch tells these apart."""
    from ...recognizer.advice.twins import same_parts

    models = [model for model in belief.library.models if model.name in parts[:MOST_COMPARED]]
    for one, other in same_parts(models):
        console.print(f"{one} and {other} are the same part, in two files: remove one of them.")


def _some(parts: list[str]) -> str:
    return ", ".join(parts[:4]) + (f" and {len(parts) - 4} others" if len(parts) > 4 else "")


def _tell_why_nothing_fits(
    console: Console, recognizer: Recognizer, felt: FeltFile, belief: Belief
) -> None:
    from ...recognizer.advice.diagnosis import diagnose, too_far_apart

    console.print("[bold]Not in this library[/]: no part fits these contacts.")
    times = too_far_apart(recognizer, belief.contacts)
    if times is not None:
        console.print(f"They are {times:.1f} times as far apart as the largest part is long.")
    paths = belief.free_space if len(belief.free_space) else None
    for finding in diagnose(recognizer, belief.contacts, free_space=paths, support=belief.support):
        best = finding.belief.hypotheses[0].object_name
        line = "" if finding.contact is None else f", line {felt.rows[finding.contact]} of the file"
        console.print(f"Perhaps {finding.explanation} (then {best} fits{line}).")


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
    from ...recognizer.advice.verdict import verdict

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
