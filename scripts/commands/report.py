"""`palpate report`: a benchmark's rows as a page, in Markdown and in HTML."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from ..benchmark.row import EpisodeRow
    from ..report.page import Block
    from ..report.results import SettingResult

__all__ = ["report", "write_report"]

TOGETHER = "all together"


def report(
    folder: Annotated[
        Path, typer.Argument(metavar="FOLDER", help="What palpate benchmark wrote to.")
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="The page, as FILE.md and FILE.html; figures lie beside it. [dim]default:"
            " FOLDER/report[/]",
            show_default=False,
        ),
    ] = None,
) -> None:
    """Make a page of a benchmark: tables, curves and statistics, in Markdown and in HTML.

    The HTML file has everything in it. Figures are also written as SVG and PDF. A benchmark that
    still runs may be reported: what every strategy has played so far is compared.
    """
    from rich.console import Console

    page = out or folder / "report"
    if page.suffix in (".md", ".html"):
        page = page.with_suffix("")
    console = Console(highlight=False, soft_wrap=True)
    with console.status("resampling and drawing"):
        write_report(folder, page)
    console.print(f"{page}.html and {page}.md; figures: {page}-*.svg and .pdf")


def write_report(folder: Path, page: Path) -> None:
    """Write the page of a benchmark.

    Args:
        folder: the benchmark's.
        page: the files' path without ending.

    Raises:
        ValueError: the folder isn't a benchmark's, or no episode has been played by all strategies.
    """
    from ..benchmark.store import RowStore
    from ..report.page import html, markdown
    from ..report.text import TITLE
    from ..whole_file import write_whole
    from .benchmark import read_settings

    settings = read_settings(folder)
    rows = RowStore(folder).rows()
    policies = [str(name) for name in _list(settings["policies"])]
    page.parent.mkdir(parents=True, exist_ok=True)
    blocks = _content(settings, rows, policies, page)
    if blocks is None:
        raise ValueError(
            f"{folder}: no episode has been played by all strategies yet, {len(rows)} in all"
        )
    for ending, text in (("md", markdown(blocks, f"{page.name}-")), ("html", html(blocks, TITLE))):
        write_whole(page.with_name(f"{page.name}.{ending}"), text.encode())


def _content(
    settings: dict[str, Any], rows: Sequence[EpisodeRow], policies: Sequence[str], page: Path
) -> list[Block] | None:
    from ..report import text as text
    from ..report.page import Heading

    by_noise = {
        str(noise): _results(rows, policies, _list(settings["objects"]), noise)
        for noise in _list(settings["noise"])
    }
    by_noise = {noise: results for noise, results in by_noise.items() if results}
    if not by_noise:
        return None
    everything = [result for results in by_noise.values() for result in results]
    single = [result for result in everything if result.objects != TOGETHER]
    blocks = [*text.introduction(rows), *text.at_a_glance(everything)]
    probes, curves = _drawn(by_noise, page)
    blocks += [Heading("Probes needed"), *text.figures(probes)]
    for result in everything:
        blocks += text.setting_tables(result)
    blocks += [Heading("Probe by probe"), *text.figures(curves)]
    blocks += [*text.poses_table(single), *text.decision_table(rows)]
    return [*blocks, *text.method(rows), *text.reproduction(settings, rows)]


def _results(
    rows: Sequence[EpisodeRow], policies: Sequence[str], objects: Sequence[str], noise: str
) -> list[SettingResult]:
    """Of each object, and of all of them together if there are several."""
    from ..report.results import settle

    own = [row for row in rows if row.noise == noise]
    found = [
        settle([row for row in own if row.objects == name], policies, name, noise)
        for name in objects
    ]
    if len(objects) > 1:
        found.append(settle(own, policies, TOGETHER, noise))
    return [result for result in found if result is not None]


def _drawn(
    by_noise: dict[str, list[SettingResult]], page: Path
) -> tuple[list[tuple[str, str, str]], list[tuple[str, str, str]]]:
    """Name, SVG and caption of the figures of probes, and of those of curves."""
    from ..report.plots import draw_left, draw_probes, draw_unsolved, save

    probes, curves = [], []
    for number, (noise, results) in enumerate(by_noise.items(), 1):
        for kind, draw, figures, caption in (
            (
                "probes",
                draw_probes,
                probes,
                "Mean probes to unique with 95 % intervals; dotted, the floor",
            ),
            ("unsolved", draw_unsolved, curves, "Share of the episodes not solved yet"),
            (
                "left",
                draw_left,
                curves,
                "Mean number of hypotheses left, of the episodes with a contact by then",
            ),
        ):
            name = f"{kind}-{number}"
            svg = save(draw(results), page.with_name(f"{page.name}-{name}"))
            figures.append((name, svg, f"{caption}; noise {noise}."))
    return probes, curves


def _list(value: object) -> list[Any]:
    if not isinstance(value, list):
        raise ValueError(f"{value!r}: the benchmark's settings should have a list here")
    return value
