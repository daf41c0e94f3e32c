"""What a single model costs: range tables of the stand-ins, and models of 500 faces."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ....envs.library import load_library
from ....recognizer import PairTables, Polyhedron, Recognizer
from ...memo.noise import noise_of
from ...timed import timed
from ..random_library import large_solids
from .report import Row, Section, Settings, draw_cases, median_and_tail, steps

TABLES_GOAL = 20.0
RECOGNISE_GOAL = 50.0
"""For a model of 500 faces: seconds to its tables, milliseconds to a belief."""
TOUCHES = 16
LARGE_BOUNDS = {"bumpy-hull": (60, 0.01), "studded-block": (10, 0.05)}
"""Bounds for the models of 500 faces: pi over a number, and inches. Neighbours on the bumpy hull
differ by some 9 degrees: with normals known to 18 a contact fits ten of them, and interpretations
have no end."""


def measure_tables(settings: Settings) -> Section:
    """Seconds to build the range tables of each stand-in."""
    del settings
    rows = []
    for model in load_library():
        PairTables.of(model)
        spent = min(timed(PairTables.of, model)[1] for _ in range(3))
        rows.append(Row(f"{model.name}, {model.face_count} faces", f"{1e3 * spent:.0f} ms"))
    return Section("range tables, once a model", rows)


def measure_large(settings: Settings) -> Section:
    """Tables and beliefs of models of 500 faces."""
    few = replace(settings, cases=max(settings.cases // 4, 3))
    solids = large_solids(np.random.default_rng(settings.seed))
    rows = [row for model in solids for row in _large_rows(model, few)]
    title = f"models of 500 faces, {TOUCHES} grid contacts, median / 99th percentile of {few.cases}"
    return Section(title, rows, "The goal is the median's.")


def _large_rows(model: Polyhedron, settings: Settings) -> list[Row]:
    _, table_seconds = timed(PairTables.of, model)
    recognizer = Recognizer([model])
    pi_over, inches = LARGE_BOUNDS[model.name]
    cases = draw_cases([model], noise_of(pi_over, inches), (TOUCHES, TOUCHES), settings)
    recognizer.recognize(cases[0].contacts)
    seconds, complete, held = [], 0, 0
    for case in steps(cases, model.name):
        belief, spent = timed(recognizer.recognize, case.contacts)
        seconds.append(spent)
        complete += belief.complete
        held += case.held_by(belief)
    median, tail = median_and_tail(seconds)
    told = f"complete {complete} of {len(cases)}, the truth held in {held}"
    return [
        Row(
            f"{model.name}, {model.face_count} faces: tables",
            f"{table_seconds:.1f} s",
            f"{TABLES_GOAL:g} s",
            table_seconds <= TABLES_GOAL,
        ),
        Row(
            f"  a belief, π/{pi_over}, {inches} in",
            f"{median:.1f} / {tail:.1f} ms",
            f"{RECOGNISE_GOAL:g} ms",
            median <= RECOGNISE_GOAL,
            [told],
        ),
    ]
