"""The memo's range data: a scanner's points on the housing, two views (Section 5)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ....assets.memo import RangeRow, place, range_setting, range_views
from ....envs.sensors.range_image import RangeView
from ...report.markdown import Table
from ..plan import Plan, run_rows
from ..section import Comparison, Figure, Section
from .picture import FoundPose, PictureRow, draw_views
from .trials import (
    ELEVATION,
    OBJECT_NAME,
    REACH,
    READINGS,
    WIDTH,
    Outcome,
    generator,
    interpret,
    readings,
    scan_views,
    scanning,
    take_view,
)

TRIALS = 50
"""Placements of the object a view; the memo had one."""
FACTOR = 4.0
"""A median counts as of the memo's order if it is within this factor."""
NAMES = ("interpretations", "transforms")


def run(plan: Plan) -> Section:
    """Scan the housing from many sides, 11 and 9 points, beside the memo's two views."""
    views, trials = range_views(), plan.trials or TRIALS
    points = [view.points for view in views]
    found = run_rows(plan, points, trials, scan_views, "range images")
    outcomes = [Outcome.join(pieces) for pieces in found.values()]
    return _section(views, outcomes, plan.seed)


def _section(views: Sequence[RangeRow], outcomes: Sequence[Outcome], seed: int) -> Section:
    setting, trials = range_setting(), len(outcomes[0].counts)
    scanner = next(iter(scanning()[2].values()))
    compared = tuple(_compare(view, outcome) for view, outcome in zip(views, outcomes, strict=True))
    chosen = [_illustration(view, one) for view, one in zip(views, outcomes, strict=True)]
    rows = [_picture_row(view, trial, seed) for view, trial in zip(views, chosen, strict=True)]
    sure = np.degrees(np.concatenate([one.sure for one in outcomes]))
    return Section(
        name="range",
        title="Section 5: range data",
        place="Section 5, Figure 9",
        asked=(
            "Does the method work on a real sensor's data? The memo took two dense range images of"
            " a motor housing with a laser, chose 11 points of one and 9 of the other where a plane"
            " fits very well, and was left with 9 and 11 interpretations and with three poses in"
            " one case, two in the other, the right one among them. It doesn't say which had which."
        ),
        done=(
            "Its images are lost, and so is its housing. A simulated scanner takes images of our"
            f" stand-in instead, {trials} placements for 11 points and {trials} for 9: the housing"
            " stands on a plane, on a face drawn as a dropped one would choose, and is scanned"
            f" slantwise from any side, every {setting.grid_cm[0]:g} and {setting.grid_cm[1]:g} cm."
            f" Planes are fitted to {setting.patch} x {setting.patch} readings, and points are"
            " chosen where they fit, far apart and with three independent normals at least; views"
            " without are drawn anew. A reading is off by at most"
            f" {1e3 * scanner.range_error:.3f} mm, which leaves normals sure to"
            f" {np.median(sure):.1f}° (median). Each view is interpreted three times: as read, with"
            f" the memo's bounds, {setting.position_error_in:g} in and π/{setting.pi_over}, which"
            " are far wider than what the readings are off by, as the memo's may have been; with"
            " noise added until it fills those bounds; and with the scanner's own bounds. Poses"
            " count as distinct if they differ by more than 3° or by two position errors."
            f" {place('section5').damage}"
        ),
        found=_found(views, outcomes),
        blocks=(
            _table(views, outcomes),
            (
                "Least / median / 90th percentile / most over the placements; the memo has one"
                " image each. A row is within if the median with the readings as read is within a"
                f" factor of {FACTOR:g} of the memo's figure."
            ),
            Figure(
                "range-views",
                draw_views(rows),
                "One placement for each view: left the range image, shaded by its slopes, with the"
                " points chosen; then the housing at each pose that fits them in the memo's bounds,"
                " seen as the scanner sees it. Shown is the first placement that leaves as many"
                " poses as the memo had, or else the first that leaves most.",
            ),
        ),
        comparisons=compared,
        checked=trials * len(views),
        lost=sum(one.lost for one in outcomes),
    )


