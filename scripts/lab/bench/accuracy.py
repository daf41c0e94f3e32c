"""How far off the pose of the right hypothesis is, beside the memo's Table V (Section 4.3)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import RigidTransform

from ....assets.memo import table5
from ....envs.library import load_library
from ....envs.probe_env import INCH
from ....recognizer import Recognizer, pose_difference
from ...memo.noise import noise_of
from .limit import mean_pose
from .report import Case, Row, Section, Settings, draw_cases, steps

FEWEST, MOST = 12, 20
SHARE = 0.1
"""The goal: a tenth of the memo's error of the angle, and of its error of the translation."""
PLAIN_ROWS = tuple(
    (name, 10, 0.01) for name in ("housing", "housing-34", "stapler", "simple-hand", "complex-hand")
)
LIMIT_CASES = 40
"""The most cases of a row in which the least possible error is looked for."""

Error = tuple[float, float]
"""Degrees, inches."""


def measure_accuracy(settings: Settings) -> Section:
    """Mean errors of the right hypothesis, where the contacts fix its pose."""
    recognizers = {model.name: Recognizer([model]) for model in load_library()}
    fewer = replace(settings, cases=max(settings.cases // 2, 1))
    rows = []
    for printed in (row for row in table5() if row.sure):
        name, pi_over, inches = printed.object_name, printed.pi_over, printed.position_error_in
        direction, angle, shift = printed.direction_deg, printed.angle_deg, printed.translation_in
        fixed, others, least = _errors(
            recognizers[name], pi_over, inches, (FEWEST, MOST), fewer, limit=True
        )
        judged = fixed or others
        degrees, off = _mean(judged)
        rows.append(
            Row(
                f"{name}, π/{pi_over}, {inches:.2f} in",
                _shown(judged),
                f"{SHARE * angle:.2f}°, {SHARE * shift:.3f} in",
                degrees <= SHARE * angle and off <= SHARE * shift if judged else None,
                [
                    f"memo: direction {direction}°, angle {angle}°, translation {shift} in;"
                    f" the last two over ours: {angle / degrees:.1f}, {shift / off:.1f}",
                    f"all freedoms fixed within the pose tolerance: {_shown(fixed)}; the other"
                    f" right ones: {_shown(others)}",
                    f"least possible, the faces known: {_shown(least)}",
                ],
            )
        )
    for name, pi_over, inches in PLAIN_ROWS:
        fixed, _, _ = _errors(recognizers[name], pi_over, inches, (16, 16), fewer)
        rows.append(Row(f"{name}, π/{pi_over}, {inches:.2f} in, 16 contacts", _shown(fixed)))
    return Section(
        f"pose error, {FEWEST} to {MOST} grid contacts, mean over (n) of {fewer.cases} cases",
        rows,
        "Counted are the cases whose contacts fix all six freedoms to within the pose tolerance;"
        " where there is none, all. Ours is the angle of the whole rotation between the two poses,"
        " up to symmetry, and the distance of the centroids; the memo gives direction and angle of"
        " its rotation apart. The goal is a tenth of its angle, whatever its direction adds, and"
        " of its translation. Least possible is the error, over some of the same cases, of the"
        " mean of all poses that the contacts allow on their true faces: no estimator has a"
        " smaller mean square.",
    )


def _mean(errors: Sequence[Error]) -> Error:
    degrees, inches = np.mean(errors, axis=0) if len(errors) else (np.nan, np.nan)
    return float(degrees), float(inches)


def _shown(errors: Sequence[Error]) -> str:
    degrees, inches = _mean(errors)
    return f"{degrees:.2f}°, {inches:.4f} in ({len(errors)})" if len(errors) else "(0)"


def _errors(
    recognizer: Recognizer,
    pi_over: float,
    inches: float,
    touches: tuple[int, int],
    settings: Settings,
    *,
    limit: bool = False,
) -> tuple[list[Error], list[Error], list[Error]]:
    """Errors of right hypotheses that are fixed, of the others, and the least possible ones.

    The last are of the first cases that count: the fixed ones if there are any.
    """
    (model,) = recognizer.models
    errors: dict[bool, list[Error]] = {True: [], False: []}
    counted: dict[bool, list[Case]] = {True: [], False: []}
    cases = draw_cases([model], noise_of(pi_over, inches), touches, settings)
    for case in steps(cases, f"accuracy: {model.name}, π/{pi_over}, {inches:.2f} in"):
        for hypothesis in recognizer.recognize(case.contacts).hypotheses:
            if (hypothesis.interpretations == case.truth.faces).all(axis=1).any():
                errors[hypothesis.determined].append(_error(case, hypothesis.pose))
                counted[hypothesis.determined].append(case)
    chosen = (counted[True] or counted[False])[: LIMIT_CASES if limit else 0]
    least = [_error(case, mean_pose(case)) for case in steps(chosen, "least possible error")]
    return errors[True], errors[False], least


def _error(case: Case, pose: RigidTransform) -> Error:
    off = pose_difference(case.model, pose, case.truth.T_world_object)
    return float(np.degrees(off.rotation)), off.translation / INCH
