"""How the recogniser starts and grows: tables, a fresh process, large libraries and models."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from time import perf_counter

import numpy as np

from ..envs.library import load_library
from ..recognizer import PairTables, Polyhedron, Recognizer
from ..recognizer.table_cache import cached_tables
from .bench_report import Row, Section, Settings, draw_cases, noise_of, steps, timed
from .random_library import large_solids, random_library

TABLES_GOAL = 20.0
RECOGNISE_GOAL = 50.0
"""For a model of 500 faces: seconds to its tables, milliseconds to a belief."""
FRESH_GOAL = 2.0
FRESH_RUNS = 3
LIBRARY_CASES = 5
SHARED_OUT = 100
"""Models of the large library over which time a model is measured."""
PI_OVER, INCHES = 10, 0.05
LARGE_BOUNDS = {"bumpy-hull": (60, 0.01), "studded-block": (PI_OVER, INCHES)}
"""Bounds for the models of 500 faces: pi over a number, and inches. Neighbours on the bumpy hull
differ by some 9 degrees: with normals known to 18 a contact fits ten of them, and interpretations
have no end."""
FRESH = """
import sys, numpy as np
from palpate.assets import mesh_path
from palpate.recognizer import Contacts, Polyhedron, Recognizer
felt = np.load(sys.argv[1])
recognizer = Recognizer([Polyhedron.from_mesh(mesh_path("housing"))])
contacts = Contacts(
    felt[:, :3], felt[:, 3:6], position_error=felt[:, 6], normal_error=felt[:, 7]
)
assert recognizer.recognize(contacts).hypotheses
"""


def measure_tables(settings: Settings) -> Section:
    """Seconds to build the range tables of each stand-in."""
    del settings
    rows = []
    for model in load_library():
        PairTables.of(model)
        spent = min(timed(PairTables.of, model)[1] for _ in range(3))
        rows.append(Row(f"{model.name}, {model.face_count} faces", f"{1e3 * spent:.0f} ms"))
    return Section("range tables, once a model", rows)


def measure_start(settings: Settings) -> Section:
    """Seconds that a fresh process takes to its first belief."""
    housing = next(model for model in load_library() if model.name == "housing")
    case = draw_cases([housing], noise_of(PI_OVER, INCHES), (16, 16), settings)[0]
    felt = case.contacts
    rows = np.column_stack([felt.positions, felt.normals, felt.position_error, felt.normal_error])
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "felt.npy"
        np.save(path, rows)
        call = [sys.executable, "-c", FRESH, str(path)]
        # The first of all may have kernels to compile.
        subprocess.run(call, check=True)
        seconds = []
        for _ in steps(range(FRESH_RUNS), "fresh processes"):
            started = perf_counter()
            subprocess.run(call, check=True)
            seconds.append(perf_counter() - started)
    spent = float(np.median(seconds))
    shown = Row(
        "import, housing, its tables, 16 contacts",
        f"{spent:.2f} s",
        f"{FRESH_GOAL:g} s",
        spent <= FRESH_GOAL,
    )
    return Section("first belief of a fresh process, compiled code at hand, by the clock", [shown])


def measure_scale(settings: Settings) -> Section:
    """A large library, and models of many faces."""
    rng = np.random.default_rng(settings.seed)
    models = random_library(settings.library, rng)
    touched = [models[index] for index in rng.integers(len(models), size=LIBRARY_CASES)]
    few = replace(settings, cases=LIBRARY_CASES)
    rows = [*_cache_rows(models), *_library_rows(models, touched, few)]
    for touches in (4, 8, 12, 16):
        rows.append(_share_row(models[:SHARED_OUT], touched, touches, few))
    for model in large_solids(rng):
        rows += _large_rows(model, replace(settings, cases=max(settings.cases // 10, 3)))
    return Section(f"scale, grid contacts, π/{PI_OVER}, {INCHES} in", rows)


def _library_rows(
    models: Sequence[Polyhedron], touched: Sequence[Polyhedron], settings: Settings
) -> list[Row]:
    faces = [model.face_count for model in models]
    recognizer, prepared = timed(Recognizer, models)
    seconds, left = [], []
    cases = draw_cases(touched, noise_of(PI_OVER, INCHES), (12, 12), settings)
    for case in steps(cases, "a large library"):
        belief, spent = timed(recognizer.recognize, case.contacts)
        seconds.append(spent)
        left.append(len({hypothesis.object_name for hypothesis in belief.hypotheses}))
    label = f"{len(models)} models, {min(faces)} to {max(faces)} faces"
    told = f"{np.max(seconds):.2f} s at most of {len(cases)}; {np.median(left):.0f} models left"
    return [
        Row(f"{label}: prepared", f"{prepared:.1f} s"),
        Row("  12 contacts to a belief", f"{np.median(seconds):.2f} s", details=[told]),
    ]


def _share_row(
    models: Sequence[Polyhedron], touched: Sequence[Polyhedron], touches: int, settings: Settings
) -> Row:
    recognizer = Recognizer(models)
    cases = draw_cases(touched, noise_of(PI_OVER, INCHES), (touches, touches), settings)
    recognizer.recognize(cases[0].contacts)
    seconds = [
        timed(recognizer.recognize, case.contacts)[1]
        for case in steps(cases, f"{touches} contacts")
    ]
    each = 1e3 * np.median(seconds) / len(models)
    return Row(f"  a model, {touches} contacts", f"{each:.3f} ms")


def _cache_rows(models: Sequence[Polyhedron]) -> list[Row]:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        built = sum(
            timed(cached_tables, model, folder)[1] for model in steps(models, "range tables")
        )
        read = timed(lambda: [cached_tables(model, folder) for model in models])[1]
    return [
        Row(f"tables of {len(models)} models, built", f"{built:.1f} s"),
        Row("  read from disk", f"{read:.2f} s"),
    ]


def _large_rows(model: Polyhedron, settings: Settings) -> list[Row]:
    _, table_seconds = timed(PairTables.of, model)
    recognizer = Recognizer([model])
    pi_over, inches = LARGE_BOUNDS[model.name]
    cases = draw_cases([model], noise_of(pi_over, inches), (16, 16), settings)
    recognizer.recognize(cases[0].contacts)
    spent = 1e3 * float(
        np.median(
            [timed(recognizer.recognize, case.contacts)[1] for case in steps(cases, model.name)]
        )
    )
    label = f"{model.name}, {model.face_count} faces"
    return [
        Row(
            f"{label}: tables",
            f"{table_seconds:.1f} s",
            f"{TABLES_GOAL:g} s",
            table_seconds <= TABLES_GOAL,
        ),
        Row(
            f"  16 contacts, π/{pi_over}, {inches} in",
            f"{spent:.1f} ms",
            f"{RECOGNISE_GOAL:g} ms",
            spent <= RECOGNISE_GOAL,
        ),
    ]
