"""How well poses agree with the paths that rays took, even where that is no evidence."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...recognizer.predict.prediction import MET_OBJECT, PoseSamples, predict
from ...recognizer.predict.probes import TriadRays
from .task import Observation, Task

Floats = NDArray[np.float64]

CONTRADICTED = 0.1
"""What a ray that went through where a pose has the object leaves of its probability; not zero, as
a sample stands for poses around it."""
LEAST = 1e-3
"""What all of them leave at least."""
DEVIATIONS = 3.0
"""How many standard deviations of its pose a sample is allowed for."""


def agreement(task: Task, observation: Observation, samples: PoseSamples) -> Floats:
    """(s,) how likely the paths of the rays so far are, by each pose: 1 if none runs into it.

    The recogniser may not be told of free space, and then keeps rivals that a ray went right
    through; they have to be ruled out by contacts still, but they are hardly the truth.
    """
    sent = int(observation["ray_count"][0])
    if not sent:
        return np.ones(len(samples))
    starts = np.asarray(observation["ray_starts"][:sent], np.float64)
    ways = np.asarray(observation["ray_ends"][:sent], np.float64) - starts
    lengths = np.linalg.norm(ways, axis=1)
    going = lengths > 0.0
    starts, ways, lengths = starts[going], ways[going], lengths[going]
    directions = ways / lengths[:, None]
    falling = directions[:, 2] < -1e-9  # the predictor's rays end on the plane
    starts, directions, lengths = starts[falling], directions[falling], lengths[falling]
    # The predictor casts rays by threes; the last one fills up.
    rows = np.minimum(np.arange(-(-len(lengths) // 3) * 3), len(lengths) - 1).reshape(-1, 3)
    told = predict(samples, TriadRays(starts[rows], directions[rows]), radius=task.radius)
    slopes = np.abs(np.einsum("sakx,akx->sak", told.normals_world, directions[rows]))
    slack = 2.0 * task.position_error / np.maximum(slopes, 1e-3) + DEVIATIONS * told.depth_spread
    through = (told.outcomes == MET_OBJECT) & (told.depths + slack < lengths[rows])
    flat = through.reshape(len(samples), -1)[:, : len(lengths)]
    return np.maximum(CONTRADICTED ** flat.sum(axis=1), LEAST)
