"""Table V of the memo: how far off its pose is, by its own method and by ours (Section 4.3)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ....assets.memo import PoseErrorRow, place, table5
from ...report.markdown import Table, items
from ..plan import Plan, run_rows
from ..section import Comparison, Figure, Section
from ..trial import Spec
from .judge import COLUMNS, FACTOR, NAMES, SURE, TRIALS, given, judge, means, printed
from .plots import draw_means, draw_singularity
from .trials import METHODS, TRANSLATION, WHOLE, Errors, measure_errors


def run(plan: Plan) -> Section:
    """Rerun Table V."""
    rows, trials = table5(), plan.trials or TRIALS
    found = run_rows(plan, map(Spec.of, rows), trials, measure_errors, "Table V")
    return _section(rows, [Errors.join(pieces) for pieces in found.values()], trials)


def _section(rows: Sequence[PoseErrorRow], errors: Sequence[Errors], trials: int) -> Section:
    compared = judge(rows, errors)
    outside = [f"{', '.join(row.key)}: {row.why}" for row in compared if row.verdict == "outside"]
    return Section(
        name="table5",
        title="Table V: how far off the computed pose is",
        place="Section 3 and Section 4.3, Table V",
        asked=(
            "Once each contact has been given the right face, how far is the pose that is computed"
            " from the true one? The memo prints three mean errors a row: of the direction about"
            " which the object is turned, of the angle by which it is turned, and of its shift."
        ),
        done=(
            f"{trials} times a row an object at a random orientation was sensed by grids of rays,"
            " 12 to 20 contacts, and noise uniform in the row's bounds was added: a cone around"
            " each normal, a ball around each position. From the right faces a pose was computed"
            " twice. The memo's method takes a rotation from every two normals and averages them,"
            " then a shift from every three planes and averages those; its printed sign of the"
            " sine, which gives the inverse rotation, is put right. The joint fit, which palpate"
            " uses, is one least squares of all normals and planes, each contact held within the"
            " rim of its face. Every row sees the same poses and the same noise, scaled to its"
            " bounds. The shift is that of the model's origin, as in the memo."
        ),
        found=_found(compared, errors),
        blocks=(
            _table(rows, errors, compared),
            (
                "Mean errors. A row is within if each mean by the memo's method is within a factor"
                f" of {FACTOR:g} of the printed one, and no mean is ordered the other way against"
                " the next row of less noise; means count as ordered if they are more than"
                f" {SURE:g} standard errors apart, here and in the memo. {place('table5').damage}"
                " They have a question mark and are not judged. The memo's rotation comes from"
                " normals alone, so a larger error of positions can't change it: where its"
                " direction and angle differ between rows of one bound on normals, that is the"
                " scatter of a mean of 100."
            ),
            *([items(outside)] if outside else []),
            Figure(
                "pose-errors",
                draw_means(rows, errors),
                "Mean errors by row, with 95 % intervals, on logarithmic scales.",
            ),
            _rotation_table(rows, errors),
            (
                "The same poses by the angle of the one rotation that leads from the computed pose"
                " to the true one. It is the better measure, since it needs no direction: an object"
                " that is hardly turned has hardly a direction of rotation, and the error of that"
                " grows without bound there, though the pose is as good as any."
            ),
            Figure(
                "direction-singular",
                draw_singularity(errors),
                "Errors of the memo's method against the angle by which the object was truly"
                " turned, one dot a trial: left of the direction of rotation, right of the whole"
                " rotation.",
            ),
        ),
        comparisons=compared,
        checked=trials * len(rows),
        lost=sum(error.lost for error in errors),
    )


def _found(compared: Sequence[Comparison], errors: Sequence[Errors]) -> str:
    judged = [row for row in compared if row.verdict != "not judged"]
    within = sum(row.verdict == "within" for row in judged)
    ratios = np.array([np.divide(row.ours, row.memo or np.nan) for row in judged])
    spans = [
        f"{low:.1f} to {high:.1f}" for low, high in zip(ratios.min(0), ratios.max(0), strict=True)
    ]
    memo, joint = (means(np.concatenate([e.by_method[name] for e in errors])) for name in METHODS)
    none = sum(int(np.isnan(error.by_method[METHODS[0]][:, 0]).sum()) for error in errors)
    without = (
        f" In {none} of the trials the memo's method gives no pose, since the faces that were met"
        " have no three independent normals; the joint fit gives one there too."
    )
    return (
        f"{within} of {len(judged)} readable rows are within. The memo's method here errs by"
        f" {spans[0]} times the printed direction, {spans[1]} times the angle, {spans[2]} times the"
        " shift. The shift depends on where a model has its origin, for an error of the rotation"
        " moves what is far from it: our models have it in the middle of their bounding box, where"
        f" the memo's have it isn't known.{without if none else ''} Over all rows the rotation is"
        f" off by {memo[WHOLE]:.1f}° by the memo's method and by {joint[WHOLE]:.2f}° by the joint"
        f" fit, the shift by {memo[TRANSLATION]:.3f} and {joint[TRANSLATION]:.3f} in: positions"
        " tell the rotation far better than normals do, and the memo's method doesn't ask them."
    )


def _table(
    rows: Sequence[PoseErrorRow], errors: Sequence[Errors], compared: Sequence[Comparison]
) -> Table:
    shown = []
    for row, error, judged in zip(rows, errors, compared, strict=True):
        method, joint = (means(error.by_method[name])[list(COLUMNS)] for name in METHODS)
        cells, unsure = [], "" if row.sure else "?"
        for there, a, b, digits in zip(printed(row), method, joint, (2, 2, 3), strict=True):
            cells += [f"{there:.2f}{unsure}", f"{a:.{digits}f}", f"{b:.{digits}f}"]
        shown.append([", ".join(Spec.of(row).key), *cells, judged.verdict])
    heads = ["object, normal, dist"]
    heads += [f"{name}: {who}" for name in NAMES for who in ("memo", "its method", "joint fit")]
    return Table([*heads, "verdict"], shown)


def _rotation_table(rows: Sequence[PoseErrorRow], errors: Sequence[Errors]) -> Table:
    heads = ["object, normal, dist"]
    for name in METHODS:
        heads += [f"{name}: mean, °", "median, °", "most, °"]
    shown = []
    for row, error in zip(rows, errors, strict=True):
        cells = []
        for name in METHODS:
            whole = given(error.by_method[name])[:, WHOLE]
            figures = (whole.mean(), np.median(whole), whole.max()) if len(whole) else ()
            cells += [f"{figure:.2f}" for figure in figures] or [""] * 3
        shown.append([", ".join(Spec.of(row).key), *cells])
    return Table(heads, shown)
