"""An object that moves: bounds that grow by how far it moved still hold, and no less would do."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from oracles import solids as oracles
from oracles.geometry import signed_distances
from scipy.spatial.transform import RigidTransform, Rotation

from palpate.envs.scene.free_body import Displacement, displacement, grown, grown_free_space
from palpate.recognizer import Contacts, FreeSpace
from palpate.recognizer.contacts.contacts import APPROACH_ERROR

MODELS = ("cube", "l-block", "housing")


def small_motion(rng: np.random.Generator, size: float) -> RigidTransform:
    return RigidTransform.from_components(
        rng.normal(size=3) * 0.02 * size, Rotation.from_rotvec(rng.normal(size=3) * 0.05)
    )


def felt_at_bounds(
    model, pose: RigidTransform, rng: np.random.Generator, count: int = 20
) -> Contacts:
    """Contacts that are off by next to all that their bounds allow."""
    points, faces = oracles.surface_points(model, count, rng)
    off = rng.normal(size=(count, 3))
    off *= 0.0099 * model.diameter / np.linalg.norm(off, axis=1, keepdims=True)
    normals = pose.rotation.apply(model.normals[faces])
    axes = np.cross(normals, rng.normal(size=(count, 3)))
    axes *= 0.099 / np.linalg.norm(axes, axis=1, keepdims=True)
    return Contacts(
        pose.apply(points) + off,
        Rotation.from_rotvec(axes).apply(normals),
        position_error=0.01 * model.diameter,
        normal_error=0.1,
        approaches=-normals,
    )


@pytest.mark.parametrize("name", MODELS)
def test_no_point_of_the_object_moves_farther_than_is_said_and_one_does(name):
    model = oracles.model(name)
    rng = np.random.default_rng(0)
    for _ in range(50):
        before = oracles.random_pose(rng, model.diameter)
        after = small_motion(rng, model.diameter) * before
        moved = displacement(model, before, after)
        rows = rng.integers(len(model.triangles), size=300)
        points = oracles.points_on(model, rows, rng)
        inside = model.centroid + rng.random((300, 1)) * (points - model.centroid)
        everywhere = np.concatenate([points, inside, model.vertices])
        gone = np.linalg.norm(after.apply(everywhere) - before.apply(everywhere), axis=1)
        assert gone.max() <= moved.distance * (1 + 1e-12)
        assert gone.max() >= moved.distance * (1 - 1e-9)


def test_the_turn_is_the_angle_between_the_two_orientations():
    model = oracles.model("cube")
    rng = np.random.default_rng(1)
    for angle in (0.0, 1e-6, 0.3, 3.0, np.pi):
        before = oracles.random_pose(rng, 1.0)
        axis = rng.normal(size=3)
        about = Rotation.from_rotvec(angle * axis / np.linalg.norm(axis))
        after = RigidTransform.from_components(rng.normal(size=3), about) * before
        assert displacement(model, before, after).turn == pytest.approx(angle, abs=1e-9)


def test_an_object_that_stays_has_not_moved():
    model = oracles.model("housing")
    pose = oracles.random_pose(np.random.default_rng(2), 0.1)
    assert displacement(model, pose, pose).distance == 0.0
    assert displacement(model, pose, pose).turn == pytest.approx(0.0, abs=1e-15)


@pytest.mark.parametrize("name", MODELS)
def test_contacts_hold_for_the_moved_object_once_they_are_grown(name):
    """Each against the moved surface: the point is in its ball, the normal in its cone."""
    model = oracles.model(name)
    rng = np.random.default_rng(3)
    broken_without = 0
    for _ in range(50):
        before = oracles.random_pose(rng, model.diameter)
        after = small_motion(rng, model.diameter) * before
        seed = int(rng.integers(1 << 30))
        contacts = felt_at_bounds(model, before, np.random.default_rng(seed))
        points, faces = oracles.surface_points(model, 20, np.random.default_rng(seed))
        wider = grown(contacts, displacement(model, before, after))
        off = np.linalg.norm(wider.positions - after.apply(points), axis=1)
        normals = after.rotation.apply(model.normals[faces])
        turned = np.arccos(np.clip((wider.normals * normals).sum(axis=1), -1, 1))
        assert (off <= wider.position_error).all()
        assert (turned <= wider.normal_error).all()
        broken_without += int((off > contacts.position_error).sum())
        broken_without += int((turned > contacts.normal_error).sum())
    assert broken_without > 100


def test_growing_step_by_step_is_no_less_than_growing_at_once():
    model = oracles.model("l-block")
    rng = np.random.default_rng(4)
    poses = [oracles.random_pose(rng, 1.0)]
    for _ in range(4):
        poses.append(small_motion(rng, model.diameter) * poses[-1])
    steps = [displacement(model, *pair) for pair in pairwise(poses)]
    total = steps[0] + steps[1] + steps[2] + steps[3]
    whole = displacement(model, poses[0], poses[-1])
    assert whole.distance <= total.distance
    assert whole.turn <= total.turn
    half_turns = Displacement(distance=0.0, turn=3.0) + Displacement(distance=1.0, turn=3.0)
    assert half_turns == Displacement(distance=1.0, turn=np.pi)


def test_contacts_that_would_say_too_little_are_dropped():
    contacts = Contacts(np.eye(3), np.eye(3), position_error=[0.1, 0.3, 0.2], normal_error=0.1)
    kept = grown(contacts, Displacement(distance=0.5, turn=0.0), limit=0.75)
    assert kept.positions.tolist() == [[1, 0, 0], [0, 0, 1]]
    assert kept.position_error == pytest.approx([0.6, 0.7])
    assert len(grown(contacts, Displacement(distance=1.0, turn=0.0), limit=0.75)) == 0


def test_a_normal_bound_never_passes_a_half_turn():
    contacts = Contacts(np.eye(3), np.eye(3), position_error=0.1, normal_error=[0.1, 3.0, np.pi])
    wider = grown(contacts, Displacement(distance=0.0, turn=1.0))
    assert wider.normal_error == pytest.approx([1.1, np.pi, np.pi])


def test_approaches_are_kept_only_while_they_keep_their_promise():
    contacts = Contacts(
        np.eye(3), np.eye(3), position_error=0.1, normal_error=0.1, approaches=-np.eye(3)
    )

    def known(turn: float, approach_error: float = 0.0) -> bool:
        moved = Displacement(distance=0.0, turn=turn)
        return bool(grown(contacts, moved, approach_error=approach_error).approach_known.all())

    assert known(0.9 * APPROACH_ERROR)
    assert not known(1.1 * APPROACH_ERROR)
    assert known(0.4 * APPROACH_ERROR, 0.5 * APPROACH_ERROR)
    assert not known(0.6 * APPROACH_ERROR, 0.5 * APPROACH_ERROR)


@pytest.mark.parametrize("name", ["cube", "l-block"])
def test_swept_space_holds_for_the_moved_object_once_it_is_grown(name):
    """Depth and distance of points of the paths, from the moved object's own surface."""
    model = oracles.model(name)
    rng = np.random.default_rng(5)
    nearer = 0
    for _ in range(20):
        before = oracles.random_pose(rng, 0.1)
        after = small_motion(rng, model.diameter) * before
        starts = before.apply(rng.normal(size=(8, 3)) * model.diameter)
        ends = before.apply(rng.normal(size=(8, 3)) * model.diameter)
        along = np.linspace(0.0, 1.0, 15)[:, None, None]
        points = starts + along * (ends - starts)
        clear = least_distances(model, before, points)
        # Paths said to be as clear as they were, be it less than nothing.
        radius = np.maximum(clear, 0.0) + 0.01
        paths = FreeSpace(starts, ends, radius=radius, error=radius - clear)
        wider = grown_free_space(paths, displacement(model, before, after))
        now = least_distances(model, after, points)
        assert (now >= wider.clearance - 1e-12).all()
        nearer += int((now < paths.clearance).sum())
    assert nearer > 20


