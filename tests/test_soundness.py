"""The promise: with noise inside its bounds, the true interpretation is never lost.

Over the rows of the memo's Table II (Section 4.3): an object and bounds on normals and positions.
The long campaign is `make soundness`.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from sensing import INCH, feel, sense_grid

from palpate.assets import mesh_path
from palpate.recognizer import PairTables, Polyhedron
from palpate.recognizer.pose import ModelTest
from palpate.recognizer.tree import prune

ROWS = [
    (name, parts, inches)
    for name, cones, balls in (
        ("housing", (15, 10, 8), (0.01, 0.05, 0.10)),
        ("simple-hand", (12, 10, 8), (0.01, 0.05)),
        ("stapler", (12, 10), (0.01, 0.05)),
        ("complex-hand", (12, 10), (0.01, 0.05)),
    )
    for parts in cones
    for inches in balls
]
"""Object, bound on normals as a part of pi, bound on positions in inches."""

every_row = pytest.mark.parametrize(
    "row", ROWS, ids=lambda row: f"{row[0]}-pi:{row[1]}-{row[2]:.2f}in"
)


@cache
def prepared(name: str) -> tuple[Polyhedron, PairTables, ModelTest]:
    model = Polyhedron.from_mesh(mesh_path(name), name=name)
    return model, PairTables.of(model), ModelTest(model)


def lost(row: tuple[str, int, float], seed: int, cases: int, tested: int) -> list[str]:
    """Cases in which the truth didn't survive the tree or, in the first ones, the model test."""
    name, parts, inches = row
    model, tables, test = prepared(name)
    rng = np.random.default_rng([seed, ROWS.index(row)])
    found = []
    for case in range(cases):
        touches = sense_grid(model, rng)
        contacts = feel(touches, rng, inches * INCH, np.pi / parts, at_bounds=case % 3 == 0)
        pruned = prune(tables, contacts)
        assert pruned.complete
        if not (pruned.faces == touches.faces).all(axis=1).any():
            found.append(f"case {case}: pruned")
        if case < tested and not len(test.run(touches.faces[None], contacts)):
            found.append(f"case {case}: rejected")
    return found


def test_there_are_as_many_rows_as_the_memo_prints() -> None:
    assert len(ROWS) == len(set(ROWS)) == 23


@every_row
def test_the_truth_survives_tree_and_model_test(row: tuple[str, int, float]) -> None:
    assert lost(row, seed=1, cases=40, tested=40) == []


@pytest.mark.slow
@every_row
def test_the_truth_survives_in_two_thousand_cases(row: tuple[str, int, float]) -> None:
    assert lost(row, seed=2, cases=2000, tested=200) == []
