"""Table I: objects of the plane, with and without the direction constraint (memo, Section 4.1)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from itertools import chain
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ...assets import memo
from ..report.markdown import Table
from .judge import FACTOR, figure, four
from .plan import Plan, Trials, run_rows
from .section import Comparison, Figure, Section

if TYPE_CHECKING:
    from ...recognizer import Contacts, Polygon
    from ...recognizer.tables.planar_ranges import PlanarTables

RUNS = 250
"""As many as the memo ran."""
RAYS = 5
POSITION_ERROR_IN = 0.1
NORMAL_ERROR = np.pi / 8
ONES, TENS = 10, 100
"""Counts up to the first have a bin each, up to the second one for ten."""


@dataclass(frozen=True)
class PlanarCounts:
    """Interpretations that one run left."""

    with_direction: int
    without: int
    kept: bool
    """Whether the right one is among both."""


def run(plan: Plan) -> Section:
    """Table I."""
    printed = memo.table1()
    names = list(dict.fromkeys(row.object_name for row in printed))
    runs = plan.trials or RUNS
    pieces = run_rows(plan, names, runs, run_piece, "planar objects")
    found = {name: [*chain.from_iterable(counts)] for name, counts in pieces.items()}
    ours = {
        (row.object_name, row.direction): [
            run.with_direction if row.direction else run.without for run in found[row.object_name]
        ]
        for row in printed
    }
    comparisons = tuple(_judged(row, ours) for row in printed)
    everything = [run for each in found.values() for run in each]
    medians = [
        f"{name} {figure(float(np.median(ours[name, True])))} and"
        f" {figure(float(np.median(ours[name, False])))}"
        for name in names
    ]
    return Section(
        name="table1",
        title="Table I: in the plane, with and without the direction constraint",
        place="Section 4.1, Table I",
        asked=(
            "In the plane an object is an outline, and an interpretation gives each contact an"
            " edge."
            " How many interpretations of five contacts are left by distance and angle alone, and"
            " how many if the direction constraint is added: how far one contact lies above the"
            " other's edge?"
        ),
        done=(
            "An outline is turned at random about its centroid; five evenly spaced rays leave the"
            " centroid, and where each leaves the outline for good is a contact, known to 0.1 in"
            f" and to π/8. {runs} runs an object, each pruned with and without the constraint."
            " palpate's direction constraint is the memo's extended one, on the component along"
            " the normal."
        ),
        found=(
            "Medians with and without it: "
            + ", ".join(medians)
            + " (the memo's: wrench 2 and 48, gator 4 and 12, hand 4 and 9). The wrench's shape was"
            " chosen with this table in view."
        ),
        blocks=(_medians(printed, ours), _drawn(printed, ours), _histograms(printed, ours)),
        comparisons=comparisons,
        checked=len(everything),
        lost=sum(not run.kept for run in everything),
    )


def run_piece(piece: Trials[str]) -> list[PlanarCounts]:
    """Some runs with an object."""
    from ...recognizer import Constraints
    from ...recognizer.tree.tree import prune

    model, tables = _prepared(piece.row)
    counts = []
    for rng in piece.generators():
        contacts, edges = _sense(model, rng)
        strong = prune(tables, contacts).faces
        weak = prune(tables, contacts, constraints=Constraints(component=False)).faces
        kept = all(bool((left == edges).all(axis=1).any()) for left in (strong, weak))
        counts.append(PlanarCounts(len(strong), len(weak), kept))
    return counts


@cache
def _prepared(object_name: str) -> tuple[Polygon, PlanarTables]:
    from ...assets.planar import planar_corners
    from ...recognizer import Polygon
    from ...recognizer.tables.planar_ranges import PlanarTables

    model = Polygon.from_corners(planar_corners(object_name), name=object_name)
    return model, PlanarTables.of(model)


def _sense(model: Polygon, rng: np.random.Generator) -> tuple[Contacts, NDArray[np.int64]]:
    """Five contacts, and the edges that they are on; the outline's centroid is the origin."""
    from scipy.spatial.transform import RigidTransform, Rotation

    from ...envs.planar.rays import cast_planar_rays
    from ...envs.probe_env import INCH
    from ...recognizer import Contacts

    turn = Rotation.from_rotvec([0.0, 0.0, rng.uniform(0.0, 2.0 * np.pi)])
    centroid = turn.apply([*model.centroid, 0.0])
    pose = RigidTransform.from_components(-centroid, turn)
    angles = 2.0 * np.pi * np.arange(RAYS) / RAYS
    outwards = np.column_stack([np.cos(angles), np.sin(angles)])
    # Sent inwards from outside, a ray first meets the crossing that is farthest from the centroid.
    hits = cast_planar_rays(model, pose, 2.0 * model.diameter * outwards, -outwards)
    # A direction and a magnitude at random, as the memo says: not uniform in the disc.
    around = rng.uniform(0.0, 2.0 * np.pi, RAYS)
    far = POSITION_ERROR_IN * INCH * rng.random(RAYS)
    moved = hits.points_world + far[:, None] * np.column_stack([np.cos(around), np.sin(around)])
    leant = rng.uniform(-NORMAL_ERROR, NORMAL_ERROR, RAYS)
    c, s = np.cos(leant), np.sin(leant)
    x, y = hits.normals_world.T
    contacts = Contacts(
        moved,
        np.column_stack([c * x - s * y, s * x + c * y]),
        position_error=POSITION_ERROR_IN * INCH,
        normal_error=NORMAL_ERROR,
    )
    return contacts, hits.edges


