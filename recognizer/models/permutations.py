"""Where the symmetries of a model take its features."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from .features import Features
from .polyhedron import Polyhedron
from .prism import Prism


def feature_permutations(
    model: Polyhedron | Prism, features: Features
) -> tuple[NDArray[np.int32], float]:
    """Where the symmetries of a model take its features.

    Args:
        model: the solid, or an outline.
        features: its faces, or its edges and vertices too.

    Returns:
        (g, f) the image of each feature under each symmetry, the identity first; and the farthest,
        metres, that any symmetry takes a corner or a normal, at the model's size, off its image.
    """
    turns, size = model.symmetries, model.diameter
    images = np.empty((len(turns), len(features)), np.int32)
    images[0] = np.arange(len(features))
    if len(turns) == 1:
        return images, 0.0
    places = np.column_stack([features.middles - model.centroid, size * features.normals])
    tree, corners = KDTree(places), KDTree(model.vertices - model.centroid)
    missed = 0.0
    for k, turn in enumerate(turns):
        moved = np.column_stack([places[:, :3] @ turn.T, places[:, 3:] @ turn.T])
        apart, images[k] = tree.query(moved)
        off, _ = corners.query((model.vertices - model.centroid) @ turn.T)
        missed = max(missed, float(np.max(apart)), float(np.max(off)))
    return images, missed
