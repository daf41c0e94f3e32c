"""Hypotheses: which poses count as one, how they are weighed, and what contacts leave open."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from helpers.fitting import Fitter
from helpers.sensing import exact, feel, touch_faces
from numpy.typing import NDArray
from scipy.spatial.transform import RigidTransform, Rotation

from palpate.recognizer import Contacts, Polyhedron, PoseTolerance, Recognizer
from palpate.recognizer.beliefs.hypotheses import Hypothesis, cluster
from palpate.recognizer.poses.fits.pose import Poses

CUBE = Polyhedron.from_mesh(trimesh.creation.box((0.04, 0.04, 0.04)), name="cube")


def wedge() -> Polyhedron:
    """A tetrahedron without any symmetry, its centroid away from its frame's origin."""
    corners = np.array([[0, 0, 0], [0.07, 0, 0], [0.01, 0.05, 0], [0.02, 0.01, 0.06]]) + 0.1
    return Polyhedron.from_mesh(
        trimesh.Trimesh(corners, [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
    )


WEDGE = wedge()
TOLERANCE = PoseTolerance(rotation=0.05, translation=0.02)
SMALLEST_SHIFT = TOLERANCE.distance(WEDGE.diameter, 1e-5)


def placed(model: Polyhedron, turns: list[Rotation], centres: NDArray[np.float64] | None = None):
    """Poses that put the model's centroid at ``centres``; each row a known interpretation."""
    count = len(turns)
    rotations = np.array([turn.as_matrix() for turn in turns])
    at = np.zeros((count, 3)) if centres is None else centres
    return Poses(
        faces=np.arange(count, dtype=np.int32)[:, None],
        rotations=rotations,
        translations=at - rotations @ model.centroid,
        costs=np.arange(count, dtype=float),
        informations=np.tile(1e10 * np.eye(6), (count, 1, 1)),
        proven=np.ones(count, bool),
        reaches=np.zeros((count, 2)),
    )


def groups(hypotheses: list[Hypothesis]) -> list[list[int]]:
    return [hypothesis.interpretations[:, 0].tolist() for hypothesis in hypotheses]


def turn(angle: float, axis: tuple[float, float, float] = (0.6, 0.0, 0.8)) -> Rotation:
    return Rotation.from_rotvec(angle * np.array(axis))


# Grouping


def test_no_poses_make_no_hypotheses() -> None:
    nothing = placed(WEDGE, [Rotation.identity()]).take(np.array([], np.intp))
    hypotheses, logs = cluster(WEDGE, nothing, TOLERANCE, 1e-5)
    assert hypotheses == []
    assert logs.shape == (0,)


def test_poses_within_the_rotation_tolerance_are_one_and_beyond_it_two() -> None:
    base = Rotation.random(rng=np.random.default_rng(1))
    poses = placed(WEDGE, [base, base * turn(0.049), base * turn(0.051)])
    assert groups(cluster(WEDGE, poses, TOLERANCE, 1e-5)[0]) == [[0, 1], [2]]


def test_poses_within_the_shift_tolerance_are_one_and_beyond_it_two() -> None:
    way = np.array([0.0, 0.6, 0.8]) * SMALLEST_SHIFT
    poses = placed(WEDGE, [turn(1.0)] * 3, np.array([0 * way, 0.99 * way, 1.01 * way]))
    assert groups(cluster(WEDGE, poses, TOLERANCE, 1e-5)[0]) == [[0, 1], [2]]


def test_the_shift_tolerance_grows_with_the_bound_on_positions() -> None:
    assert TOLERANCE.distance(0.1, 1e-5) == pytest.approx(0.002)
    assert TOLERANCE.distance(0.1, 0.003) == pytest.approx(0.006)
    way = np.array([0.005, 0.0, 0.0])
    poses = placed(WEDGE, [turn(1.0)] * 2, np.array([0 * way, way]))
    assert len(cluster(WEDGE, poses, TOLERANCE, 1e-5)[0]) == 2
    assert len(cluster(WEDGE, poses, TOLERANCE, 0.003)[0]) == 1


def test_shifts_are_compared_at_the_centroid_and_not_at_the_frames_origin() -> None:
    # A small turn about the centroid moves the origin, 0.2 m away, by more than the tolerance.
    poses = placed(WEDGE, [turn(0.0), turn(0.045)])
    assert np.linalg.norm(np.diff(poses.translations, axis=0)) > 2.0 * SMALLEST_SHIFT
    assert len(cluster(WEDGE, poses, TOLERANCE, 1e-5)[0]) == 1


@pytest.mark.parametrize("base", [np.pi, 2.0 * np.pi, 0.0])
def test_rotations_on_either_side_of_half_a_turn_are_near(base: float) -> None:
    # Their rotation vectors point in opposite directions.
    poses = placed(WEDGE, [turn(base - 0.02), turn(base + 0.02), turn(base + 0.08)])
    assert groups(cluster(WEDGE, poses, TOLERANCE, 1e-5)[0]) == [[0, 1], [2]]


def test_half_turns_about_different_axes_are_different() -> None:
    poses = placed(WEDGE, [turn(np.pi, (1, 0, 0)), turn(np.pi, (0, 1, 0)), turn(np.pi, (0, 0, 1))])
    assert len(cluster(WEDGE, poses, TOLERANCE, 1e-5)[0]) == 3


def test_poses_that_differ_by_a_symmetry_are_one() -> None:
    rng = np.random.default_rng(2)
    base = Rotation.random(rng=rng)
    copies = [base * Rotation.from_matrix(s) * turn(0.01) for s in CUBE.symmetries]
    assert len(copies) == 24
    assert groups(cluster(CUBE, placed(CUBE, copies), TOLERANCE, 1e-5)[0]) == [list(range(24))]
    # The same turns applied to the world are other poses of a cube that stands askew.
    others = [Rotation.from_matrix(s) * base for s in CUBE.symmetries]
    assert len(cluster(CUBE, placed(CUBE, others), TOLERANCE, 1e-5)[0]) > 1


def test_symmetric_copies_are_one_wherever_the_frames_origin_is() -> None:
    mesh = trimesh.creation.box((0.04, 0.04, 0.04))
    mesh.apply_translation([0.3, -0.1, 0.2])
    model = Polyhedron.from_mesh(mesh, name="far cube")
    rng = np.random.default_rng(3)
    touches = touch_faces(model, rng, [0, 1, 2, 3, 4, 5, 0, 1, 2])
    belief = Recognizer([model]).recognize(feel(touches, rng, 1e-4, 0.05))
    assert len(belief.hypotheses) == 1


def test_the_best_proven_fit_speaks_for_its_group() -> None:
    poses = placed(WEDGE, [turn(0.01 * k) for k in range(4)])
    poses = replace(
        poses,
        costs=np.array([3.0, 1.0, 2.0, 0.5]),
        proven=np.array([True, True, True, False]),
    )
    (only,), _ = cluster(WEDGE, poses, TOLERANCE, 1e-5)
    assert only.interpretations[:, 0].tolist() == [1, 2, 0, 3]
    np.testing.assert_allclose(only.pose.rotation.as_matrix(), poses.rotations[1], atol=1e-12)
    np.testing.assert_allclose(only.pose.translation, poses.translations[1])
    assert only.object_name == WEDGE.name


def test_every_interpretation_is_in_exactly_one_hypothesis() -> None:
    rng = np.random.default_rng(4)
    turns = [turn(a) for a in rng.uniform(0.0, 0.5, 60)]
    poses = placed(WEDGE, turns, rng.uniform(0.0, 3.0 * SMALLEST_SHIFT, (60, 3)))
    found = groups(cluster(WEDGE, poses, TOLERANCE, 1e-5)[0])
    assert 1 < len(found) < 60
    assert sorted(member for members in found for member in members) == list(range(60))
    for members in found:  # close to the leader, by the definition written down anew
        leader = members[0]
        for other in members:
            apart = turns[leader].inv() * turns[other]
            assert apart.magnitude() <= TOLERANCE.rotation + 1e-9


@pytest.mark.parametrize("name", ["rotation", "translation", "position_errors"])
@pytest.mark.parametrize("value", [0.0, -1.0, float("nan")])
def test_a_tolerance_that_is_not_above_zero_is_refused(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=name):
        PoseTolerance(**{name: value})


# Weights


def test_a_pose_that_is_known_worse_weighs_more() -> None:
    poses = placed(WEDGE, [turn(0.0), turn(1.0)])
    poses.informations[1] /= 4.0  # twice the spread in six freedoms
    poses.costs[:] = 0.0
    _, logs = cluster(WEDGE, poses, TOLERANCE, 1e-5)
    assert logs[1] - logs[0] == pytest.approx(6.0 * np.log(2.0), rel=1e-3)


def test_the_interpretations_of_a_pose_add_up_each_by_how_well_it_fits() -> None:
    poses = placed(WEDGE, [turn(0.0), turn(1.0), turn(1.001), turn(1.002)])
    _, logs = cluster(WEDGE, poses, TOLERANCE, 1e-5)
    assert logs[1] - logs[0] == pytest.approx(np.log(np.exp([-0.5, -1.0, -1.5]).sum()))


def test_a_pose_counts_once_for_every_symmetry() -> None:
    one = cluster(CUBE, placed(CUBE, [turn(0.3)]), TOLERANCE, 1e-5)[1]
    plain = Polyhedron.from_mesh(trimesh.creation.box((0.04, 0.04, 0.04)), name="plain")
    plain.__dict__["symmetries"] = np.eye(3)[None]  # a cube that is told it has none
    none = cluster(plain, placed(plain, [turn(0.3)]), TOLERANCE, 1e-5)[1]
    assert one[0] - none[0] == pytest.approx(np.log(24.0))


# Freedoms


def hypothesis_of(
    model: Polyhedron, faces: list[int], seed: int = 0, contacts: Contacts | None = None
) -> tuple[Hypothesis, Contacts]:
    touches = touch_faces(model, np.random.default_rng(seed), faces)
    contacts = exact(touches) if contacts is None else contacts
    poses = Fitter(model).run(touches.faces[None], contacts)
    hypotheses, _ = cluster(model, poses, PoseTolerance(), 1e-4)
    assert len(hypotheses) == 1
    return hypotheses[0], contacts


def faces_along(model: Polyhedron, axes: str) -> list[int]:
    signs = {"x": (1, 0, 0), "y": (0, 1, 0), "z": (0, 0, 1), "X": (-1, 0, 0)}
    return [int(np.argmax(model.normals @ signs[axis])) for axis in axes]


@pytest.mark.parametrize(
    ("axes", "count"),
    [("x" * 8, 3), ("xy" * 5, 1), ("xX" * 6, 3), ("xyz" * 4, 0), ("xyzX" * 4, 0)],
)
def test_contacts_leave_as_many_freedoms_as_their_faces_do(axes: str, count: int) -> None:
    for seed in range(5):
        hypothesis, _ = hypothesis_of(CUBE, faces_along(CUBE, axes), seed)
        assert hypothesis.freedoms.shape == (count, 6)
        assert hypothesis.determined == (count == 0)


def test_one_face_leaves_two_shifts_along_it_and_a_spin_about_its_normal() -> None:
    (face,) = set(faces_along(CUBE, "z" * 8))
    hypothesis, _ = hypothesis_of(CUBE, [face] * 8)
    normal = CUBE.normals[face]
    expected = np.zeros((3, 6))
    expected[0, :3] = normal
    expected[1:, 3:] = np.linalg.svd(normal[None])[2][1:]
    shadow = hypothesis.freedoms @ expected.T
    np.testing.assert_allclose(shadow @ shadow.T, np.eye(3), atol=1e-3)


def test_two_faces_leave_a_shift_along_their_common_line() -> None:
    first, second = 1, 2
    line = np.cross(WEDGE.normals[first], WEDGE.normals[second])
    line /= np.linalg.norm(line)
    hypothesis, _ = hypothesis_of(WEDGE, [first, second] * 6)
    assert hypothesis.freedoms.shape == (1, 6)
    np.testing.assert_allclose(hypothesis.freedoms[0, :3], 0.0, atol=1e-3)
    assert abs(hypothesis.freedoms[0, 3:] @ line) == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize("faces", [[0] * 8, [1] * 8, [0, 3] * 5, [1, 2] * 5])
def test_a_small_motion_along_a_freedom_changes_no_reading(faces: list[int]) -> None:
    hypothesis, contacts = hypothesis_of(WEDGE, faces)
    radius = WEDGE.diameter / 2.0
    normals, offsets = WEDGE.normals[faces], WEDGE.offsets[faces]
    count = len(hypothesis.freedoms)
    assert count > 0
    np.testing.assert_allclose(
        hypothesis.freedoms @ hypothesis.freedoms.T, np.eye(count), atol=1e-9
    )

    def readings(step: NDArray[np.float64]) -> NDArray[np.float64]:
        spin = Rotation.from_rotvec(step[:3] / radius)
        shift = WEDGE.centroid + step[3:] - spin.apply(WEDGE.centroid.copy())
        moved = hypothesis.pose * RigidTransform.from_components(shift, spin)
        R, t = moved.rotation.as_matrix(), moved.translation
        heights = ((contacts.positions - t) @ R * normals).sum(axis=1) - offsets
        return np.r_[heights / radius, ((contacts.normals @ R) - normals).ravel()]

    at_rest = readings(np.zeros(6))
    for freedom in hypothesis.freedoms:
        for share in (0.01, -0.01):
            change = np.abs(readings(share * radius * freedom) - at_rest).max()
            assert change < 2.0 * share**2  # second order
    # A motion across the freedoms shows at first order.
    across = np.linalg.svd(hypothesis.freedoms)[2][count:]
    for motion in across:
        assert np.abs(readings(0.01 * radius * motion) - at_rest).max() > 2e-3


def test_what_a_freedom_is_depends_on_the_tolerance() -> None:
    rng = np.random.default_rng(5)
    touches = touch_faces(CUBE, rng, faces_along(CUBE, "xyz" * 4))
    contacts = feel(touches, rng, 0.001, 0.2)
    poses = Fitter(CUBE).run(touches.faces[None], contacts)
    for tolerance, determined in (
        (PoseTolerance(rotation=0.5, translation=0.5), True),
        (PoseTolerance(rotation=1e-4, translation=1e-4, position_errors=1e-4), False),
    ):
        (hypothesis,), _ = cluster(CUBE, poses, tolerance, 0.001)
        assert hypothesis.determined == determined
