"""`palpate reproduce`: an experiment of the memo rerun, its printed figures beside ours."""

from __future__ import annotations

from typing import Annotated

import typer

__all__ = ["reproduce"]

EXPERIMENTS = ("table2",)
FACTOR = 4.0
"""A median counts as of the memo's order if it is within this factor: the shapes are stand-ins."""


def reproduce(
    experiment: Annotated[
        str, typer.Argument(metavar="EXPERIMENT", help=f"One of: {', '.join(EXPERIMENTS)}.")
    ],
    trials: Annotated[
        int, typer.Option(metavar="N", min=1, help="Random cases a row; the memo ran 100.")
    ] = 100,
    seed: Annotated[int, typer.Option(metavar="N", min=0, help="Seed of the cases.")] = 0,
) -> None:
    """Rerun an experiment of AI Memo 738 on the stand-ins, beside the memo's figures.

    table2: how many interpretations the pairwise constraints leave of 12 to 20 grid contacts.
    """
    if experiment not in EXPERIMENTS:
        raise ValueError(f"no experiment is called {experiment!r}; there are: {EXPERIMENTS[0]}")
    _table2(trials, seed)


def _table2(trials: int, seed: int) -> None:
    import numpy as np
    from rich.console import Console
    from rich.progress import track
    from rich.table import Table

    from ..assets.memo import table2
    from ..envs.grid import sense_grid
    from ..envs.library import load_library
    from ..envs.noise import SensorNoise
    from ..envs.probe_env import INCH
    from ..recognizer import PairTables
    from ..recognizer.tree import prune

    rows = table2()
    models = {model.name: model for model in load_library()}
    tables = {row.object_name: PairTables.of(models[row.object_name]) for row in rows}
    shown = Table("object", "normal", "dist", "memo", "here", "ratio", "", box=None)
    for column in shown.columns:
        column.no_wrap = True
    for column in shown.columns[2:6]:
        column.justify = "right"
    lost_in_all = 0
    for row in track(rows, description="Table II", transient=True):
        # Every row sees the same cases, so that rows differ by their noise alone.
        rng = np.random.default_rng(seed)
        noise = SensorNoise(
            position_error=row.position_error_in * INCH, normal_error=np.pi / row.pi_over
        )
        counts, lost = [], 0
        for _ in range(trials):
            truth = sense_grid(models[row.object_name], rng)
            left = prune(tables[row.object_name], truth.noisy(noise, rng)).faces
            counts.append(len(left))
            lost += not (left == truth.faces).all(axis=1).any()
        low, median, p90, high = np.percentile(counts, (0, 50, 90, 100))
        ratio = median / row.median
        verdict = "" if 1.0 / FACTOR <= ratio <= FACTOR else "outside"
        shown.add_row(
            row.object_name,
            f"π/{row.pi_over}",
            f"{row.position_error_in:.2f}",
            f"{row.smallest}/{row.median}/{row.p90}/{row.largest}",
            f"{low:.0f}/{median:.0f}/{p90:.0f}/{high:.0f}",
            f"{ratio:.2f}",
            verdict,
        )
        lost_in_all += lost
    console = Console()
    console.print(
        f"Interpretations after local pruning (memo, Table II), {trials} trials a row.\n"
        "Counts are least/median/90th percentile/most; dist is in inches; the ratio is\n"
        f"that of the medians, marked where it is beyond a factor of {FACTOR:g}.\n"
    )
    console.print(shown)
    console.print(
        f"\nThe true interpretation was lost in {lost_in_all} of {trials * len(rows)} cases."
    )
