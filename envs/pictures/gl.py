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
from .picture_scene import PictureScene, Tip

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
        key = look.mesh_key(scene, stage.view, size)
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
        _add_shapes(target, scene, stage)
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
    right, up, back = view.axes
    sun = -(0.75 * up - 0.5 * right + 0.35 * back)
    spec.worldbody.add_light(
        type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
        dir=sun,
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


def _add_shapes(target: mujoco.MjvScene, scene: PictureScene, stage: look.Stage) -> None:
    unit, size = stage.view.radius, look.mark_size(scene)
    _add_plane(target, stage.ruled, 0.0005 * unit)
    for line in stage.ruled:
        _add_line(target, line, 0.0015 * unit, look.GRID)
    for edge in scene.object_edges_world:
        _add_line(target, edge, 0.0035 * unit, look.EDGE)
    colours = look.ghost_colours(scene)
    for ghost in scene.ghosts:
        colour = colours[ghost.label]
        for edge in look.sharp_edges(ghost.vertices_world, ghost.triangles):
            _add_line(target, edge, 0.0025 * unit, colour, alpha=ghost.opacity)
    for ray, hit in zip(look.shown_rays(scene, stage.view), scene.ray_hits, strict=True):
        colour = look.RAY_HIT if hit else look.RAY_MISSED
        _add_line(target, ray, (0.0045 if hit else 0.003) * unit, colour)
        if not hit:
            _add_ball(target, ray[1], 0.012 * unit, colour)
    for tip in scene.tips:
        _add_tip(target, tip, unit)
    for contact, normal in zip(scene.contacts_world, scene.normals_world, strict=True):
        _add_ball(target, contact, 0.024 * size * unit, look.CONTACT)
        if normal.any():
            # Twice the length: MuJoCo draws an arrow to half of where it says that it ends.
            end = contact + 2 * look.NORMAL_LENGTH * size * unit * normal
            arrow = mujoco.mjtGeom.mjGEOM_ARROW
            _add_line(target, np.stack([contact, end]), 0.010 * size * unit, look.CONTACT, arrow)


def _add_tip(target: mujoco.MjvScene, tip: Tip, unit: float) -> None:
    """A ball and what it sweeps; of a point its line, and a dot that can be seen."""
    _add_line(target, tip.path_world, 0.0045 * unit, look.RAY_HIT)
    if tip.radius > 0.0:
        _add_line(target, tip.path_world, tip.radius, look.RAY_HIT, alpha=0.25)
    _add_ball(target, tip.path_world[1], tip.radius or look.POINT_SIZE * unit, look.RAY_HIT)


def _add_plane(target: mujoco.MjvScene, lines: Floats, thickness: float) -> None:
    low, high = lines.min(axis=(0, 1)), lines.max(axis=(0, 1))
    half = (high - low) / 2 + [0, 0, thickness]
    _add(target, mujoco.mjtGeom.mjGEOM_BOX, half, (low + high) / 2, look.PLANE, 0.55)


def _add_ball(target: mujoco.MjvScene, centre: Floats, radius: float, colour: look.Colour) -> None:
    _add(target, mujoco.mjtGeom.mjGEOM_SPHERE, np.full(3, radius), centre, colour)


def _add_line(
    target: mujoco.MjvScene,
    ends: Floats,
    radius: float,
    colour: look.Colour,
    kind: mujoco.mjtGeom = mujoco.mjtGeom.mjGEOM_CAPSULE,
    alpha: float = 1.0,
) -> None:
    geom = _add(target, kind, np.ones(3), np.zeros(3), colour, alpha)
    mujoco.mjv_connector(geom, kind, radius, ends[0], ends[1])


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
