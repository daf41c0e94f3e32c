"""Collision parts that are told, where no decomposition is wanted."""

from __future__ import annotations

import numpy as np
import trimesh

from palpate.assets import ConvexPart
from palpate.envs.collision.collision import CollisionParts


def parts_of(*meshes: trimesh.Trimesh) -> CollisionParts:
    """Convex meshes as the parts of an object, taken for exact."""
    parts = (ConvexPart(np.array(m.vertices), np.array(m.faces, np.int64)) for m in meshes)
    return CollisionParts(tuple(parts), 0.0)
