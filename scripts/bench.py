"""Measure the recogniser: `python -m palpate.scripts.bench`, or `make bench`.

Grid contacts on the stand-ins, single core, everything warm.
"""

from __future__ import annotations

from time import perf_counter

import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

from ..envs.grid import sense_grid
from ..envs.library import load_library
from ..envs.probe_env import INCH
from ..envs.sensor import SensorNoise
from ..recognizer import PairTables, Polyhedron, Recognizer, pose_difference
from ..recognizer.tree import prune

CASES = (
    ("housing", 10, 0.01),
    ("housing", 10, 0.05),
    ("housing-34", 10, 0.05),
    ("simple-hand", 10, 0.01),
    ("stapler", 10, 0.01),
    ("complex-hand", 10, 0.01),
    ("complex-hand", 10, 0.05),
)
TRIALS = 200


def main() -> None:
    """Print the tables."""
    console = Console()
    models = {model.name: model for model in load_library()}
    console.print("Range tables, once a model:")
    for model in models.values():
        started = perf_counter()
        PairTables.of(model)
        seconds = perf_counter() - started
        console.print(f"  {model.name:<13}{model.face_count:>3} faces {1e3 * seconds:>6.0f} ms")
    shown = Table("object", "normal", "dist", "tree", "all", "degrees", "inches", "n", box=None)
    for column in shown.columns:
        column.no_wrap = True
    for column in shown.columns[2:]:
        column.justify = "right"
    for name, pi_over, dist in track(CASES, description="cases", transient=True):
        noise = SensorNoise(position_error=dist * INCH, normal_error=np.pi / pi_over)
        shown.add_row(name, f"π/{pi_over}", f"{dist:.2f}", *_measure(models[name], noise))
    console.print(
        f"\nOne object, 16 grid contacts, {TRIALS} cases. tree: masks and tree, all: contacts to\n"
        "belief, milliseconds, median / 99th percentile. degrees, inches: mean error of the\n"
        "right hypothesis over the n cases whose contacts fix all six freedoms.\n"
    )
    console.print(shown)


def _measure(model: Polyhedron, noise: SensorNoise) -> tuple[str, ...]:
    recognizer = Recognizer([model])
    tables = recognizer.tables(model.name)
    rng = np.random.default_rng(0)
    tree, everything, errors = [], [], []
    for _ in range(TRIALS):
        truth = sense_grid(model, rng, 16, 16)
        contacts = truth.noisy(noise, rng)
        started = perf_counter()
        prune(tables, contacts)
        tree.append(perf_counter() - started)
        started = perf_counter()
        belief = recognizer.recognize(contacts)
        everything.append(perf_counter() - started)
        right = [
            hypothesis
            for hypothesis in belief.hypotheses
            if (hypothesis.interpretations == truth.faces).all(axis=1).any()
        ]
        if right and right[0].determined:
            error = pose_difference(model, right[0].pose, truth.T_world_object)
            errors.append((np.degrees(error.rotation), error.translation / INCH))
    rotation, shift = np.mean(errors, axis=0) if errors else (np.nan, np.nan)
    return (_spread(tree), _spread(everything), f"{rotation:.2f}", f"{shift:.4f}", str(len(errors)))


def _spread(seconds: list[float]) -> str:
    median, tail = 1e3 * np.percentile(seconds, (50, 99))
    return f"{median:.2f} / {tail:.2f}"


if __name__ == "__main__":
    main()
