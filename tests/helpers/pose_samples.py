"""Samples of poses, made up and taken apart."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import RigidTransform, Rotation

from palpate.recognizer import Polyhedron
from palpate.recognizer.predict.prediction import PoseSamples, samples_of


def pose_of(samples: PoseSamples, row: int) -> RigidTransform:
    """A sample's pose."""
    turn = Rotation.from_quat(samples.rotations[row])
    return RigidTransform.from_components(samples.positions[row], turn)


def samples_at(
    models: Sequence[Polyhedron],
    poses: Sequence[RigidTransform],
    *,
    objects: ArrayLike | None = None,
    hypotheses: ArrayLike | None = None,
    weights: ArrayLike | None = None,
    spread: float = 0.0,
    turn: float = 0.0,
) -> PoseSamples:
    """Samples at poses: by default of the first model, each a hypothesis, and equally likely."""
    count = len(poses)
    return samples_of(
        models,
        np.zeros(count, int) if objects is None else np.asarray(objects),
        np.arange(count) if hypotheses is None else np.asarray(hypotheses),
        np.array([pose.translation for pose in poses]),
        np.array([pose.rotation.as_quat() for pose in poses]),
        np.ones(count) if weights is None else np.asarray(weights, float),
        np.full(count, spread),
        np.full(count, turn),
    )
