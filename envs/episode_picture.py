"""The picture of an episode: what was touched, and the rivals that the touches ruled out."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..recognizer import Hypothesis
from .picture import Ghost, PictureScene
from .probe_env import ProbeEnv
from .scene import OBJECT

RAY_LENGTH = 1.2
"""How much of each ray is drawn, in diameters of the object; all of it would dwarf the object."""


def episode_picture(
    env: ProbeEnv, rivals: Sequence[tuple[Hypothesis, str]], title: str, subtitle: str
) -> PictureScene:
    """What an episode looks like at its end.

    Args:
        env: the environment after its last step.
        rivals: hypotheses to show as ghosts, each with its line in the legend.
        title: one line, large.
        subtitle: one line below it.
    """
    models = {model.name: model for model in env.library}
    truth, pose = env.true_object, env.T_world_object
    ghosts = tuple(
        Ghost(
            hypothesis.pose.apply(models[hypothesis.object_name].vertices),
            models[hypothesis.object_name].triangles,
            label,
        )
        for hypothesis, label in rivals
    )
    rays = [
        _shortened(touch.starts_world, touch.ends_world, RAY_LENGTH * truth.diameter)
        for touch in env.touches
    ]
    return PictureScene(
        object_vertices_world=pose.apply(truth.vertices),
        object_triangles=truth.triangles,
        object_edges_world=pose.apply(truth.edges.reshape(-1, 3)).reshape(-1, 2, 3),
        rays_world=np.concatenate([np.zeros((0, 2, 3)), *rays]),
        ray_hits=np.concatenate(
            [np.zeros(0, bool), *(touch.outcomes == OBJECT for touch in env.touches)]
        ),
        contacts_world=env.contacts.positions,
        normals_world=env.contacts.normals,
        ghosts=ghosts,
        title=title,
        subtitle=subtitle,
    )


def _shortened(
    starts: NDArray[np.float64], ends: NDArray[np.float64], length: float
) -> NDArray[np.float64]:
    """(r, 2, 3) the last ``length`` metres of each segment."""
    along = ends - starts
    whole = np.linalg.norm(along, axis=1, keepdims=True)
    return np.stack([ends - along * np.minimum(1.0, length / whole), ends], axis=1)
