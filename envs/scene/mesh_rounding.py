"""How far a compiled scene is off its object: MuJoCo keeps meshes in single precision."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ...assets import ConvexPart
from ...recognizer import Polyhedron

Floats = NDArray[np.float64]


def _crosses(corners: Floats) -> Floats:
    """(t, 3) normals of triangles (t, 3, 3), twice as long as their areas."""
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


def _unit_crosses(corners: Floats) -> Floats:
    """(t, 3) unit normals of triangles (t, 3, 3); zero for one without an area."""
    crosses = _crosses(corners)
    sizes = np.linalg.norm(crosses, axis=1, keepdims=True)
    return crosses / np.where(sizes > 0.0, sizes, 1.0)


def mesh_leaning(mj_model: mujoco.MjModel, model: Polyhedron) -> float:
    """How far the normals that rays meet are off the faces' own, radians.

    Pi where the compiled triangles are not the model's any more.
    """
    geom = mj_model.geom("object").id
    mesh = mj_model.geom_dataid[geom]
    first, count = mj_model.mesh_faceadr[mesh], mj_model.mesh_facenum[mesh]
    triangles = mj_model.mesh_face[first : first + count]
    if not np.array_equal(triangles, model.triangles):
        return np.pi
    first, count = mj_model.mesh_vertadr[mesh], mj_model.mesh_vertnum[mesh]
    vertices = mj_model.mesh_vert[first : first + count].astype(np.float64)
    turn = Rotation.from_quat(mj_model.geom_quat[geom], scalar_first=True)
    normals = turn.apply(_unit_crosses(vertices[triangles]))
    off = np.linalg.norm(normals - model.normals[model.triangle_faces], axis=1)
    return float(2.0 * np.arcsin(np.minimum(off / 2.0, 1.0)).max())


def reach(mj_model: mujoco.MjModel, geom: int) -> float:
    """The radius of a ball around a mesh geom's own origin that holds it, metres."""
    mesh = mj_model.geom_dataid[geom]
    first, count = mj_model.mesh_vertadr[mesh], mj_model.mesh_vertnum[mesh]
    lengths = np.linalg.norm(mj_model.mesh_vert[first : first + count].astype(np.float64), axis=1)
    return float(lengths.max()) * (1.0 + 1e-9)


def narrowest_face(model: Polyhedron) -> float:
    """The least width of a face, metres; of each face that of its widest triangle counts."""
    corners = model.vertices[model.triangles]
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    widths = np.zeros(model.face_count)
    doubled_areas = np.linalg.norm(_crosses(corners), axis=1)
    np.maximum.at(widths, model.triangle_faces, doubled_areas / sides.max(axis=1))
    return float(widths.min())


def part_leaning(mj_model: mujoco.MjModel, geom: int, part: ConvexPart) -> float:
    """How far the faces of a compiled convex part are off its own, radians."""
    mesh = mj_model.geom_dataid[geom]
    first, count = mj_model.mesh_polyadr[mesh], mj_model.mesh_polynum[mesh]
    turn = Rotation.from_quat(mj_model.geom_quat[geom], scalar_first=True)
    compiled = turn.apply(mj_model.mesh_polynormal[first : first + count])
    own = _unit_crosses(part.vertices[part.triangles])
    off = np.linalg.norm(compiled[:, None] - own[None], axis=2).min(axis=1)
    return float(2.0 * np.arcsin(np.minimum(off / 2.0, 1.0)).max())
