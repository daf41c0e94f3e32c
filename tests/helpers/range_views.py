"""What a range sensor is shown, and what its contacts truly are.

True points and normals come from the recogniser's ray caster, which knows nothing of MuJoCo.
"""

from __future__ import annotations

import numpy as np

from palpate.envs.scene.placement import AcrossPlane
from palpate.envs.scene.scene import OBJECT, ProbeScene
from palpate.envs.sensors.noise import SensorNoise
from palpate.envs.sensors.range_sensor import RangeGrid, RangeScanner
from palpate.envs.sensors.touch import ProbeCommand, Touch
from palpate.recognizer import Polyhedron
from palpate.recognizer.models.rays import cast_rays

NOISE = SensorNoise(position_error=2.54e-4, normal_error=np.pi / 10.0)


def scanner(model: Polyhedron, noise: SensorNoise = NOISE, **options) -> RangeScanner:
    """A scanner that sees all of a model near the origin, at a coarse grid."""
    width, reach = 1.5 * model.diameter, 2.0 * model.diameter
    options.setdefault("spacing", (width / 180.0, width / 90.0))
    return RangeScanner(noise, width=width, reach=reach, **options)


def grid(model: Polyhedron, noise: SensorNoise = NOISE, **options) -> RangeGrid:
    return RangeGrid(noise, width=1.5 * model.diameter, reach=2.0 * model.diameter, **options)


def command(rng: np.random.Generator, model: Polyhedron) -> ProbeCommand:
    x, y = rng.uniform(-0.1, 0.1, 2) * model.diameter
    return ProbeCommand(float(x), float(y), float(rng.uniform(-np.pi / 3.0, np.pi / 3.0)))


def place(scene: ProbeScene, rng: np.random.Generator, **options) -> None:
    scene.place(AcrossPlane(offset=0.1 * scene.model.diameter, **options).draw(rng, scene.model))


def truth_under(scene: ProbeScene, touch: Touch):
    """What the rays of a touch's contacts truly meet, by the recogniser's caster."""
    contacts = touch.contacts
    starts, directions = touch.starts_world[touch.outcomes == OBJECT], np.array(contacts.approaches)
    return cast_rays(scene.model, scene.T_world_object, starts, directions)


def assert_bounds_hold(scene: ProbeScene, touch: Touch) -> None:
    contacts, hits = touch.contacts, truth_under(scene, touch)
    assert hits.hit.all()
    off = np.linalg.norm(contacts.positions - hits.points_world, axis=1)
    assert (off <= contacts.position_error).all()
    sines = np.linalg.norm(np.cross(contacts.normals, hits.normals_world), axis=1)
    lean = np.arctan2(sines, (contacts.normals * hits.normals_world).sum(axis=1))
    assert (lean <= contacts.normal_error).all()
