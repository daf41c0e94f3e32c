"""A notched bar and a cube that strategies probe, and what an environment shows them."""

from __future__ import annotations

import numpy as np
import trimesh
from helpers.pose_samples import samples_at
from oracles.solids import blocks
from scipy.spatial.transform import RigidTransform, Rotation

from palpate.policies import Task
from palpate.policies.outcomes.outcomes import Outcomes
from palpate.policies.outcomes.rivals import same_answer
from palpate.recognizer import Polyhedron
from palpate.recognizer.predict.prediction import MET_OBJECT, MET_PLANE, PoseSamples, Predictions
from palpate.recognizer.predict.probes import ProbeSpace

REACH, CONE = 1e-3, np.radians(20.0)
SPACE = ProbeSpace(half_width=0.03, reach=0.16)
MM = 1e-3


def notched() -> Polyhedron:
    """A bar of 60 x 20 x 24 mm with the upper half of its last 15 mm cut away."""
    solid = np.ones((2, 1, 2), bool)
    solid[1, 0, 1] = False
    mesh = blocks(solid, [-30 * MM, 15 * MM, 30 * MM], [-10 * MM, 10 * MM], [-12 * MM, 0, 12 * MM])
    return Polyhedron.from_mesh(mesh, name="notched")


def cube() -> Polyhedron:
    return Polyhedron.from_mesh(trimesh.creation.box((30 * MM, 30 * MM, 30 * MM)), name="cube")


BAR, CUBE = notched(), cube()


def task_for(*models: Polyhedron, **settings) -> Task:
    return Task(
        library=models or (BAR,),
        space=SPACE,
        position_error=REACH,
        normal_error=CONE,
        **settings,
    )


def pose_at(turn_deg=0.0, x=0.0, y=0.0, z=0.0) -> RigidTransform:
    turn = Rotation.from_euler("z", turn_deg, degrees=True)
    return RigidTransform.from_components((x, y, z), turn)


def observation_of(samples: PoseSamples, contacts=None, sent=0):
    points, normals = contacts or (np.zeros((0, 3)), np.zeros((0, 3)))
    count = len(points)
    return {
        "sample_count": np.array([len(samples)]),
        "sample_objects": samples.objects,
        "sample_hypotheses": samples.hypotheses,
        "sample_positions": samples.positions,
        "sample_quaternions": samples.rotations,
        "sample_weights": samples.weights,
        "sample_position_spread": samples.position_spread,
        "sample_rotation_spread": samples.rotation_spread,
        "hypothesis_count": np.array([len(np.unique(samples.hypotheses))]),
        "contact_count": np.array([count]),
        "contact_positions": np.asarray(points),
        "contact_normals": np.asarray(normals),
        "contact_position_error": np.full(count, REACH),
        "contact_normal_error": np.full(count, CONE),
        "ray_count": np.array([sent]),
        "ray_starts": np.tile([0.0, 0.0, 0.2], (sent, 1)),
        "ray_ends": np.tile([0.0, 0.1, 0.0], (sent, 1)),
    }


def random_outcomes(rng, *, count=7, probes=5, free_space=False, spread=1.0) -> Outcomes:
    """Reports made up: near each other in places, touches and misses mixed."""
    task = task_for(free_space=free_space)
    poses = [pose_at(40.0 * k, 5e-3 * k) for k in range(count)]
    samples = samples_at((BAR,), poses, weights=rng.random(count), turn=0.02 * spread)
    normals = rng.normal([0.0, 0.0, 2.0], 0.5, (count, probes, 3, 3))
    told = Predictions(
        np.where(rng.random((count, probes, 3)) < 0.7, MET_OBJECT, MET_PLANE).astype(np.int8),
        0.1 + 1.5e-3 * rng.random((count, probes, 3)),
        normals / np.linalg.norm(normals, axis=-1, keepdims=True),
        spread * 5e-4 * rng.random((count, probes, 3)),
    )
    actions = rng.uniform(-1.0, 1.0, (probes, 3))
    chances = rng.random(count)
    return Outcomes(
        task,
        samples,
        actions,
        task.space.rays(actions),
        told,
        same_answer(task, samples),
        chances / chances.sum(),
    )


def rivals_at_both_ends() -> PoseSamples:
    """Two hypotheses that differ in which end of the bar is notched, with poses nearly fixed."""
    return samples_at((BAR,), [pose_at(10.0), pose_at(190.0)], spread=2e-4, turn=5e-3)


def contacts_on_the_bar(rng, count: int):
    """Points on the sides of the bar as both rivals have it, away from the notch."""
    points = np.column_stack(
        [rng.uniform(-0.012, 0.012, count), np.full(count, 0.01), rng.uniform(0, 0.01, count)]
    )
    normals = np.tile([0.0, 1.0, 0.0], (count, 1))
    return pose_at(10.0).apply(points), pose_at(10.0).rotation.apply(normals)
