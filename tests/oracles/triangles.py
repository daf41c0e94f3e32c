"""Triangles between three contacts or three faces: angles, areas, and triples to look at."""

from __future__ import annotations

import itertools

import numpy as np
from oracles.solids import Floats


def triangle(p: Floats, q: Floats, r: Floats) -> tuple[Floats, Floats]:
    """(..., 3) angles at p, q and r, and (...) areas; not a number where points coincide."""
    angles = []
    for apex, one, other in ((p, q, r), (q, r, p), (r, p, q)):
        u, w = one - apex, other - apex
        with np.errstate(invalid="ignore", divide="ignore"):
            u = u / np.linalg.norm(u, axis=-1, keepdims=True)
            w = w / np.linalg.norm(w, axis=-1, keepdims=True)
        angles.append(
            2.0 * np.arctan2(np.linalg.norm(u - w, axis=-1), np.linalg.norm(u + w, axis=-1))
        )
    return np.stack(angles, axis=-1), np.linalg.norm(np.cross(q - p, r - p), axis=-1) / 2.0


def some_triples(faces: int, most: int, rng: np.random.Generator) -> np.ndarray:
    every = np.array(list(itertools.combinations_with_replacement(range(faces), 3)))
    return rng.permuted(rng.permutation(every)[:most], axis=1)
