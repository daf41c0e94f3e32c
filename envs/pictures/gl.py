"""Pictures by MuJoCo's offscreen renderer: ``python -m palpate.envs.pictures.gl``.

A process of its own, started by `renderer.Renderer`: where GL is missing or broken, only this dies.
``MUJOCO_GL`` must be set before the process starts.
"""

from __future__ import annotations

import sys
from multiprocessing.connection import Connection

import mujoco
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from . import view as look
from .marks import Mark, marks
from .picture_scene import PictureScene

__all__ = ["GlPainter", "serve"]

OVERSAMPLING = 2  # software GL may not smooth edges itself
ROUNDNESS = 12, 6  # of lines and balls, which are small; more costs more than all else
MOST_SHAPES = 20_000
GHOST_OPACITY = 0.18
Floats = NDArray[np.float64]
Size = tuple[int, int]


def serve(connection: Connection) -> None:
    """Paint what comes in until the other end hangs up.

    Takes (scene, stage, size) and answers with the picture's bytes, ``(height, width, 3)``; says
    "ready" first.
    """
    connection.send("ready")
    painter = GlPainter()
    while True:
        try:
            scene, stage, size = connection.recv()
        except EOFError:
            return
        connection.send_bytes(painter.paint(scene, stage, size).tobytes())


class GlPainter:
    """Paints scene after scene; what only moves or fades costs no new set-up."""

    def __init__(self) -> None:
        self._key: bytes | None = None

    def paint(self, scene: PictureScene, stage: look.Stage, size: Size) -> NDArray[np.uint8]:
        """The picture without captions, ``(height, width, 3)``."""
        key = _mesh_key(scene, stage.view, size)
        if key != self._key:
            self._set_up(scene, stage.view, size)
            self._key = key
        colours = look.ghost_colours(scene)
        for i, ghost in enumerate(scene.ghosts):
            colour = (*colours[ghost.label], GHOST_OPACITY * ghost.opacity)
            self._model.geom(f"ghost {i}").rgba[:] = colour
        self._renderer.update_scene(self._data, _camera(stage.view))
        target = self._renderer.scene
        target.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = False
        target.flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = False
        _add_plane(target, stage.ruled, 0.0005 * stage.view.radius)
        for mark in marks(scene, stage):
            _add_mark(target, mark)
        return np.asarray(Image.fromarray(self._renderer.render()).reduce(OVERSAMPLING))

    def _set_up(self, scene: PictureScene, view: look.View, size: Size) -> None:
        if self._key is not None:
            self._renderer.close()
            self._key = None
        width, height = (OVERSAMPLING * n for n in size)
        self._model = _compile(scene, view, width, height)
        self._data = mujoco.MjData(self._model)
        mujoco.mj_forward(self._model, self._data)
        self._renderer = mujoco.Renderer(self._model, height, width, max_geom=MOST_SHAPES)


def _mesh_key(scene: PictureScene, view: look.View, size: tuple[int, int]) -> bytes:
    """Differs where the meshes of a scene, their colours, the camera or the picture's size do."""
    meshes = [(scene.object_vertices_world, scene.object_triangles)]
    meshes += [(ghost.vertices_world, ghost.triangles) for ghost in scene.ghosts]
    facts = np.array([*view.numbers, *size, *np.ravel([*look.ghost_colours(scene).values()])])
    arrays = [facts, *(array for mesh in meshes for array in mesh)]
    return b"".join(str(array.shape).encode() + array.tobytes() for array in arrays)


