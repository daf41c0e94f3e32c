"""Compile the strategies' kernels once, so that the first real choice doesn't wait."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from ..recognizer import Polyhedron
from ..recognizer.predict.prediction import samples_of
from ..recognizer.predict.probes import ProbeSpace
from .outcomes.outcomes import Outcomes
from .outcomes.task import Task


def warm_up() -> None:
    """Hold a few probes against two poses of a box."""
    import trimesh

    box = Polyhedron.from_mesh(trimesh.creation.box((1.0, 2.0, 3.0)), name="box")
    task = Task(
        library=(box,),
        space=ProbeSpace(half_width=1.0, reach=8.0),
        position_error=0.01,
        normal_error=0.3,
    )
    turns = Rotation.from_rotvec([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]]).as_quat()
    rows, spread = np.arange(2), np.full(2, 1e-3)
    samples = samples_of(
        (box,), 0 * rows, rows, np.zeros((2, 3)), turns, np.ones(2), spread, spread
    )
    outcomes = Outcomes.of(task, samples, np.zeros((1, 3))).thoroughly(np.arange(1))
    assert outcomes.left.shape == outcomes.distances.shape


PARTS = (warm_up,)
"""What can be compiled independently of all else."""
