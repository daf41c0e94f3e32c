"""Probes worth weighing: some anywhere, some aimed at where the object may be."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ...recognizer.predict.prediction import PoseSamples
from ...recognizer.predict.probes import ProbeSpace

Floats = NDArray[np.float64]

PLASTIC = 1.0 / 1.2207440846057596
"""Its powers step evenly through a cube: one over the root of ``x^4 = x + 1`` (M. Roberts 2018)."""
TRIES = 3
"""Points drawn for each aimed probe; some lie under the plane or call for a probe outside."""


def spread_actions(count: int, rng: np.random.Generator) -> Floats:
    """(count, 3) probes spread evenly over [-1, 1]^3, from a start that ``rng`` draws."""
    steps = PLASTIC ** np.arange(1, 4)
    return 2.0 * np.mod(rng.random(3) + np.arange(count)[:, None] * steps, 1.0) - 1.0


def aimed_actions(
    space: ProbeSpace, samples: PoseSamples, count: int, rng: np.random.Generator
) -> Floats:
    """Probes with one ray through a random point of the surface of a random sample.

    Every sample is drawn as often as another: a rival of small weight has to be told apart too.

    Args:
        space: the probes that may be sent.
        samples: poses that stand for the belief, at least one.
        count: how many probes at most.
        rng: source of randomness.

    Returns:
        (c, 3) probes, c at most ``count``: those of the points drawn that a probe can reach.
    """
    draws = TRIES * count
    rows = rng.integers(len(samples), size=draws)
    shares = rng.random((3, draws))
    actions = np.column_stack([np.zeros((draws, 2)), rng.uniform(-1.0, 1.0, draws)])
    points, normals = np.empty((draws, 3)), np.empty((draws, 3))
    for number in np.unique(samples.objects[rows]):
        own = np.flatnonzero(samples.objects[rows] == number)
        model = samples.models[number]
        corners = model.vertices[model.triangles]
        edges, sides = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        areas = np.linalg.norm(np.cross(edges, sides), axis=1)
        which = np.searchsorted(np.cumsum(areas), shares[0, own] * areas.sum())
        which = np.minimum(which, len(areas) - 1)
        a, b = np.sqrt(shares[1, own])[:, None], shares[2, own][:, None]
        flat = corners[which, 0] + a * ((1.0 - b) * edges[which] + b * sides[which])
        turns = Rotation.from_quat(samples.rotations[rows[own]])
        points[own] = turns.apply(flat) + samples.positions[rows[own]]
        normals[own] = turns.apply(model.normals[model.triangle_faces[which]])
    directions = space.rays(actions).directions_world
    # The ray that the surface faces most squarely is the one that may get there.
    best = np.einsum("akx,ax->ak", directions, normals).argmin(axis=1)
    along = directions[np.arange(draws), best]
    meeting = points - points[:, 2:] / along[:, 2:] * along
    actions[:, :2] = meeting[:, :2] / space.half_width
    good = (points[:, 2] > 0.0) & (np.abs(actions[:, :2]) <= 1.0).all(axis=1)
    good &= np.einsum("ax,ax->a", along, normals) < 0.0
    return actions[good][:count]
