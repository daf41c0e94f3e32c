"""The picture by MuJoCo's offscreen renderer: ``python -m palpate.envs.picture_gl``.

A process of its own, started by `picture.draw`: where GL is missing or broken, only this dies.
``MUJOCO_GL`` must be set before the process starts.
"""

from __future__ import annotations

import sys
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from . import picture_view as look
from .picture import PictureScene, load_scene

__all__ = ["render"]

OVERSAMPLING = 2  # software GL may not smooth edges itself
MOST_SHAPES = 20_000
Floats = NDArray[np.float64]


def render(scene: PictureScene, size: tuple[int, int]) -> NDArray[np.uint8]:
    """The picture without captions, ``(height, width, 3)``; twice ``size``, for smooth edges."""
    view = look.frame(scene, size)
    width, height = (OVERSAMPLING * n for n in size)
    model = _compile(scene, view, width, height)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    with mujoco.Renderer(model, height, width, max_geom=MOST_SHAPES) as renderer:
        renderer.update_scene(data, _camera(view))
        renderer.scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = False
        renderer.scene.flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = False
        _add_shapes(renderer.scene, scene, view)
        return renderer.render()


def _compile(scene: PictureScene, view: look.View, width: int, height: int) -> mujoco.MjModel:
    """The meshes, the light and the sky. Everything else is added to the drawn scene alone."""
    spec = mujoco.MjSpec()
    spec.visual.global_.offwidth, spec.visual.global_.offheight = width, height
    spec.visual.global_.fovy = float(np.degrees(look.FIELD_OF_VIEW))
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
    _add_mesh(spec, "object", scene.object_vertices_world, scene.object_triangles, look.OBJECT, 1.0)
    colours = look.ghost_colours(scene)
    for i, ghost in enumerate(scene.ghosts):
        colour = colours[ghost.label]
        _add_mesh(spec, f"ghost {i}", ghost.vertices_world, ghost.triangles, colour, 0.18)
    return spec.compile()


def _add_mesh(
    spec: mujoco.MjSpec,
    name: str,
    vertices: Floats,
    triangles: NDArray[np.int64],
    colour: look.Colour,
    alpha: float,
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
        type=mujoco.mjtGeom.mjGEOM_MESH,
        meshname=name,
        rgba=[*colour, alpha],
        contype=0,
        conaffinity=0,
    )


def _camera(view: look.View) -> mujoco.MjvCamera:
    camera = mujoco.MjvCamera()
    camera.type = mujoco.mjtCamera.mjCAMERA_FREE
    camera.lookat = view.centre
    camera.distance = view.distance
    camera.azimuth = np.degrees(view.azimuth)
    camera.elevation = np.degrees(view.elevation)
    return camera


def _add_shapes(target: mujoco.MjvScene, scene: PictureScene, view: look.View) -> None:
    unit = view.radius
    lines, _ = look.grid(scene, view)
    _add_plane(target, lines, 0.0005 * unit)
    for line in lines:
        _add_line(target, line, 0.0015 * unit, look.GRID)
    for edge in scene.object_edges_world:
        _add_line(target, edge, 0.0035 * unit, look.EDGE)
    colours = look.ghost_colours(scene)
    for ghost in scene.ghosts:
        for edge in look.sharp_edges(ghost.vertices_world, ghost.triangles):
            _add_line(target, edge, 0.0025 * unit, colours[ghost.label])
    for ray, hit in zip(look.shown_rays(scene, view), scene.ray_hits, strict=True):
        colour = look.RAY_HIT if hit else look.RAY_MISSED
        _add_line(target, ray, (0.0045 if hit else 0.003) * unit, colour)
        if not hit:
            _add_ball(target, ray[1], 0.012 * unit, colour)
    for contact, normal in zip(scene.contacts_world, scene.normals_world, strict=True):
        _add_ball(target, contact, 0.024 * unit, look.CONTACT)
        # Twice the length, because MuJoCo draws an arrow to half of where it says that it ends.
        tip = contact + 2 * look.NORMAL_LENGTH * unit * normal
        arrow = mujoco.mjtGeom.mjGEOM_ARROW
        _add_line(target, np.stack([contact, tip]), 0.010 * unit, look.CONTACT, arrow)


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
) -> None:
    geom = _add(target, kind, np.ones(3), np.zeros(3), colour)
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
    scene_path, image_path, *wanted = sys.argv[1:]
    pixels = render(load_scene(Path(scene_path)), (int(wanted[0]), int(wanted[1])))
    Image.fromarray(pixels).reduce(OVERSAMPLING).save(image_path)
