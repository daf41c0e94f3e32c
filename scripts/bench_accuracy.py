"""How far off the pose of the right hypothesis is, beside the memo's Table V (Section 4.3)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..envs.library import load_library
from ..envs.probe_env import INCH
from ..recognizer import Recognizer, pose_difference
from .bench_report import Row, Section, Settings, draw_cases, noise_of, steps

TABLE_V = (
    ("simple-hand", 12, 0.01, 2.17, 2.70, 0.08),
    ("simple-hand", 12, 0.05, 2.08, 2.12, 0.09),
    ("simple-hand", 10, 0.01, 3.33, 2.68, 0.11),
    ("simple-hand", 10, 0.05, 3.58, 2.30, 0.12),
    ("simple-hand", 8, 0.01, 4.43, 2.80, 0.16),
    ("simple-hand", 8, 0.05, 5.26, 2.48, 0.17),
    ("housing", 10, 0.05, 3.13, 2.27, 0.13),
    ("housing", 10, 0.10, 3.77, 2.12, 0.20),
)
"""Object; bounds: pi over a number, and inches; mean errors: of the direction of rotation, degrees,
of its angle, degrees, of the translation, inches. The rows that the scan leaves readable."""
FEWEST, MOST = 12, 20
SHARE = 0.1
"""The goal: a tenth of the memo's error of the angle, and of its error of the translation."""
PLAIN_ROWS = tuple(
    (name, 10, 0.01) for name in ("housing", "housing-34", "stapler", "simple-hand", "complex-hand")
)


def measure_accuracy(settings: Settings) -> Section:
    """Mean errors of the right hypothesis, where the contacts fix its pose."""
    recognizers = {model.name: Recognizer([model]) for model in load_library()}
    fewer = replace(settings, cases=max(settings.cases // 2, 1))
    rows = []
    for name, pi_over, inches, direction, angle, shift in TABLE_V:
        degrees, off, count = _errors(recognizers[name], pi_over, inches, (FEWEST, MOST), fewer)
        rows.append(
            Row(
                f"{name}, π/{pi_over}, {inches:.2f} in",
                _shown(degrees, off, count),
                f"{SHARE * angle:.2f}°, {SHARE * shift:.3f} in",
                degrees <= SHARE * angle and off <= SHARE * shift if count else None,
                [
                    f"memo: direction {direction}°, angle {angle}°, translation {shift} in;"
                    f" the last two over ours: {angle / degrees:.1f}, {shift / off:.1f}"
                ],
            )
        )
    for name, pi_over, inches in PLAIN_ROWS:
        errors = _errors(recognizers[name], pi_over, inches, (16, 16), fewer)
        rows.append(Row(f"{name}, π/{pi_over}, {inches:.2f} in, 16 contacts", _shown(*errors)))
    return Section(
        f"pose error, {FEWEST} to {MOST} grid contacts, mean over (n) of {fewer.cases} cases",
        rows,
        "Counted are the cases whose contacts fix all six freedoms. Ours is the angle of the whole"
        " rotation between the two poses, up to symmetry, and the distance of the centroids; the"
        " memo gives direction and angle of its rotation apart. The goal is a tenth of its angle,"
        " whatever its direction adds, and of its translation.",
    )


def _shown(degrees: float, inches: float, count: int) -> str:
    return f"{degrees:.2f}°, {inches:.4f} in ({count})" if count else "(0)"


def _errors(
    recognizer: Recognizer,
    pi_over: float,
    inches: float,
    touches: tuple[int, int],
    settings: Settings,
) -> tuple[float, float, int]:
    """Mean degrees, mean inches, and over how many cases."""
    (model,) = recognizer.models
    errors = []
    cases = draw_cases([model], noise_of(pi_over, inches), touches, settings)
    for case in steps(cases, f"accuracy: {model.name}, π/{pi_over}, {inches:.2f} in"):
        for hypothesis in recognizer.recognize(case.contacts).hypotheses:
            right = (hypothesis.interpretations == case.truth.faces).all(axis=1).any()
            if right and hypothesis.determined:
                off = pose_difference(model, hypothesis.pose, case.truth.T_world_object)
                errors.append((np.degrees(off.rotation), off.translation / INCH))
    degrees, shift = np.mean(errors, axis=0) if errors else (np.nan, np.nan)
    return float(degrees), float(shift), len(errors)