def least_distances(model, pose: RigidTransform, points: np.ndarray) -> np.ndarray:
    """(m,) the least signed distance from an object at a pose of the places (k, m, 3) of paths."""
    at = pose.inv().apply(points.reshape(-1, 3))
    return signed_distances(model, at).reshape(points.shape[:2]).min(axis=0)


def test_paths_that_would_say_too_little_are_dropped():
    paths = FreeSpace(np.zeros((2, 3)), np.eye(3)[:2], radius=0.2, error=[0.1, 0.4])
    kept = grown_free_space(paths, Displacement(distance=0.2, turn=0.1), limit=0.5)
    assert kept.ends.tolist() == [[1, 0, 0]]
    assert kept.error == pytest.approx([0.3])
    assert kept.radius == pytest.approx([0.2])


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Displacement(distance=-1.0, turn=0.0), "distance is -1 m"),
        (lambda: Displacement(distance=float("nan"), turn=0.0), "distance is nan m"),
        (lambda: Displacement(distance=0.0, turn=4.0), "turn is 4 rad"),
        (lambda: grown(Contacts.none(), STILL, limit=0.0), "limit is 0 m"),
        (lambda: grown(Contacts.none(), STILL, approach_error=-1.0), "approach error is -1"),
        (lambda: grown_free_space(FreeSpace.none(), STILL, limit=-1.0), "limit is -1 m"),
    ],
)
def test_a_wrong_argument_is_named(make, words):
    with pytest.raises(ValueError, match=words):
        make()


STILL = Displacement(distance=0.0, turn=0.0)
