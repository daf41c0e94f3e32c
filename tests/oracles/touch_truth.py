"""What a touch must be: its contacts on the object within their bounds, its paths outside it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from oracles.checker import broken, check, corners_of
from oracles.geometry import triangle_distances

from palpate.envs.scene.placement import AcrossPlane
from palpate.envs.scene.scene import ProbeScene
from palpate.envs.sensors.touch import ProbeCommand, Sensor, Touch
from palpate.recognizer import EDGE, FACE, VERTEX
from palpate.recognizer.models.features import Features, all_features

KIND_NAMES = {FACE: "face", EDGE: "edge", VERTEX: "vertex"}


def touches_around(
    sensor: Sensor, scene: ProbeScene, rng: np.random.Generator, count: int
) -> Iterator[Touch]:
    """Triads at random around an object that is placed anew for each."""
    half_width = 0.375 * scene.model.diameter
    placement = AcrossPlane(offset=0.2 * half_width)
    for _ in range(count):
        scene.place(placement.draw(rng, scene.model))
        x, y, yaw = rng.uniform(-1.0, 1.0, 3) * (half_width, half_width, np.pi / 3.0)
        yield sensor.touch(scene, ProbeCommand(float(x), float(y), float(yaw)), rng)


def true_features(scene: ProbeScene, touch: Touch, features: Features) -> NDArray[np.int32]:
    """(n,) the nearest feature of the told kind under each contact that its bounds allow; or -1."""
    model, pose, contacts = scene.model, scene.T_world_object, touch.contacts
    points = pose.inv().apply(contacts.positions)
    found = np.full(len(contacts), -1, np.int32)
    for row, kind in enumerate(touch.contacts.kinds):
        names = [
            feature
            for feature in range(len(features))
            if features.kind(feature) == KIND_NAMES[kind]
        ]
        away = [
            triangle_distances(points[row], corners_of(model, feature, features)).min()
            for feature in names
        ]
        for index in np.argsort(away):
            if away[index] > contacts.position_error[row]:
                break
            feature = np.array([names[index]])
            if check(model, pose, contacts[[row]], feature, features=features).passed:
                found[row] = names[index]
                break
    return found


def faults(scene: ProbeScene, touch: Touch, features: Features | None = None) -> list[str]:
    """What of a touch isn't true: contacts out of bounds, paths in the object, behind a surface."""
    features = features or all_features(scene.model)
    interpretation = true_features(scene, touch, features)
    found = [f"contact {row} is on nothing" for row in np.flatnonzero(interpretation < 0)]
    return found + broken(
        scene.model,
        scene.T_world_object,
        touch.contacts,
        interpretation,
        free_space=touch.free_space,
        features=features,
    )