def _compile(scene: PictureScene, view: look.View, width: int, height: int) -> mujoco.MjModel:
    """The meshes, the light and the sky. Everything else is added to the drawn scene alone."""
    spec = mujoco.MjSpec()
    spec.visual.global_.offwidth, spec.visual.global_.offheight = width, height
    spec.visual.global_.fovy = float(np.degrees(look.FIELD_OF_VIEW))
    spec.visual.quality.offsamples = 0  # oversampled already
    spec.visual.quality.numslices, spec.visual.quality.numstacks = ROUNDNESS
    spec.visual.headlight.ambient[:] = 0.52
    spec.visual.headlight.diffuse[:] = 0.16
    spec.visual.headlight.specular[:] = 0.0
    spec.stat.center, spec.stat.extent = view.centre, view.distance
    spec.add_texture(
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=[1.0, 1.0, 1.0],
        rgb2=[0.93, 0.94, 0.95],
        width=256,
        height=256,
    )
    spec.worldbody.add_light(
        type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
        dir=(-view.towards_light).tolist(),
        diffuse=[0.40, 0.40, 0.40],
        specular=[0.05, 0.05, 0.05],
        castshadow=False,
    )
    _add_mesh(spec, "object", scene.object_vertices_world, scene.object_triangles)
    for i, ghost in enumerate(scene.ghosts):
        _add_mesh(spec, f"ghost {i}", ghost.vertices_world, ghost.triangles)
    model = spec.compile()
    model.geom("object").rgba[:] = (*look.OBJECT, 1.0)
    return model


def _add_mesh(
    spec: mujoco.MjSpec, name: str, vertices: Floats, triangles: NDArray[np.int64]
) -> None:
    corners = vertices[triangles]
    faces = list(range(3 * len(triangles)))
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    spec.add_mesh(
        name=name,
        uservert=corners.reshape(-1).tolist(),
        userface=faces,
        # Own normals at every corner, or MuJoCo would round the edges off.
        usernormal=np.repeat(normals, 3, axis=0).reshape(-1).tolist(),
        userfacenormal=faces,
        inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,  # a mesh needs no volume to be drawn
    )
    spec.worldbody.add_geom(
        name=name, type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name, contype=0, conaffinity=0
    )


def _camera(view: look.View) -> mujoco.MjvCamera:
    camera = mujoco.MjvCamera()
    camera.type = mujoco.mjtCamera.mjCAMERA_FREE
    camera.lookat = view.centre
    camera.distance = view.distance
    camera.azimuth = np.degrees(view.azimuth)
    camera.elevation = np.degrees(view.elevation)
    return camera


def _add_plane(target: mujoco.MjvScene, lines: Floats, thickness: float) -> None:
    low, high = lines.min(axis=(0, 1)), lines.max(axis=(0, 1))
    half = (high - low) / 2 + [0, 0, thickness]
    _add(target, mujoco.mjtGeom.mjGEOM_BOX, half, (low + high) / 2, look.PLANE, 0.55)


def _add_mark(target: mujoco.MjvScene, mark: Mark) -> None:
    start, end = mark.ends_world
    kind = mujoco.mjtGeom.mjGEOM_SPHERE
    geom = _add(target, kind, np.full(3, mark.radius), start, mark.colour, mark.opacity)
    if (start == end).all():
        return
    kind = mujoco.mjtGeom.mjGEOM_CAPSULE
    if mark.arrow:
        kind = mujoco.mjtGeom.mjGEOM_ARROW
        end = 2.0 * end - start  # MuJoCo draws an arrow to half of where it says that it ends
    mujoco.mjv_connector(geom, kind, mark.radius, start, end)


def _add(
    target: mujoco.MjvScene,
    kind: mujoco.mjtGeom,
    size: Floats,
    position: Floats,
    colour: look.Colour,
    alpha: float = 1.0,
) -> mujoco.MjvGeom:
    geom = target.geoms[target.ngeom]
    rgba = np.array([*colour, alpha], dtype=np.float32)
    mujoco.mjv_initGeom(geom, kind, size, position, np.eye(3).reshape(-1), rgba)
    geom.specular, geom.emission = 0.0, 0.15  # marks are signs: they need no shading to be read
    target.ngeom += 1
    return geom


if __name__ == "__main__":
    serve(Connection(int(sys.argv[1])))
