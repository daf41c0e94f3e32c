"""`palpate report`: a benchmark's rows as a page, in Markdown and in HTML."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

__all__ = ["report"]


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

    from ..report.report import write_report

    page = out or folder / "report"
    if page.suffix in (".md", ".html"):
        page = page.with_suffix("")
    console = Console(highlight=False, soft_wrap=True)
    with console.status("resampling and drawing"):
        write_report(folder, page)
    console.print(f"{page}.html and {page}.md; figures: {page}-*.svg and .pdf")
