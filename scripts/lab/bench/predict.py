"""How long predictions take, and the samples that they are made for."""

from __future__ import annotations

import numpy as np

from ....envs.library import load_library
from ....envs.probe_env import HALF_WIDTH, REACH
from ....envs.scene.placement import make_placement
from ....recognizer import Polyhedron, Recognizer
from ....recognizer.predict.pose_samples import sample_belief
from ....recognizer.predict.prediction import PoseSamples, predict
from ....recognizer.predict.probes import ProbeSpace
from ...memo.noise import noise_of
from ...timed import timed
from .report import Row, Section, Settings, draw_cases, median_and_tail, steps

Library = tuple[Polyhedron, ...]

POSES, TRIADS = 200, 500
GOAL = 50.0
"""Milliseconds for so many triads at so many poses."""
TOUCHES = (1, 3, 6)
FELT = (8, 12)
"""Contacts of a grid, of which the first are taken."""
SHOWN = 256
"""Samples of a belief."""
FEWER = 10
"""What the number of cases is divided by: one takes as long as many recognitions."""


def measure_predict(settings: Settings) -> Section:
    """Predictions at random poses, and samples of beliefs."""
    library = load_library()
    return Section(
        f"predictions, {POSES} poses x {TRIADS} triads, median / 99th percentile",
        [
            *(_predict_row((model,), settings) for model in library),
            _predict_row(library, settings),
            *(_sample_row(library, touches, settings) for touches in TOUCHES),
        ],
        f"Poses and triads as an episode has them. Samples: {SHOWN} of a belief about contacts at"
        " pi/8, 0.05 in, spread over its families.",
    )


def _predict_row(library: Library, settings: Settings) -> Row:
    rng = np.random.default_rng(settings.seed)
    largest = max(model.diameter for model in library)
    space = ProbeSpace(HALF_WIDTH * largest, REACH * largest)
    cases = []
    for _ in range(max(settings.cases // FEWER, 1)):
        rays = space.rays(rng.uniform(-1.0, 1.0, (TRIADS, 3)))
        cases.append((_across(library, space, rng), rays))
    predict(*cases[0])
    name = library[0].name if len(library) == 1 else f"{len(library)} objects"
    seconds = [timed(predict, *case)[1] for case in steps(cases, f"predict: {name}")]
    median, tail = median_and_tail(seconds)
    rays = 3 * POSES * TRIADS
    return Row(
        name,
        f"{median:.1f} / {tail:.1f} ms",
        f"{GOAL:g} ms",
        median <= GOAL,
        [f"{1e6 * median / rays:.0f} ns a ray"],
    )


def _across(library: Library, space: ProbeSpace, rng: np.random.Generator) -> PoseSamples:
    """Objects in turn, as an episode places them across the plane."""
    placement = make_placement("across", 0.2 * space.half_width)
    objects = np.arange(POSES) % len(library)
    poses = [placement.draw(rng, library[number]) for number in objects]
    return PoseSamples(
        library,
        objects,
        np.arange(POSES),
        np.array([pose.translation for pose in poses]),
        np.array([pose.rotation.as_quat() for pose in poses]),
        np.full(POSES, 1.0 / POSES),
        np.full(POSES, 0.001),
        np.full(POSES, 0.01),
    )


def _sample_row(library: Library, touches: int, settings: Settings) -> Row:
    recognizer = Recognizer(library)
    fewer = Settings(cases=max(settings.cases // FEWER, 1), seed=settings.seed)
    cases = draw_cases(library, noise_of(8, 0.05), FELT, fewer)
    beliefs = [recognizer.recognize(case.contacts[:touches]) for case in cases]
    sample_belief(beliefs[0], library, SHOWN)
    seconds, hypotheses, shown = [], [], []
    for belief in steps(beliefs, f"samples: {touches} contacts"):
        samples, spent = timed(sample_belief, belief, library, SHOWN)
        seconds.append(spent)
        hypotheses.append(len(belief.hypotheses))
        shown.append(len(samples))
    median, tail = median_and_tail(seconds)
    counts = f"{np.median(hypotheses):.0f} hypotheses, {np.median(shown):.0f} samples, medians"
    contacts = "contact" if touches == 1 else "contacts"
    return Row(
        f"samples after {touches} {contacts}", f"{median:.1f} / {tail:.1f} ms", details=[counts]
    )
