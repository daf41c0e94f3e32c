"""The recogniser beside multi-start ICP, on the same contacts."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import RigidTransform

from ..envs.library import load_library
from ..recognizer import Recognizer, pose_difference
from .bench_report import Case, Row, Section, Settings, draw_cases, noise_of, steps, timed
from .icp_baseline import MultiStartIcp

ROWS = tuple((name, n) for name in ("housing", "complex-hand", "stapler") for n in (8, 12, 16))
"""Objects and numbers of contacts."""
PI_OVER, INCHES = 10, 0.05
NEAR_ROTATION = np.radians(6.0)
NEAR_TRANSLATION = 0.03
"""How near the truth (radians; share of the diameter) a pose is right: three times what the noise
makes of a fit to the right faces, most of the time (2 degrees and 1 %, at 12 contacts)."""


def measure_icp(settings: Settings) -> Section:
    """Time a fit, and how often the first answer is right, for both."""
    models = {model.name: model for model in load_library()}
    noise = noise_of(PI_OVER, INCHES)
    rows = []
    for name, touches in ROWS:
        model = models[name]
        recognizer = Recognizer([model])
        icp = MultiStartIcp(
            model, position_error=noise.position_error, normal_error=noise.normal_error
        )
        cases = draw_cases([model], noise, (touches, touches), settings)
        icp.fit(cases[0].contacts)
        recognizer.recognize(cases[0].contacts)
        theirs, ours, first, kept, rival = [], [], [], [], []
        for case in steps(cases, f"ICP: {name}, {touches}"):
            fit, spent = timed(icp.fit, case.contacts)
            theirs.append(spent)
            rival.append(_is_right(case, fit.pose))
            belief, spent = timed(recognizer.recognize, case.contacts)
            ours.append(spent)
            first.append(bool(belief.hypotheses) and _is_right(case, belief.hypotheses[0].pose))
            kept.append(
                any(
                    (hypothesis.interpretations == case.truth.faces).all(axis=1).any()
                    for hypothesis in belief.hypotheses
                )
            )
        rows.append(_row(f"{name}, {touches} contacts", ours, theirs, [first, kept, rival]))
    return Section(
        f"beside ICP from 60 starts on samples with normals, one object, π/{PI_OVER}, {INCHES} in",
        rows,
        "Median milliseconds, and how often the first answer is right: within 6° and 3 % of the"
        " diameter, up to symmetry. Where several poses fit, no method can know; ICP gives one"
        " pose and can't tell.",
    )


def _row(
    what: str, ours: Sequence[float], theirs: Sequence[float], rights: Sequence[Sequence[bool]]
) -> Row:
    own, other = 1e3 * float(np.median(ours)), 1e3 * float(np.median(theirs))
    first, kept, rival = (float(np.mean(right)) for right in rights)
    faster = f"{other / own:.1f} times faster" if own < other else f"{own / other:.1f} times slower"
    return Row(
        what,
        f"{own:.1f} ms, {first:.1%}",
        f"ICP {other:.1f} ms, {rival:.1%}",
        details=[f"{faster}; the truth is held in {kept:.1%}"],
    )


def _is_right(case: Case, pose: RigidTransform) -> bool:
    off = pose_difference(case.model, pose, case.truth.T_world_object)
    return bool(
        off.rotation < NEAR_ROTATION and off.translation < NEAR_TRANSLATION * case.model.diameter
    )
