"""The picture of an episode: what was touched, and the rivals that the touches ruled out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import RigidTransform

from ...recognizer import Contacts, Hypothesis, Polyhedron
from ..scene.scene import OBJECT
from ..sensors.touch import Touch
from .episode import Episode
from .picture_scene import Ghost, PictureScene
from .rivals import Likeness, ghost_of, leading_rivals

__all__ = [
    "bare_scene",
    "episode_picture",
    "episode_so_far",
    "last_stretch",
    "likeness_of",
]

Floats = NDArray[np.float64]

RAY_LENGTH = 1.2
"""How much of each ray is drawn, in diameters of the object; all of it would dwarf the object."""
MOST_RIVALS = 3
"""More of them in one picture hide each other."""
FEW_RAYS = 12
"""Up to which a probe's rays are drawn whole; of more only the ends where nothing was touched."""


def episode_picture(
    episode: Episode, rivals: Sequence[tuple[Hypothesis, str]], title: str, subtitle: str
) -> PictureScene:
    """What an episode looks like at its end.

    Args:
        episode: as it stands after the last probe.
        rivals: hypotheses to show as ghosts, each with its line in the legend.
        title: one line, large.
        subtitle: one line below it.
    """
    models = likeness_of(episode).library
    ghosts = [ghost_of(hypothesis, models, label) for hypothesis, label in rivals]
    length = RAY_LENGTH * episode.true_object.diameter
    scene = _with_rays(_scene(episode, ghosts), episode.touches, length)
    return replace(scene, title=title, subtitle=subtitle)


def episode_so_far(episode: Episode) -> PictureScene:
    """What an episode looks like on the way: the last probe, all contacts, the leading rivals."""
    likeness = likeness_of(episode)
    truth = episode.true_object.name, episode.T_world_object
    rivals = leading_rivals(episode.belief, likeness, truth, MOST_RIVALS)
    ghosts = [ghost_of(rival, likeness.library, rival.object_name) for rival in rivals]
    many = bool(episode.touches) and len(episode.touches[-1].outcomes) > FEW_RAYS
    length = (0.05 if many else RAY_LENGTH) * episode.true_object.diameter
    scene = _with_rays(_scene(episode, ghosts), episode.touches[-1:], length)
    if many:
        missed = ~scene.ray_hits
        rays = {"rays_world": scene.rays_world[missed], "ray_hits": scene.ray_hits[missed]}
        scene = replace(scene, **rays)
    return scene


def likeness_of(episode: Episode) -> Likeness:
    """Tells which hypotheses of an episode look the same."""
    return Likeness(
        {model.name: model for model in episode.library},
        episode.tolerance,
        float(episode.contacts.position_error.max(initial=0.0)),
    )


def bare_scene(
    model: Polyhedron, pose: RigidTransform, contacts: Contacts, ghosts: Sequence[Ghost] = ()
) -> PictureScene:
    """An object at a pose, model to world, with what was felt of it; no rays."""
    known = contacts.normal_error < np.pi
    return PictureScene(
        object_vertices_world=pose.apply(model.vertices),
        object_triangles=model.triangles,
        object_edges_world=pose.apply(model.edges.reshape(-1, 3)).reshape(-1, 2, 3),
        rays_world=np.zeros((0, 2, 3)),
        ray_hits=np.zeros(0, bool),
        contacts_world=contacts.positions,
        normals_world=np.where(known[:, None], contacts.normals, 0.0),
        ghosts=tuple(ghosts),
    )


def last_stretch(touch: Touch, length: float) -> Floats:
    """(r, 2, 3) the last ``length`` metres of each ray of a probe."""
    along = touch.ends_world - touch.starts_world
    whole = np.linalg.norm(along, axis=1, keepdims=True)
    short = along * np.minimum(1.0, length / np.maximum(whole, 1e-12))
    return np.stack([touch.ends_world - short, touch.ends_world], axis=1)


def _scene(episode: Episode, ghosts: Sequence[Ghost]) -> PictureScene:
    return bare_scene(episode.true_object, episode.T_world_object, episode.contacts, ghosts)


def _with_rays(scene: PictureScene, touches: Sequence[Touch], length: float) -> PictureScene:
    rays = [last_stretch(touch, length) for touch in touches]
    hits = [touch.outcomes == OBJECT for touch in touches]
    return replace(
        scene,
        rays_world=np.concatenate([np.zeros((0, 2, 3)), *rays]),
        ray_hits=np.concatenate([np.zeros(0, bool), *hits]),
    )
