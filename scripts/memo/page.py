"""The memo's experiments as a page: for someone who has not read the memo."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from ..report.markdown import Table, code, figure, items
from ..report.page import write_page
from ..whole_file import write_whole
from .judge import FACTOR
from .section import Figure, Section

TITLE = "AI Memo 738, rerun"
STEM = "memo738"
"""What the page's files are called."""

INTRODUCTION = f"""\
# {TITLE}

W. E. L. Grimson and T. Lozano-Pérez, “Model-Based Recognition and Localization from Sparse Range
or Tactile Data” (MIT AI Memo 738, 1983), asks how little has to be felt of a known object to say
where it is. palpate is built on its method. This page runs the memo's experiments again and sets
its printed figures beside ours.

## The method in five lines

**What is measured.** Contacts: points on the object's surface with the outward normals there.
Each point is known to within a bound (0.01 in, say) and each normal to within another (π/10, say:
a cone of 18° around the reading). Inside their bounds, errors are random; never beyond.

**Interpretations.** An interpretation says on which face of the object each contact lies. They
form a tree: the first contact on any face, for each of these the second on any, and so on.

**Local constraints.** Most of the tree is cut off by looking at pairs of contacts: two contacts
can't be on two faces whose points are never as far apart as they are (distance), whose normals
make another angle (angle), or where the one is never as far above the other (direction).

**Model test.** What is left is tested as a whole: is there one pose of the object (rotation and
translation) that puts every contact on its face? Interpretations that pass with about the same
pose count as one transform.

**What a good result is.** Few interpretations and few transforms, and the right ones always among
them.

## How figures are compared

A row is “within” if our median is within a factor of {FACTOR:g} of the memo's, and if along each
axis of noise our medians never fall where the memo's rise, or rise where they fall. Tables of
other things than counts state their own rule. Rows outside the rule are marked and explained;
none is left out. Four figures in a cell are the least, the median, the 90th percentile and the
most of a row's trials.

The memo's objects are lost: it prints drawings, and their sizes and numbers of faces. Ours are
stand-ins with the same numbers of faces and the same diameters. The shapes of the housing, the
stapler, the complex hand and the planar wrench were chosen so that the medians of Table II (Table
I for the wrench) come out in the same order of magnitude; there an agreement of medians is a fit.
The simple hand, the 34-faced housing of Tables VII to IX and the other planar objects weren't
fitted, and no object was to any other table. The memo's own figures were read from a transcript
without page numbers, damaged in places, which is said where it matters."""


def page(sections: Sequence[Section], command: str, trials: int | None) -> str:
    """All that the page shows, as Markdown.

    Args:
        sections: what was run.
        command: how to do it again.
        trials: a row; None for as many as the memo ran.
    """
    blocks = [INTRODUCTION]
    if trials is not None:
        blocks.append(
            f"**Trials.** {trials} trials a row were run here, where the memo ran 100 (Table I:"
            " 250)."
        )
    blocks += ["## At a glance", verdict(sections), f"{_glance(sections)}"]
    for section in sections:
        blocks += _section(section)
    return "\n\n".join([*blocks, *_made(command)]) + "\n"


def write_sections(
    sections: Sequence[Section], command: str, folder: Path, trials: int | None = None
) -> Path:
    """Write the page as Markdown and as HTML, its drawings, and all figures as JSON.

    Args:
        sections: what was run.
        command: how to do it again.
        folder: made if it isn't there.
        trials: a row; None for as many as the memo ran.

    Returns:
        The files' path without ending.
    """
    folder.mkdir(parents=True, exist_ok=True)
    stem = folder / STEM
    for block in (block for section in sections for block in section.blocks):
        if isinstance(block, Figure):
            write_whole(folder / _file(block), block.svg.encode())
    write_page(stem, page(sections, command, trials), TITLE)
    data = json.dumps(as_data(sections, command), indent=1, ensure_ascii=False, allow_nan=False)
    write_whole(stem.with_name(f"{STEM}.json"), f"{data}\n".encode())
    return stem


