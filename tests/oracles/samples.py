"""What is tested on: solids that are touched, and poses from which kernels are asked."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any

import numpy as np
from helpers.sensing import INCH, SMALL, Touches, feel, forget_normals, touch_features
from numpy.typing import NDArray
from oracles.checker import check
from oracles.solids import random_pose
from scipy.spatial.transform import RigidTransform, Rotation

from palpate.envs.library import load_library
from palpate.recognizer import Contacts, Polyhedron
from palpate.recognizer.contacts.reading_kernels import carry, read
from palpate.recognizer.models.features import Features, all_features, face_features
from palpate.recognizer.poses.fits.fit_kernels import FitSpace, fit_space
from palpate.recognizer.poses.fits.pose import KernelContacts, KernelModel, kernel_contacts

Floats = NDArray[np.float64]
Question = tuple[int, NDArray[np.int64], NDArray[np.int64], Any, KernelContacts]
STAND_INS = {model.name: model for model in load_library()}


@dataclass(frozen=True, eq=False)
class Sample:
    """A model that is touched, with contacts that meet their bounds at its true pose."""

    kernel: KernelModel
    model: Polyhedron
    touches: Touches
    contacts: Contacts

    @property
    def features(self) -> Features:
        return self.kernel.features

    @property
    def faces(self) -> NDArray[np.int64]:
        return self.touches.faces.astype(np.int64)

    @property
    def truth(self) -> RigidTransform:
        return self.touches.T_world_object

    @cached_property
    def true_rotation(self) -> Floats:
        return self.truth.rotation.as_matrix()

    @cached_property
    def true_translation(self) -> Floats:
        return np.array(self.truth.translation)

    @property
    def question(self) -> Question:
        """What most kernels ask first: count, features, their polygons, model, contacts."""
        contacts = kernel_contacts(self.contacts)
        return len(self.contacts), self.faces, self.faces, self.kernel.model, contacts

    def passes(self, rotation: Floats, translation: Floats) -> bool:
        pose = RigidTransform.from_components(translation, Rotation.from_matrix(rotation))
        return check(self.model, pose, self.contacts, self.faces, features=self.features).passed

    @property
    def on_convex_features(self) -> bool:
        """Whether no contact is on a face that is less than its hull."""
        pieces = np.diff(self.features.first)[self.faces[self.faces >= 0]]
        return bool((pieces == 1).all())


TESTS = [
    *(
        (model, KernelModel(model, face_features(model)))
        for model in (*SMALL.values(), *STAND_INS.values())
    ),
    *(
        (model, KernelModel(model, all_features(model)))
        for model in (*SMALL.values(), STAND_INS["stapler"], STAND_INS["simple-hand"])
    ),
]


@cache
def places_on(which: int) -> Touches:
    """Places on all features of a tested model, to draw from: much faster than new ones."""
    model, test = TESTS[which]
    return touch_features(model, test.features, np.random.default_rng([25, which]), 250)


def draw(rng: np.random.Generator, fewest: int = 1, most: int = 20) -> Sample:
    """Few and many contacts, precise and vague, a few of them of unknown normal or on nothing."""
    which = int(rng.integers(len(TESTS)))
    model, test = TESTS[which]
    known = places_on(which)
    rows = rng.integers(len(known), size=rng.integers(fewest, most + 1))
    pose, back = random_pose(rng), known.T_world_object.inv()
    touches = Touches(
        pose,
        (pose * back).apply(known.points[rows]),
        (pose * back).rotation.apply(known.normals[rows]),
        known.faces[rows],
    )
    position = rng.choice([0.001, 0.01, 0.05, 0.1]) * INCH
    normal = rng.choice([0.02, 0.1, np.pi / 12, np.pi / 8, 1.0, 2.0])
    noise = int(rng.integers(3))
    contacts = feel(touches, rng, position, normal, at_bounds=noise > 0, alike=noise > 1)
    if rng.random() < 0.3:
        contacts = forget_normals(contacts, rng.random(len(contacts)) < rng.choice([0.3, 1.0]))
    touches.faces[rng.random(len(touches)) < rng.choice([0.0, 0.0, 0.2])] = -1
    return Sample(test, model, touches, contacts)


def direction(rng: np.random.Generator) -> Floats:
    axis = rng.normal(size=3)
    return axis / np.linalg.norm(axis)


def rotation_near(rotation: Rotation, angle: float, rng: np.random.Generator) -> Rotation:
    """A rotation an angle away, or less far half of the time."""
    share = 1.0 - 1e-9 if rng.random() < 0.5 else rng.random()
    return rotation * Rotation.from_rotvec(angle * share * direction(rng))


def start_near(
    sample: Sample, rng: np.random.Generator, angle: float, off: float = 0.0
) -> tuple[Floats, Floats, Floats]:
    """A ball that holds the truth and a pose about which to ask: ball, rotation, translation."""
    ball = sample.true_rotation @ rotation_near(Rotation.identity(), angle, rng).as_matrix()
    rotation = ball @ rotation_near(Rotation.identity(), off, rng).as_matrix()
    away = rng.normal(size=3) * rng.choice([0.0, 0.01, 0.05])
    return ball, rotation, sample.true_translation + away


def read_at(sample: Sample, rotation: Floats, translation: Floats) -> tuple[FitSpace, float]:
    """Work space of the kernels with a pose read, and the largest reading in bounds."""
    count, faces, targets, model, contacts = sample.question
    space = fit_space(count)
    x, u = space.x, space.u
    carry(count, contacts[0], contacts[1], rotation, translation, x, u)
    return space, read(count, faces, targets, x, u, model, contacts, space.readings)
