"""The last search for a witness: its slopes against differences, its poses against the judge."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import RigidTransform, Rotation

from palpate.recognizer import Polyhedron
from palpate.recognizer.models.features import face_features
from palpate.recognizer.poses.surroundings.repair import Bounds, repair
from palpate.recognizer.poses.surroundings.repair_kernels import apply_motion
from palpate.recognizer.poses.surroundings.surroundings import Surroundings, bounds_of
from palpate.scripts.lab.soundness.case import Case
from palpate.scripts.lab.soundness.cases import draw_case
from palpate.scripts.lab.soundness.check import breaches, judge

Floats = NDArray[np.float64]


def bounds_about(case: Case) -> tuple[Polyhedron, Bounds]:
    """A case's object, and what a pose of it has to meet."""
    assert isinstance(case.model, Polyhedron)
    known = Surroundings.of(case.free_space, case.support)
    return case.model, bounds_of(case.model, face_features(case.model), case.contacts, known)


def as_arrays(pose: RigidTransform) -> tuple[Floats, Floats]:
    return pose.rotation.as_matrix(), np.array(pose.translation)


def moved(
    rng: np.random.Generator, bounds: Bounds, pose: RigidTransform, by: float
) -> tuple[Floats, Floats]:
    """A pose off by so many bounds on a position, in some direction."""
    step = rng.normal(size=6)
    step *= by * bounds.contacts[2].max() / np.linalg.norm(step)
    return apply_motion(*as_arrays(pose), step, bounds.model[5], bounds.model[6])


@pytest.mark.parametrize("kind", ["free", "support", "approaches"])
def test_slopes_are_those_of_differences(kind: str) -> None:
    rng, alike = np.random.default_rng(0), []
    for index in range(8):
        case = draw_case(kind, 3, index)
        _, bounds = bounds_about(case)
        faces = case.interpretation.astype(np.int64)
        R, t = moved(rng, bounds, case.truth, 0.8)
        values, slopes, _ = bounds.rows(faces, R, t)
        length = 1e-6 * bounds.model[6]
        for axis in range(6):
            ends = []
            for sign in (-1.0, 1.0):
                step = sign * length * np.eye(6)[axis]
                ends.append(bounds.rows(faces, *apply_motion(R, t, step, *bounds.model[5:7]))[0])
            if len(ends[0]) == len(values) == len(ends[1]):
                by_differences = (ends[1] - ends[0]) / (2.0 * length)
                size = np.abs(slopes).max(axis=1) + 1e-9
                # What is far from its bound may have its nearest place jump.
                near = values > -2.0
                alike += (np.abs(by_differences - slopes[:, axis]) < 0.02 * size)[near].tolist()
    assert len(alike) > 200
    assert np.mean(alike) > 0.9


@pytest.mark.parametrize("kind", ["faces", "free", "support", "approaches"])
def test_a_pose_a_bound_or_two_off_comes_back_to_one_that_the_judge_accepts(kind: str) -> None:
    rng, tried, back = np.random.default_rng(1), 0, 0
    for index in range(16):
        case = draw_case(kind, 4, index)
        model, bounds = bounds_about(case)
        faces = case.interpretation.astype(np.int64)
        R, t, met, solved = repair(faces, *moved(rng, bounds, case.truth, 1.5), bounds, 50)
        tried += solved > 0
        if not met:
            continue
        back += solved > 0
        pose = RigidTransform.from_components(t, Rotation.from_matrix(R))
        # What the object stands on is the caller's to say: it is no part of these bounds.
        broken = breaches(case, pose, case.interpretation, model)
        assert [what for what in broken if "stands on nothing" not in what] == []
    assert tried > 8
    assert back > 0.7 * tried


def test_the_search_ends_where_there_is_no_witness() -> None:
    case = draw_case("free", 4, 0)
    _, bounds = bounds_about(case)
    far = case.truth.translation + np.array([2.0, 0.0, 0.0])
    faces = case.interpretation.astype(np.int64)
    *_, met, solved = repair(faces, case.truth.rotation.as_matrix(), far, bounds, 7)
    assert not met
    assert solved <= 7


@pytest.mark.parametrize("name", ["support:31", "support:77", "some-normals:133"])
def test_cases_that_were_open_once_are_decided(name: str) -> None:
    # At the very bounds of noise, with hardly a pose left; and with thousands of dear leaves.
    kind, _, index = name.partition(":")
    outcome = judge(draw_case(kind, 7, int(index)))
    assert outcome.held
    assert not outcome.bad
    assert outcome.undecided == 0