def as_data(sections: Sequence[Section], command: str) -> dict[str, Any]:
    """All figures and verdicts, as JSON has them; what the memo doesn't print is null."""
    return {
        "command": command,
        "factor": FACTOR,
        "experiments": [_data(section) for section in sections],
    }


def verdict(sections: Sequence[Section]) -> str:
    """All sections in one sentence."""
    rows = [row for section in sections for row in section.comparisons]
    judged = [row for row in rows if row.verdict != "not judged"]
    within = sum(row.verdict == "within" for row in judged)
    counts = [(section.name, len(outside(section))) for section in sections]
    named = ", ".join(f"{name} {count}" for name, count in counts if count)
    where = f" ({named})" if named else ""
    checked = sum(section.checked for section in sections)
    lost = sum(section.lost for section in sections)
    return (
        f"{within} of {len(judged)} rows that can be judged are within the rule,"
        f" {len(judged) - within} outside{where}. The right interpretation was looked for"
        f" {checked:,} times, and was missing {lost:,} times."
    )


def outside(section: Section) -> list[str]:
    """Rows outside the rule, each with its reason."""
    return [
        f"{', '.join(row.key)}: {row.why}."
        for row in section.comparisons
        if row.verdict == "outside"
    ]


def _glance(sections: Sequence[Section]) -> Table:
    rows = []
    for section in sections:
        verdicts = [row.verdict for row in section.comparisons]
        rows.append(
            [
                section.title,
                section.place,
                *(f"{verdicts.count(v)}" for v in ("within", "outside", "not judged")),
                f"{section.checked:,}",
                f"{section.lost}",
            ]
        )
    heads = ("rows within", "outside", "not judged", "trials checked", "right one lost")
    return Table(("experiment", "memo", *heads), rows)


def _section(section: Section) -> Iterator[str]:
    yield f"## {section.title}"
    yield f"Memo: {section.place}."
    yield f"**Asked.** {section.asked}"
    yield f"**Done.** {section.done}"
    yield f"**Found.** {section.found}"
    for block in section.blocks:
        if isinstance(block, Figure):
            yield figure(_file(block), block.caption)
        else:
            yield f"{block}"
    if reasons := outside(section):
        yield "**Rows outside the rule:**"
        yield items(reasons)
    if reasons := {row.why for row in section.comparisons if row.verdict == "not judged"}:
        yield f"**Not judged:** {'; '.join(sorted(reasons))}."
    if section.checked:
        yield (
            f"The right interpretation was discarded in {section.lost:,} of {section.checked:,}"
            " trials."
        )


def _file(drawing: Figure) -> str:
    return f"{STEM}-{drawing.name}.svg"


def _made(command: str) -> Iterator[str]:
    from ..benchmark.config import versions

    made_with = ", ".join(f"{name} {value}" for name, value in json.loads(versions()).items())
    yield "## How this page was made"
    yield (
        "One command runs everything and writes this page. The seed decides every case, so that"
        " all but running times comes out the same on any number of processors."
    )
    yield code(command)
    yield f"Made with {made_with}."


def _data(section: Section) -> dict[str, Any]:
    tables = [
        {"heads": list(block.heads), "rows": [list(row) for row in block.rows]}
        for block in section.blocks
        if isinstance(block, Table)
    ]
    facts = {
        name: getattr(section, name)
        for name in ("name", "title", "place", "asked", "done", "found", "checked", "lost")
    }
    rows = [_finite(asdict(row)) for row in section.comparisons]
    return {**facts, "rows": rows, "tables": tables}


def _finite(value: Any) -> Any:
    """The same, with None for what isn't a number: JSON has no word for that."""
    if isinstance(value, dict):
        return {key: _finite(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(each) for each in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value
