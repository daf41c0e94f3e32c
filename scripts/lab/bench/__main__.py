"""Measure the recogniser: `python -m palpate.scripts.lab.bench`, or `make bench`.

Grid contacts on the stand-ins and on random solids, one thread, everything warm, each figure
beside its goal where it has one.
"""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from ...one_thread import keep_to_one_thread

QUICK = 10
"""What `--quick` divides cases and models by."""


class Part(StrEnum):
    """What can be measured on its own."""

    SPEED = "speed"
    ICP = "icp"
    START = "start"
    SCALE = "scale"
    LARGE = "large"
    ACCURACY = "accuracy"
    TABLES = "tables"
    PREDICT = "predict"


def bench(
    cases: Annotated[int, typer.Option(metavar="N", min=1, help="Random cases a row.")] = 200,
    library: Annotated[
        int, typer.Option(metavar="N", min=50, help="Models in the large library.")
    ] = 1000,
    seed: Annotated[int, typer.Option(metavar="N", min=0, help="Seed of the cases.")] = 0,
    only: Annotated[
        list[Part] | None,
        typer.Option(metavar="PART", help=f"Only this part; one or more of: {', '.join(Part)}."),
    ] = None,
    folder: Annotated[
        Path | None,
        typer.Option(
            metavar="PATH",
            help="Keep the large library's range tables here; by default in a temporary folder.",
        ),
    ] = None,
    quick: Annotated[
        bool, typer.Option("--quick", help="A tenth of the cases and of the library.")
    ] = False,
) -> None:
    """Measure speed, accuracy and growth of the recogniser on one thread; beside it, ICP.

    speed: contacts to belief, where the time goes, and the floor of the bit operations. icp: the
    same contacts given to multi-start ICP. start: fresh processes, to a first belief and of
    `palpate suggest` with twenty parts. scale: a large library, and time a model against the number
    of contacts. large: models of 500 faces. accuracy: pose errors beside the memo's Table V.
    tables: range tables, once a model. predict: what many poses say of many probes.
    """
    keep_to_one_thread()
    # Only now: what these import reads the number of threads once.
    from .accuracy import measure_accuracy
    from .icp import measure_icp
    from .models import measure_large, measure_tables
    from .predict import measure_predict
    from .report import Settings, show, show_header
    from .scale import measure_scale
    from .speed import measure_speed
    from .start import measure_start

    parts = {
        Part.SPEED: measure_speed,
        Part.ICP: measure_icp,
        Part.START: measure_start,
        Part.SCALE: measure_scale,
        Part.LARGE: measure_large,
        Part.ACCURACY: measure_accuracy,
        Part.TABLES: measure_tables,
        Part.PREDICT: measure_predict,
    }
    share = QUICK if quick else 1
    settings = Settings(
        cases=max(cases // share, 1), library=library // share, seed=seed, folder=folder
    )
    show_header(settings)
    for part in only or parts:
        show(parts[part](settings))


if __name__ == "__main__":
    app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
    app.command()(bench)
    app()
