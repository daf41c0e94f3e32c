"""The recogniser beside multi-start ICP, our own and small_gicp's, on the same contacts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import RigidTransform

from ....envs.library import load_library
from ....recognizer import Recognizer, pose_difference
from ...memo.noise import noise_of
from ...timed import timed
from .gicp_baseline import SmallGicp
from .icp_baseline import STARTS, MultiStartIcp
from .report import Case, Row, Section, Settings, draw_cases, steps
from .speed import GOALS, TOUCHES


@dataclass(frozen=True)
class Setting:
    """An object, bounds, how often it is touched, and whether the goal is meant for it."""

    name: str
    pi_over: float
    """The bound on normals is pi over this, radians."""
    inches: float
    """The bound on positions."""
    touches: int
    counts: bool = False


SETTINGS = (
    *(
        Setting(goal.names[0], goal.pi_over, goal.inches, TOUCHES, True)
        for goal in GOALS
        if len(goal.names) == 1
    ),
    *(
        Setting(name, 10, 0.05, touches)
        for name in ("housing", "complex-hand", "stapler")
        for touches in (8, 12)
    ),
)
"""First the cases of the speed goals, then fewer contacts."""
TIMES_FASTER = 25.0
"""The goal, at a higher rate of right first answers."""
NEAR_ROTATION = np.radians(6.0)
NEAR_TRANSLATION = 0.03
"""How near the truth (radians; share of the diameter) a pose is right: three times what the noise
makes of a fit to the right faces, most of the time (2 degrees and 1 %, at 12 contacts)."""


def measure_icp(settings: Settings) -> Section:
    """Time a fit, and how often the first answer is right, for each."""
    return Section(
        f"beside ICP (ours, small_gicp) from {STARTS} starts on samples with normals, one object",
        [_setting_row(setting, settings) for setting in SETTINGS],
        "How many times faster (medians), and how often the first answer is right: within 6° and"
        f" 3 % of the diameter, up to symmetry. The goal is for {TOUCHES} contacts; its rate is"
        " that of our own ICP. Where several poses fit, no method can know; ICP gives one pose and"
        " can't tell.",
    )


def _setting_row(setting: Setting, settings: Settings) -> Row:
    (model,) = load_library([setting.name])
    noise = noise_of(setting.pi_over, setting.inches)
    bounds = {"position_error": noise.position_error, "normal_error": noise.normal_error}
    recognizer = Recognizer([model])
    icp, gicp = MultiStartIcp(model, **bounds), SmallGicp(model, **bounds)
    cases = draw_cases([model], noise, (setting.touches, setting.touches), settings)
    for find in (icp.fit, gicp.fit, recognizer.recognize):
        find(cases[0].contacts)
    theirs, public, ours, first, kept, rival, right = ([] for _ in range(7))
    for case in steps(cases, f"ICP: {setting.name}, {setting.touches}"):
        fit, spent = timed(icp.fit, case.contacts)
        theirs.append(spent)
        rival.append(_is_right(case, fit.pose))
        fit, spent = timed(gicp.fit, case.contacts)
        public.append(spent)
        right.append(_is_right(case, fit.pose))
        belief, spent = timed(recognizer.recognize, case.contacts)
        ours.append(spent)
        first.append(bool(belief.hypotheses) and _is_right(case, belief.hypotheses[0].pose))
        kept.append(case.held_by(belief))
    row = _row(setting, ours, theirs, [first, kept, rival])
    told = f"small_gicp {1e3 * np.median(public):.1f} ms, {np.mean(right):.1%}"
    return replace(row, details=[*row.details, told])


def _row(
    setting: Setting,
    ours: Sequence[float],
    theirs: Sequence[float],
    rights: Sequence[Sequence[bool]],
) -> Row:
    own, other = 1e3 * float(np.median(ours)), 1e3 * float(np.median(theirs))
    first, kept, rival = (float(np.mean(right)) for right in rights)
    return Row(
        f"{setting.name}, π/{setting.pi_over}, {setting.inches:.2f} in, {setting.touches} contacts",
        f"{other / own:.1f} times, {first:.1%}",
        f"{TIMES_FASTER:g} times, > {rival:.1%}" if setting.counts else "",
        other >= TIMES_FASTER * own and first > rival if setting.counts else None,
        [f"{own:.1f} ms; ICP {other:.1f} ms, {rival:.1%}; the truth is held in {kept:.1%}"],
    )


def _is_right(case: Case, pose: RigidTransform) -> bool:
    off = pose_difference(case.model, pose, case.truth.T_world_object)
    return bool(
        off.rotation < NEAR_ROTATION and off.translation < NEAR_TRANSLATION * case.model.diameter
    )
