"""How long a fresh process takes to its first belief: imports, a model, its tables, the search."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path
from time import perf_counter

import numpy as np

from ..envs.library import load_library
from .bench_report import Row, Section, Settings, draw_cases, noise_of, steps

GOAL = 2.0
"""Seconds by the clock."""
RUNS = 5
PI_OVER, INCHES = 10, 0.05
FRESH = """
from time import perf_counter
times = [perf_counter()]
import sys, numpy as np
from palpate.assets import mesh_path
from palpate.recognizer import Contacts, Polyhedron, Recognizer
times.append(perf_counter())
felt = np.load(sys.argv[1])
recognizer = Recognizer([Polyhedron.from_mesh(mesh_path("housing"))])
times.append(perf_counter())
contacts = Contacts(
    felt[:, :3], felt[:, 3:6], position_error=felt[:, 6], normal_error=felt[:, 7]
)
assert recognizer.recognize(contacts).hypotheses
times.append(perf_counter())
print(*np.diff(times))
"""
"""What each fresh process runs; it prints the seconds of its stages."""
STAGES = ("imports", "model and tables", "first call")


def measure_start(settings: Settings) -> Section:
    """Seconds that a fresh process takes to its first belief."""
    housing = load_library(["housing"])[0]
    case = draw_cases([housing], noise_of(PI_OVER, INCHES), (16, 16), settings)[0]
    felt = case.contacts
    columns = [felt.positions, felt.normals, felt.position_error, felt.normal_error]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "felt.npy"
        np.save(path, np.column_stack(columns))
        # The first of all may have kernels to compile.
        _fresh_process(path)
        runs = [_fresh_process(path) for _ in steps(range(RUNS), "fresh processes")]
    whole, *parts = np.median(runs, axis=0)
    told = ", ".join(f"{name} {part:.2f} s" for name, part in zip(STAGES, parts, strict=True))
    shown = Row(
        "import, housing, its tables, 16 contacts",
        f"{whole:.2f} s",
        f"{GOAL:g} s",
        bool(whole <= GOAL),
        [f"of it: {told}; the rest is Python's own start and end"],
    )
    title = f"first belief of a fresh process, compiled code at hand, by the clock, of {RUNS}"
    return Section(title, [shown])


def _fresh_process(felt: Path) -> list[float]:
    """Seconds of all, and of each stage."""
    started = perf_counter()
    call = [sys.executable, "-c", FRESH, str(felt)]
    said = subprocess.run(call, check=True, capture_output=True, text=True).stdout
    return [perf_counter() - started, *map(float, said.split())]
