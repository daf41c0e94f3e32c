"""How long a fresh process takes: to its first belief, and to the next touch among twenty parts."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path
from time import perf_counter

import numpy as np
import trimesh
from numpy.typing import NDArray

from ....envs.library import load_library
from ...memo.noise import noise_of
from ..random_library import random_library
from .report import Case, Row, Section, Settings, draw_cases, steps

GOAL = 2.0
"""Seconds by the clock."""
PARTS, PARTS_TOUCHES, PARTS_GOAL = 20, 9, 3.0
"""STL files, contacts, and seconds by the clock to what `palpate suggest` says of them."""
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
    """Seconds by the clock of fresh processes: to a first belief, and of `palpate suggest`."""
    with tempfile.TemporaryDirectory() as folder:
        rows = [_first_belief(Path(folder), settings), _twenty_parts(Path(folder), settings)]
    title = f"fresh processes, compiled code at hand, by the clock, medians of {RUNS}"
    return Section(title, rows)


def _first_belief(folder: Path, settings: Settings) -> Row:
    housing = load_library(["housing"])[0]
    case = draw_cases([housing], noise_of(PI_OVER, INCHES), (16, 16), settings)[0]
    np.save(folder / "felt.npy", _columns(case))
    call = [sys.executable, "-c", FRESH, str(folder / "felt.npy")]
    runs = [[whole, *map(float, said.split())] for whole, said in _runs(call, "first belief")]
    whole, *parts = np.median(runs, axis=0)
    told = ", ".join(f"{name} {part:.2f} s" for name, part in zip(STAGES, parts, strict=True))
    return Row(
        "import, housing, its tables, 16 contacts",
        f"{whole:.2f} s",
        f"{GOAL:g} s",
        bool(whole <= GOAL),
        [f"of it: {told}; the rest is Python's own start and end"],
    )


def _twenty_parts(folder: Path, settings: Settings) -> Row:
    models = random_library(PARTS, np.random.default_rng(settings.seed))
    (folder / "parts").mkdir()
    for model in models:
        mesh = trimesh.Trimesh(model.vertices, model.triangles, process=False)
        mesh.export(folder / "parts" / f"{model.name}.stl")
    touches = (PARTS_TOUCHES, PARTS_TOUCHES)
    case = draw_cases(models, noise_of(PI_OVER, INCHES), touches, settings)[0]
    header = "x,y,z,nx,ny,nz,position_error,normal_error"
    np.savetxt(folder / "felt.csv", _columns(case), delimiter=",", header=header, comments="")
    program = "from palpate.scripts.cli import main; main()"
    call = [sys.executable, "-c", program, "suggest", str(folder / "felt.csv")]
    call += ["--library", str(folder / "parts"), "--units", "m"]
    whole = np.median([seconds for seconds, _ in _runs(call, "next touch")])
    return Row(
        f"palpate suggest, {PARTS} parts, {PARTS_TOUCHES} contacts",
        f"{whole:.2f} s",
        f"{PARTS_GOAL:g} s",
        bool(whole <= PARTS_GOAL),
    )


def _columns(case: Case) -> NDArray[np.float64]:
    """(n, 8) positions, normals, and their bounds; metres and radians."""
    felt = case.contacts
    columns = [felt.positions, felt.normals, felt.position_error, felt.normal_error]
    return np.column_stack(columns)


def _runs(call: list[str], what: str) -> list[tuple[float, str]]:
    """Seconds by the clock of some runs of a program, and what each printed."""
    # The first of all may have kernels to compile and tables to build.
    _run(call)
    return [_run(call) for _ in steps(range(RUNS), what)]


def _run(call: list[str]) -> tuple[float, str]:
    started = perf_counter()
    said = subprocess.run(call, check=True, capture_output=True, text=True).stdout
    return perf_counter() - started, said
