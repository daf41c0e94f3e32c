"""How the recogniser grows: a large library, and time a model against the number of contacts."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from time import perf_counter

import numpy as np

from ....recognizer import Polyhedron, Recognizer
from ....recognizer.tables.table_cache import cached_tables, table_key
from ...memo.noise import noise_of
from ...timed import timed
from ..random_library import draw_solids
from .report import Row, Section, Settings, draw_cases, steps
from .speed import shares

GOAL = 1.0
"""Seconds to a belief, over the whole library."""
TOUCHES = 12
GROWING = (4, 8, 12, 16)
"""Contacts, by which time a model is measured."""
SHARED_OUT = 100
"""Models over which it is measured, the first of the library."""
CASES_SHARE = 10
"""What the number of cases is divided by."""
SLACK = 1.1
"""From one number of contacts to the next, time a model may rise by this much and count as the
same."""
PI_OVER, INCHES = 10, 0.05


def measure_scale(settings: Settings) -> Section:
    """A large library: its tables, a belief over it, and time a model."""
    few = replace(settings, cases=max(settings.cases // CASES_SHARE, 2))
    rng = np.random.default_rng(settings.seed)
    solids = draw_solids(settings.library, rng)
    models = [next(solids) for _ in steps(range(settings.library), "random solids")]
    with tempfile.TemporaryDirectory() as temporary:
        folder = settings.folder or Path(temporary)
        rows = _table_rows(models, folder)
        rows += _library_rows(models, folder, few, rng)
        rows += _growth_rows(models[:SHARED_OUT], folder, few)
    return Section(
        f"scale, random solids, grid contacts, π/{PI_OVER}, {INCHES} in",
        rows,
        f"A belief is one call over all models, of {few.cases} cases; the first of all calls, which"
        " prepares what is left to prepare, counts. Time a model is the median"
        f" over {max(few.cases // 2, 2)} cases and over {SHARED_OUT} models, from a call over all"
        " of these; the fewer contacts are some of the more, in random order. It counts as not"
        f" risen if no step rises by more than {SLACK - 1.0:.0%}.",
    )


def _table_rows(models: Sequence[Polyhedron], folder: Path) -> list[Row]:
    missing = [model for model in models if not (folder / f"{table_key(model)}.tables").exists()]
    rows = []
    if missing:
        built = [timed(cached_tables, model, folder)[1] for model in steps(missing, "range tables")]
        rows.append(Row(f"tables of {len(missing)} models, built", f"{sum(built):.1f} s"))
    read = sum(timed(cached_tables, model, folder)[1] for model in models)
    rows.append(Row(f"tables of {len(models)} models, read", f"{read:.2f} s"))
    return rows


def _library_rows(
    models: Sequence[Polyhedron], folder: Path, settings: Settings, rng: np.random.Generator
) -> list[Row]:
    recognizer, prepared = timed(Recognizer, models, cache=folder)
    touched = [models[index] for index in rng.integers(len(models), size=settings.cases)]
    cases = draw_cases(touched, noise_of(PI_OVER, INCHES), (TOUCHES, TOUCHES), settings)
    seconds, beliefs, by_the_clock, held = [], [], 0.0, 0
    for case in steps(cases, f"{len(models)} models"):
        started = perf_counter()
        belief, spent = timed(recognizer.recognize, case.contacts)
        by_the_clock += perf_counter() - started
        seconds.append(spent)
        beliefs.append(belief)
        held += case.held_by(belief)
    left = [len({h.object_name for h in belief.hypotheses}) for belief in beliefs]
    searched = [sum(s.nodes > 0 for s in belief.searches) for belief in beliefs]
    within = sum(spent <= GOAL for spent in seconds)
    faces = [model.face_count for model in models]
    return [
        Row(
            f"{len(models)} models, {min(faces)} to {max(faces)} faces: prepared",
            f"{prepared:.1f} s",
        ),
        Row(
            f"  {TOUCHES} contacts to a belief, median / worst",
            f"{np.median(seconds):.2f} / {np.max(seconds):.2f} s",
            f"{GOAL:g} s",
            bool(np.max(seconds) <= GOAL),
            [
                f"within the goal: {within} of {len(cases)}; complete:"
                f" {sum(belief.complete for belief in beliefs)}; mean {np.mean(seconds):.2f} s",
                shares(beliefs, by_the_clock),
                f"models large enough to search {np.median(searched):.0f}, left"
                f" {np.median(left):.0f} (medians); the truth held in {held} of {len(cases)}",
            ],
        ),
    ]


def _growth_rows(models: Sequence[Polyhedron], folder: Path, settings: Settings) -> list[Row]:
    most = max(GROWING)
    rng = np.random.default_rng(settings.seed)
    touched = [models[index] for index in rng.integers(len(models), size=settings.cases)]
    fewer = replace(settings, cases=max(settings.cases // 2, 2))
    cases = draw_cases(touched, noise_of(PI_OVER, INCHES), (most, most), fewer)
    shuffled = [case.contacts[rng.permutation(most)] for case in cases]
    recognizer = Recognizer(models, cache=folder)
    recognizer.recognize(shuffled[0])
    rows, before = [], np.inf
    for touches in GROWING:
        seconds = [
            timed(recognizer.recognize, contacts[np.arange(touches)])[1]
            for contacts in steps(shuffled, f"{touches} contacts")
        ]
        each, mean = (1e3 * value / len(models) for value in (np.median(seconds), np.mean(seconds)))
        rows.append(
            Row(
                f"  time a model, {touches} contacts (mean)",
                f"{each:.3f} ms ({mean:.3f} ms)",
                "not more" if np.isfinite(before) else "",
                bool(each <= SLACK * before) if np.isfinite(before) else None,
            )
        )
        before = each
    return rows