def _judged(row: memo.PlanarRow, ours: dict[tuple[str, bool], list[int]]) -> Comparison:
    _, median, _, most = four(ours[row.object_name, row.direction])
    other = float(np.median(ours[row.object_name, not row.direction]))
    reasons = []
    if not 1.0 / FACTOR <= median / row.median <= FACTOR:
        reasons.append(
            f"median {median / row.median:.2g} times the memo's: the stand-in's outline isn't its"
        )
    if (median < other) != row.direction:
        reasons.append("the direction constraint doesn't leave fewer, in the median")
    return Comparison(
        (row.object_name, _said(row)),
        ("median",) if row.largest is None else ("median", "most"),
        (row.median,) if row.largest is None else (row.median, row.largest),
        (median,) if row.largest is None else (median, most),
        "outside" if reasons else "within",
        "; ".join(reasons),
    )


def _said(row: memo.PlanarRow) -> str:
    return "with direction" if row.direction else "without"


def _medians(printed: Sequence[memo.PlanarRow], ours: dict[tuple[str, bool], list[int]]) -> Table:
    rows = []
    for row in printed:
        _, median, _, most = four(ours[row.object_name, row.direction])
        rows.append(
            [
                f"{row.object_name}, {row.edges} edges",
                _said(row),
                f"{row.median}",
                "–" if row.largest is None else f"{row.largest}",
                figure(median),
                figure(most),
                f"{median / row.median:.2f}",
                _judged(row, ours).verdict,
            ]
        )
    heads = ("memo: median", "most", "ours: median", "most", "ratio", "verdict")
    far = [n for n, row in enumerate(rows) if row[-1] == "outside"]
    return Table(("object", "constraint", *heads), rows, marked=far)


def _histograms(
    printed: Sequence[memo.PlanarRow], ours: dict[tuple[str, bool], list[int]]
) -> Table:
    rows = []
    for row in printed:
        label = f"{row.object_name}, {_said(row)}"
        rows.append([f"{label}: memo", *(_shown(number) for number in row.runs)])
        rows.append([f"{label}: ours", *map(_shown, binned(ours[row.object_name, row.direction]))])
    return Table(("runs that left", *memo.planar_bins()), rows)


def _drawn(printed: Sequence[memo.PlanarRow], ours: dict[tuple[str, bool], list[int]]) -> Figure:
    from .plots import draw_histograms

    titled = {}
    for row in printed:
        counts = ours[row.object_name, row.direction]
        # As many runs as the memo's, so that the two can be laid over each other.
        scale = sum(row.runs) / len(counts)
        titled[f"{row.object_name}, {_said(row)}"] = (
            row.runs,
            [scale * number for number in binned(counts)],
        )
    return Figure(
        "table1",
        draw_histograms(titled, memo.planar_bins(), "interpretations"),
        "Runs by the number of interpretations, ours scaled to the memo's number of runs. Left,"
        f" with the direction constraint; right, without. {memo.place('table1').damage}",
    )


def binned(counts: Sequence[int]) -> list[int]:
    """Runs in each of the memo's bins: 1 to 10, then tens, then all above a hundred."""
    ends = [*range(1, ONES + 1), *range(2 * ONES, TENS + 1, 10)]
    return np.bincount(np.searchsorted(ends, counts), minlength=len(ends) + 1).tolist()


def _shown(number: int) -> str:
    return f"{number}" if number else ""
