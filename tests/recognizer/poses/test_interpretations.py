"""Interpretations of which the poses are looked for: none that has one is dropped."""

from __future__ import annotations

from collections import Counter
from functools import cache

import numpy as np
import pytest
from helpers.fitting import Fitter
from helpers.sensing import SMALL, feel, touch_features
from numpy.typing import NDArray
from oracles import solids as oracles
from oracles.checker import Oracle, check
from oracles.samples import STAND_INS, Sample, draw
from scipy.spatial.transform import RigidTransform, Rotation

from palpate.recognizer import Contacts, Polyhedron
from palpate.recognizer.models.features import all_features
from palpate.recognizer.poses.fits.pose import KernelModel, Poses

Ints = NDArray[np.int32]


@cache
def fitter(model: Polyhedron, kernel: KernelModel) -> Fitter:
    return Fitter(model, kernel.features)


def test_the_truth_is_kept_wherever_it_was_touched() -> None:
    rng, proven, cases = np.random.default_rng(22), 0, 500
    for case in range(cases):
        sample = draw(rng)
        poses = fitter(sample.model, sample.kernel).run(sample.touches.faces[None], sample.contacts)
        assert len(poses) == 1, f"case {case}"
        proven += poses.proven[0]
        assert (
            case % 5
            or not poses.proven[0]
            or sample.passes(poses.rotations[0], poses.translations[0])
        )
    assert proven > 0.95 * cases


def test_contacts_good_to_a_millionth_of_the_object_lose_no_truth() -> None:
    rng = np.random.default_rng(19)
    model = STAND_INS["stapler"]
    test = Fitter(model)
    for case in range(800):
        touches = touch_features(model, test.features, rng, int(rng.integers(2, 6)))
        contacts = feel(touches, rng, rng.choice([1e-7, 1e-6]), 1e-3)
        assert len(test.run(touches.faces[None], contacts)) == 1, f"case {case}"


def near_misses(sample: Sample, rng: np.random.Generator) -> tuple[Contacts, Poses, Ints]:
    """Interpretations near the line between possible and not.

    Returns:
        Contacts; the interpretations that a pose is known for, with it; those that are rejected.
    """
    # Pulled apart or together a little, so that even the truth may have become impossible.
    contacts, middle = sample.contacts, sample.contacts.positions.mean(axis=0)
    stretched = Contacts(
        middle + rng.uniform(0.85, 1.2) * (contacts.positions - middle),
        contacts.normals,
        position_error=contacts.position_error,
        normal_error=contacts.normal_error,
    )
    rows = np.repeat(sample.touches.faces[None], 60, axis=0)
    for row in rows[1:]:
        changed = rng.choice(len(row), 2, replace=False)
        row[changed] = rng.integers(len(sample.features), size=2)
    poses = fitter(sample.model, sample.kernel).run(rows, stretched)
    kept = oracles.as_set(poses.faces)
    rejected = np.array([row for row in rows if tuple(row.tolist()) not in kept])
    return stretched, poses.take(poses.proven), rejected


@pytest.mark.parametrize("name", ["L-block", "holed"])
def test_no_pose_is_found_for_what_is_rejected_on_edges_and_vertices_too(name: str) -> None:
    model, rng = SMALL[name], np.random.default_rng(10)
    features = all_features(model)
    kernel, found = KernelModel(model, features), Counter()
    for _ in range(3):
        touches = touch_features(model, features, rng, int(rng.integers(3, 6)))
        sample = Sample(kernel, model, touches, feel(touches, rng, 0.0025, 0.35))
        contacts, poses, rejected = near_misses(sample, rng)
        for row in rejected[:1]:
            met = Oracle(model, contacts, row, features).finds_a_pose(rng)
            assert not met, f"{row} was rejected, and a pose meets its bounds"
        for row in poses.faces[:1]:
            found[Oracle(model, contacts, row, features).finds_a_pose(rng)] += 1
    assert found[True] > 4 * found[False]  # the oracle is no straw man


def test_a_pose_that_is_found_meets_every_bound() -> None:
    rng, seen = np.random.default_rng(11), 0
    for _ in range(25):
        sample = draw(rng, 3, 8)
        contacts, poses, _ = near_misses(sample, rng)
        for row in range(min(4, len(poses))):
            pose = RigidTransform.from_components(
                poses.translations[row], Rotation.from_matrix(poses.rotations[row])
            )
            faces, known = poses.faces[row], sample.features
            assert check(sample.model, pose, contacts, faces, features=known).passed
            seen += 1
    assert seen > 12