def _compare(view: RangeRow, outcome: Outcome) -> Comparison:
    printed = (float(view.interpretations), float(view.transforms))
    counts = outcome.counts[:, 0]
    ours = (float(np.median(counts[:, 0])), float(np.median(counts[:, 2])))
    far = []
    for column, name, here, memo in zip((0, 2), NAMES, ours, printed, strict=True):
        if not 1.0 / FACTOR <= here / memo <= FACTOR:
            low, high = counts[:, column].min(), counts[:, column].max()
            seen = "seen here too" if low <= memo <= high else "not seen here"
            far.append(
                f"{name}: {here / memo:.2f} times the memo's, whose figure is {seen}: another"
                " object, from another side"
            )
    verdict = "outside" if far else "within"
    key = (OBJECT_NAME, view.view, f"{view.points} points")
    return Comparison(key, NAMES, printed, ours, verdict, "; ".join(far))


def _found(views: Sequence[RangeRow], outcomes: Sequence[Outcome]) -> str:
    counts = np.concatenate([one.counts for one in outcomes])
    trees = np.median(counts[:, :, 0], axis=0)
    poses = counts[:, :, 2]
    most = max(view.transforms for view in views)
    fewer = (
        f" The memo's {most} poses of one view are seen here in none: its housing may have been"
        " more like itself, turned, than ours."
    )
    one = [f"{np.mean(poses[:, column] == 1):.0%}" for column in range(len(READINGS))]
    return (
        f"In the memo's bounds the tree is left with {trees[0]:.0f} interpretations in the median,"
        f" and {poses[:, 0].min()} to {poses[:, 0].max()} poses; with noise that fills the bounds"
        f" with {trees[1]:.0f} and {poses[:, 1].min()} to {poses[:, 1].max()}: readings from"
        " anywhere in their bounds contradict a wrong face more often than readings from their"
        " middle. A single pose is"
        f" left in {one[0]} of the views, {one[1]} with the noise, and {one[2]} in the scanner's"
        " own bounds. Wrong poses put the points on faces parallel to the right ones, as they did"
        " in the memo: but for its lip the housing is nearly its own image, turned by half a turn."
        f"{fewer if poses[:, 0].max() < most else ''}"
    )


def _table(views: Sequence[RangeRow], outcomes: Sequence[Outcome]) -> Table:
    rows = []
    for view, outcome in zip(views, outcomes, strict=True):
        label = f"{view.points} points, as in {view.view}"
        rows.append([label, "memo", str(view.interpretations), "", str(view.transforms)])
        for column, name in enumerate(READINGS):
            cells = [_spread(outcome.counts[:, column, stage]) for stage in range(3)]
            rows.append([label, name, *cells])
    heads = ["view", "readings", "interpretations", "after the model test", "transforms"]
    return Table(heads, rows)


def _spread(counts: NDArray[np.int64]) -> str:
    return " / ".join(f"{value:.0f}" for value in np.percentile(counts, (0, 50, 90, 100)))


def _illustration(view: RangeRow, outcome: Outcome) -> int:
    """The trial to draw: the first with as many transforms as the memo's, or with most."""
    transforms = outcome.counts[:, 0, 2]
    alike = np.flatnonzero(transforms == view.transforms)
    return int(alike[0] if len(alike) else transforms.argmax())


def _picture_row(view: RangeRow, trial: int, seed: int) -> PictureRow:
    rng = generator(seed, view.points, trial)
    seen = take_view(view.points, rng)
    _, hypotheses, _ = interpret(seen, readings(seen, rng)[0])
    found = [
        FoundPose(one.pose, bool((one.interpretations == seen.faces).all(axis=1).any()))
        for one in hypotheses
    ]
    scene, _, scanners = scanning()
    diameter, command = seen.model.diameter, seen.command
    return PictureRow(
        title=f"{view.points} points, as in {view.view}",
        scene=scene,
        T_world_object=seen.T_world_object,
        view=RangeView.towards(
            command.x,
            command.y,
            bearing=3.0 * command.yaw,
            elevation=ELEVATION,
            reach=REACH * diameter,
        ),
        width=WIDTH * diameter,
        range_error=scanners[view.points].range_error,
        contacts=seen.contacts,
        poses=sorted(found, key=lambda pose: not pose.right),
    )
