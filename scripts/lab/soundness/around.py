"""What else may be known of a touched object: paths of a probe, a support, approaches."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from oracles.geometry import footings, signed_distances
from scipy.spatial.transform import RigidTransform, Rotation

from ....envs.sensors.noise import uniform_in_ball, uniform_in_cone
from ....recognizer import FreeSpace, Polyhedron, SupportPlane
from ....recognizer.contacts.contacts import APPROACH_ERROR
from ....recognizer.models.rays import cast_rays
from .touch import INSIDE, Touched, random_pose, random_unit, shifted

Floats = NDArray[np.float64]

TOUCHING = 1e-6
"""Share of the diameter at which a ball on its way counts as stopped by the object."""


def touch_by_rays(
    model: Polyhedron, pose: RigidTransform, count: int, rng: np.random.Generator
) -> tuple[Touched, Floats, Floats]:
    """Send rays from around an object until so many have met it, and as many again at most missed.

    Returns:
        What they met, and the true paths of all of them: (m, 3) starts and (m, 3) ends.
    """
    size, centre = model.diameter, pose.apply(model.centroid)
    starts = centre + 1.3 * size * np.array([random_unit(rng) for _ in range(40 * count)])
    aims = centre + uniform_in_ball(rng, 40 * count, 0.5 * size)
    directions = (aims - starts) / np.linalg.norm(aims - starts, axis=1, keepdims=True)
    hits = cast_rays(model, pose, starts, directions)
    met = np.flatnonzero(hits.hit)[:count]
    missed = np.flatnonzero(~hits.hit)[: int(rng.integers(0, count + 1))]
    ends = np.concatenate(
        [hits.points_world[met], starts[missed] + 2.6 * size * directions[missed]]
    )
    touched = Touched(
        pose, hits.points_world[met], hits.normals_world[met], hits.faces[met].astype(np.int32)
    )
    return touched, np.concatenate([starts[met], starts[missed]]), ends


def ball_paths(
    model: Polyhedron, pose: RigidTransform, count: int, rng: np.random.Generator
) -> tuple[Floats, Floats, Floats]:
    """Move balls towards an object until they touch it or have passed it.

    Each step is no longer than what is left between ball and object: none is ever too near.

    Returns:
        (m, 3) starts, (m, 3) ends and (m,) radii.
    """
    size = model.diameter
    starts = model.centroid + 1.3 * size * np.array([random_unit(rng) for _ in range(count)])
    aims = model.centroid + uniform_in_ball(rng, count, 0.6 * size)
    directions = (aims - starts) / np.linalg.norm(aims - starts, axis=1, keepdims=True)
    radii = rng.uniform(0.005, 0.08, count) * size
    walked = np.zeros(count)
    for _ in range(500):
        places = starts + walked[:, None] * directions
        room = signed_distances(model, places) - radii
        if (room < TOUCHING * size).all() or (walked >= 2.6 * size).all():
            break
        walked = np.minimum(walked + np.maximum(room, 0.0), 2.6 * size)
    return pose.apply(starts), pose.apply(starts + walked[:, None] * directions), radii


def free_space(
    rng: np.random.Generator,
    starts: Floats,
    ends: Floats,
    radii: Floats,
    error: float,
    at_bounds: bool,
) -> FreeSpace:
    """What is reported of true paths: both ends of each off by no more than the error."""
    errors = np.full(len(starts), error)
    return FreeSpace(
        shifted(rng, starts, errors, at_bounds),
        shifted(rng, ends, errors, at_bounds),
        radius=radii,
        error=errors,
    )


def above_plane(
    model: Polyhedron, pose: RigidTransform, error: float, rng: np.random.Generator, at_bounds: bool
) -> SupportPlane:
    """A plane that the object doesn't reach below by more than the error, or just so much."""
    up = random_unit(rng) if rng.random() < 0.5 else np.array([0.0, 0.0, 1.0])
    lowest = float((pose.apply(model.vertices) @ up).min())
    gap = 0.0 if at_bounds else rng.uniform(0.0, 0.2) * model.diameter
    return SupportPlane(
        height=lowest + INSIDE * error - gap, error=error, normal=(up[0], up[1], up[2])
    )


def resting(
    model: Polyhedron, error: float, rng: np.random.Generator, at_bounds: bool
) -> tuple[RigidTransform, SupportPlane]:
    """An object that stands on a face it can stand on, tilted as far as the error lets it."""
    faces = footings(model)
    face = faces[int(rng.integers(len(faces)))]
    up = random_unit(rng) if rng.random() < 0.5 else np.array([0.0, 0.0, 1.0])
    base = Rotation.align_vectors([-up], [face.normal])[0]
    spun = Rotation.from_rotvec(rng.uniform(-np.pi, np.pi) * up) * base
    level = np.cross(up, random_unit(rng))
    level /= np.linalg.norm(level)
    spread = np.ptp(spun.apply(face.corners) @ np.cross(up, level))
    tilt = (1.0 if at_bounds else rng.random()) * np.arcsin(min(0.5, 2.0 * error / spread))
    while True:
        turned = Rotation.from_rotvec(tilt * level) * spun
        heights = turned.apply(face.corners) @ up
        lowest = float((turned.apply(model.vertices.copy()) @ up).min())
        # The face may be between these two places; nothing may be below the lower one.
        low, high = lowest + INSIDE * error, heights.max() - INSIDE * error
        if high <= low:
            break
        tilt *= 0.9
    share = rng.choice([0.0, 1.0]) if at_bounds else rng.random()
    pose = RigidTransform.from_components(random_pose(rng).translation, turned)
    height = high + share * (low - high) + pose.translation @ up
    return pose, SupportPlane(
        height=float(height), error=error, normal=(up[0], up[1], up[2]), resting=True
    )


def approaches(touched: Touched, rng: np.random.Generator, at_bounds: bool) -> Floats:
    """(n, 3) ways from which a finger can have come, as reported; some unknown, some grazing."""
    found = np.empty_like(touched.points)
    for row, normal in enumerate(touched.normals):
        way = random_unit(rng)
        way *= -np.sign(way @ normal)
        if rng.random() < 0.2:
            way -= (way @ normal) * normal
            way /= np.linalg.norm(way)
        found[row] = uniform_in_cone(rng, way[None], INSIDE * APPROACH_ERROR)[0]
        if at_bounds:
            # Away from where the surface faces, as far as it may be.
            axis = np.cross(way, normal)
            axis /= np.linalg.norm(axis)
            found[row] = Rotation.from_rotvec(INSIDE * APPROACH_ERROR * axis).apply(way)
    found[rng.random(len(found)) < 0.2] = np.nan
    return found
