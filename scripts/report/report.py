"""The page of a benchmark, from its rows."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import Any

from ..benchmark.row import EpisodeRow
from ..benchmark.settings import read_settings
from ..benchmark.store import RowStore
from .markdown import figure
from .method import method, reproduction
from .page import write_page
from .plots import draw_left, draw_probes, draw_unsolved, save
from .results import SettingResult, settle
from .text import (
    TITLE,
    at_a_glance,
    decision_table,
    introduction,
    poses_table,
    setting_tables,
)

__all__ = ["write_report"]

TOGETHER = "all together"
PROBES = (("probes", draw_probes, "Mean probes to unique with 95 % intervals; dotted, the floor"),)
CURVES = (
    ("unsolved", draw_unsolved, "Share of the episodes not solved yet"),
    (
        "left",
        draw_left,
        "Mean number of hypotheses left, of the episodes with a contact by then",
    ),
)
"""Figures: name, what draws it, and its caption."""


def write_report(folder: Path, page: Path) -> None:
    """Write the page of a benchmark, as Markdown and as HTML, and its figures.

    Args:
        folder: the benchmark's.
        page: the files' path without ending.

    Raises:
        ValueError: the folder isn't a benchmark's, or no episode has been played by all strategies.
    """
    settings = read_settings(folder)
    rows = RowStore(folder).rows()
    results = _results(settings, rows)
    if not results:
        raise ValueError(
            f"{folder}: no episode has been played by all strategies yet, {len(rows)} in all"
        )
    page.parent.mkdir(parents=True, exist_ok=True)
    write_page(page, "\n\n".join(_content(settings, rows, results, page)) + "\n", TITLE)


def _content(
    settings: Mapping[str, Any],
    rows: Sequence[EpisodeRow],
    results: Mapping[str, Sequence[SettingResult]],
    page: Path,
) -> Iterator[str]:
    everything = list(chain.from_iterable(results.values()))
    yield from introduction(rows)
    yield from at_a_glance(everything)
    yield "## Probes needed"
    yield from _drawn(PROBES, results, page)
    for result in everything:
        yield from setting_tables(result)
    yield "## Probe by probe"
    yield from _drawn(CURVES, results, page)
    yield from poses_table([result for result in everything if result.objects != TOGETHER])
    yield from decision_table(rows)
    yield from method(rows)
    yield from reproduction(settings, rows)


def _results(
    settings: Mapping[str, Any], rows: Sequence[EpisodeRow]
) -> dict[str, list[SettingResult]]:
    """By noise, of each object, and of all of them together if there are several."""
    found = {}
    for noise in settings["noise"]:
        own = [row for row in rows if row.noise == noise]
        taken = {name: [row for row in own if row.objects == name] for name in settings["objects"]}
        if len(taken) > 1:
            taken[TOGETHER] = own
        settled = [
            settle(played, settings["policies"], name, noise) for name, played in taken.items()
        ]
        found[noise] = [result for result in settled if result is not None]
    return {noise: results for noise, results in found.items() if results}


def _drawn(
    kinds: Sequence[tuple[str, Any, str]],
    results: Mapping[str, Sequence[SettingResult]],
    page: Path,
) -> Iterator[str]:
    """Draw figures, each noise on its own, and show them."""
    for number, (noise, settled) in enumerate(results.items(), 1):
        for kind, draw, caption in kinds:
            name = f"{page.name}-{kind}-{number}"
            save(draw(settled), page.with_name(name))
            yield figure(f"{name}.svg", f"{caption}; noise {noise}.")
