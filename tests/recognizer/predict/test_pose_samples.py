"""Samples stand for a belief: allowed by the contacts, spread over families, with their doubt."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.pose_samples import pose_of
from oracles.checker import check, corners_of
from oracles.geometry import triangle_distances
from oracles.solids import model, random_contacts, random_pose
from scipy.spatial.transform import RigidTransform, Rotation

from palpate.recognizer import Belief, Contacts, Recognizer, SupportPlane
from palpate.recognizer.predict.pose_samples import MOST_OF_ONE, sample_belief
from palpate.recognizer.predict.prediction import PoseSamples

NAMES = ("l-block", "tetrahedron")
LIBRARY = [model(name) for name in NAMES]
RECOGNIZER = Recognizer(LIBRARY)


def belief_about(count: int, seed: int, recognizer: Recognizer = RECOGNIZER, **known) -> Belief:
    """The belief about random contacts with the first object of a library."""
    rng = np.random.default_rng(seed)
    solid = recognizer.models[0]
    pose, error = random_pose(rng, solid.diameter), 0.01 * solid.diameter
    contacts, _ = random_contacts(solid, pose, count, rng, position_error=error, normal_error=0.3)
    return recognizer.recognize(contacts, **known)


def all_allowed(belief: Belief, samples: PoseSamples) -> bool:
    """Whether every sample of a proven hypothesis meets every bound; there has to be one."""
    proven = 0
    for row in range(len(samples)):
        hypothesis = belief.hypotheses[samples.hypotheses[row]]
        solid = samples.models[samples.objects[row]]
        assert solid.name == hypothesis.object_name
        features = belief.library.solid(solid.name).features
        faces = hypothesis.interpretations[0]
        judged = check(solid, pose_of(samples, row), belief.contacts, faces, 1e-6, features)
        if hypothesis.proven and not judged.passed:
            return False
        proven += hypothesis.proven
    return proven > 0


@pytest.mark.parametrize("count", [1, 2, 3, 5])
def test_the_contacts_allow_every_sample(count):
    belief = belief_about(count, seed=count)
    samples = sample_belief(belief, LIBRARY, 120)
    assert len(samples) > len(belief.hypotheses)
    assert all_allowed(belief, samples)


def test_samples_on_edges_and_vertices_are_allowed_too():
    recognizer = Recognizer([model("tetrahedron")], features="all")
    belief = belief_about(3, 4, recognizer)
    samples = sample_belief(belief, recognizer.models, 100)
    assert all_allowed(belief, samples)


def test_each_hypothesis_has_its_own_pose_and_its_weight():
    belief = belief_about(3, seed=0)
    samples = sample_belief(belief, LIBRARY, 200)
    assert len(samples) <= 200
    assert samples.weights.sum() == pytest.approx(1.0)
    assert (np.diff(samples.hypotheses) >= 0).all()
    for row, hypothesis in enumerate(belief.hypotheses):
        members = np.flatnonzero(samples.hypotheses == row)
        assert 1 <= len(members) <= MOST_OF_ONE
        assert samples.weights[members].sum() == pytest.approx(hypothesis.weight)
        own = pose_of(samples, members[0]).as_matrix()
        np.testing.assert_allclose(own, hypothesis.T_world_object, atol=1e-12)
        assert np.ptp(samples.weights[members]) < 1e-12


def test_the_heaviest_come_first_where_there_is_no_room_for_all():
    belief = belief_about(1, seed=1)
    assert len(belief.hypotheses) > 5
    samples = sample_belief(belief, LIBRARY, 5)
    np.testing.assert_array_equal(samples.hypotheses, np.arange(5))
    weights = np.array([hypothesis.weight for hypothesis in belief.hypotheses[:5]])
    np.testing.assert_allclose(samples.weights, weights / weights.sum())


def test_objects_are_counted_as_the_library_given_has_them():
    belief = belief_about(2, seed=1)
    samples = sample_belief(belief, LIBRARY[::-1], 40)
    assert len(samples) >= len(belief.hypotheses[:40])
    for row in range(len(samples)):
        name = belief.hypotheses[samples.hypotheses[row]].object_name
        assert samples.models[samples.objects[row]].name == name


def test_samples_are_the_same_to_the_bit_and_no_global_chance_is_touched():
    belief = belief_about(3, seed=2)
    before = str(np.random.get_state())  # noqa: NPY002  the very thing that must not change
    one, other = (sample_belief(belief, LIBRARY, 150) for _ in range(2))
    assert str(np.random.get_state()) == before  # noqa: NPY002
    for name in ("positions", "rotations", "weights", "position_spread", "rotation_spread"):
        assert getattr(one, name).tobytes() == getattr(other, name).tobytes()


def test_samples_of_one_contact_turn_all_the_way_and_slide_over_the_whole_face():
    recognizer = Recognizer([model("cube")])
    up = np.array([0.0, 0.0, 1.0])
    contact = Contacts([np.zeros(3)], [up], position_error=1e-3, normal_error=0.05)
    samples = sample_belief(recognizer.recognize(contact), recognizer.models, 256)
    assert len(samples) == MOST_OF_ONE
    poses = [pose_of(samples, row) for row in range(len(samples))]
    # Where on its face the cube is touched: uniform, so the deviation is 1 / sqrt(12) of the side.
    touched = np.array([pose.inv().apply(np.zeros(3)) for pose in poses])
    normals = np.array([pose.inv().rotation.apply(up) for pose in poses])
    across = np.abs(normals).argmax(axis=1)[:, None] != np.arange(3)
    places = touched[across].reshape(-1, 2)
    np.testing.assert_allclose(places.std(axis=0), 1.0 / np.sqrt(12.0), rtol=0.25)
    assert places.min() < 0.1
    assert places.max() > 0.9
    # How it is turned about the normal: mean of the unit vectors near zero, each quarter visited.
    along = np.array([pose.rotation.apply([1.0, 0.0, 0.0]) for pose in poses])
    angles = np.arctan2(along[:, 1], along[:, 0])
    assert abs(np.exp(1j * angles).mean()) < 0.35
    assert (np.histogram(angles, 8, (-np.pi, np.pi))[0] > 0).all()


def test_samples_scatter_as_those_that_rejection_leaves_of_a_box_around_the_family():
    solid = model("tetrahedron")
    recognizer, rng = Recognizer([solid]), np.random.default_rng(0)
    belief = belief_about(3, 6, recognizer)
    samples = sample_belief(belief, recognizer.models, 64 * len(belief.hypotheses))
    members = np.flatnonzero(samples.hypotheses == 0)
    assert len(members) == MOST_OF_ONE
    turns = Rotation.from_quat(samples.rotations[members])
    own = turns[0]
    centres = samples.positions[members] + turns.apply(solid.centroid.copy())
    ours = np.hstack([centres, (turns * own.inv()).as_rotvec()])
    axes = np.linalg.svd(ours - ours.mean(axis=0), full_matrices=False)[2]
    along = (ours - ours.mean(axis=0)) @ axes.T
    drawn = 2.5 * along.std(axis=0) * rng.uniform(-1.0, 1.0, (60_000, 6))
    poses = ours.mean(axis=0) + drawn @ axes
    rotations = Rotation.from_rotvec(poses[:, 3:]) * own
    allowed = np.ones(len(poses), bool)
    contacts = belief.contacts
    for row, face in enumerate(belief.hypotheses[0].interpretations[0]):
        points = rotations.inv().apply(contacts.positions[row] - poses[:, :3]) + solid.centroid
        gaps = triangle_distances(points, corners_of(solid, face)).reshape(len(poses), -1)
        allowed &= gaps.min(axis=1) <= contacts.position_error[row]
        normals = rotations.apply(solid.normals[face].copy())
        allowed &= normals @ contacts.normals[row] >= np.cos(contacts.normal_error[row])
    assert allowed.sum() > 100
    ratio = along.std(axis=0) / drawn[allowed].std(axis=0)
    assert (ratio > 0.6).all()
    assert (ratio < 1.6).all()


def test_more_samples_leave_each_less_to_stand_for():
    belief = belief_about(1, seed=0)
    few = sample_belief(belief, LIBRARY, len(belief.hypotheses))
    many = sample_belief(belief, LIBRARY, 250)
    heaviest = int(np.flatnonzero(many.hypotheses == 0)[0])
    assert (many.hypotheses == 0).sum() > 20
    assert many.position_spread[heaviest] < few.position_spread[0]
    assert many.rotation_spread[heaviest] < few.rotation_spread[0]
    assert (few.position_spread > 0.0).all()
    assert (few.rotation_spread < np.pi).all()


def test_a_pose_that_is_fixed_is_one_sample_with_the_spread_of_its_covariance():
    solid = model("l-block")
    recognizer, rng = Recognizer([solid]), np.random.default_rng(3)
    pose = random_pose(rng, 1.0)
    contacts, _ = random_contacts(solid, pose, 14, rng, position_error=1e-3, normal_error=0.02)
    belief = recognizer.recognize(contacts)
    assert belief.unique
    samples = sample_belief(belief, recognizer.models, 256)
    assert len(samples) == 1
    variances = belief.hypotheses[0].covariance.diagonal()
    radius = 0.5 * solid.diameter
    assert samples.position_spread[0] == pytest.approx(np.sqrt(variances[3:].mean()))
    assert samples.rotation_spread[0] == pytest.approx(np.sqrt(variances[:3].mean()) / radius)


def test_samples_of_an_object_that_stands_stand():
    solid = model("l-block")
    recognizer, rng = Recognizer([solid]), np.random.default_rng(5)
    error = 1e-3
    turn = Rotation.from_rotvec([0.0, 0.0, 0.7])
    pose = RigidTransform.from_components(
        [0.0, 0.0, -turn.apply(solid.vertices.copy())[:, 2].min()], turn
    )
    contacts, _ = random_contacts(solid, pose, 2, rng, position_error=0.01, normal_error=0.2)
    support = SupportPlane(error=error, resting=True)
    belief = recognizer.recognize(contacts, support=support)
    samples = sample_belief(belief, [solid], 100)
    assert len(samples) > len(belief.hypotheses)
    for row in range(len(samples)):
        heights = pose_of(samples, row).apply(solid.vertices)[:, 2]
        # The support as a contact lets the plane tilt a little more than its error.
        assert abs(np.sort(heights)[:3]).max() < 6.0 * error


def test_an_empty_belief_has_no_samples_and_no_room_is_refused():
    far = Contacts([[0, 0, 0], [9, 0, 0]], [[1, 0, 0]] * 2, position_error=1e-3, normal_error=0.1)
    belief = RECOGNIZER.recognize(far)
    assert belief.empty
    assert len(sample_belief(belief, LIBRARY, 8)) == 0
    with pytest.raises(ValueError, match="most is 0"):
        sample_belief(belief, LIBRARY, 0)
