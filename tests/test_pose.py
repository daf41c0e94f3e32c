"""The model test: it keeps every interpretation that some pose satisfies, and only those."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import trimesh
from checker import angle_between, check, corners_of, triangle_distances
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.spatial.transform import RigidTransform, Rotation
from sensing import INCH, Touches, exact, feel, move, random_pose, sense_grid, touch_faces

from palpate.assets import STAND_IN_NAMES
from palpate.envs.library import load_library
from palpate.recognizer import Constraints, Contacts, PairTables, Polyhedron
from palpate.recognizer.ball_kernels import EXCLUDED, FOUND, OPEN, seek_in_ball
from palpate.recognizer.branch_kernels import _box_radius, align, rotation_at
from palpate.recognizer.fit_kernels import fit_pose
from palpate.recognizer.polygon_kernels import CORNER, EDGE, INSIDE, nearest_in_polygon
from palpate.recognizer.pose import ModelTest, Poses
from palpate.recognizer.tree import prune

ROWS = ((np.pi / 12, 0.01), (np.pi / 10, 0.01), (np.pi / 8, 0.05), (np.pi / 8, 0.1))
"""Bounds on normals (radians) and positions (inches)."""

STAND_INS = {model.name: model for model in load_library()}


def box(size: tuple[float, float, float], at: tuple[float, float, float] = (0.0, 0.0, 0.0)):
    mesh = trimesh.creation.box(size)
    mesh.apply_translation(at)
    return mesh


def prism(
    profile: list[tuple[float, float]], holes: list[list[tuple[float, float]]], height: float
):
    """A straight prism over a rectilinear profile, cut into the cells of its own grid."""
    xs = sorted({x for ring in [profile, *holes] for x, _ in ring})
    ys = sorted({y for ring in [profile, *holes] for _, y in ring})
    index = {corner: k for k, corner in enumerate(itertools.product(xs, ys))}
    layer = len(index)
    flat = np.array(list(index), dtype=float)
    vertices = np.vstack([np.c_[flat, np.zeros(layer)], np.c_[flat, np.full(layer, height)]])
    triangles: list[tuple[int, int, int]] = []
    sides: dict[tuple[int, int], None] = {}
    for (x0, x1), (y0, y1) in itertools.product(itertools.pairwise(xs), itertools.pairwise(ys)):
        middle = ((x0 + x1) / 2, (y0 + y1) / 2)
        if not _in_ring(middle, profile) or any(_in_ring(middle, hole) for hole in holes):
            continue
        a, b, c, d = (index[corner] for corner in ((x0, y0), (x1, y0), (x1, y1), (x0, y1)))
        triangles += [(a, c, b), (a, d, c)]
        triangles += [(a + layer, b + layer, c + layer), (a + layer, c + layer, d + layer)]
        for side in ((a, b), (b, c), (c, d), (d, a)):
            back = (side[1], side[0])
            if back in sides:
                del sides[back]
            else:
                sides[side] = None
    for a, b in sides:
        triangles += [(a, b, b + layer), (a, b + layer, a + layer)]
    return trimesh.Trimesh(vertices, triangles)


def _in_ring(point: tuple[float, float], ring: list[tuple[float, float]]) -> bool:
    inside = False
    for (x0, y0), (x1, y1) in zip(ring, ring[1:] + ring[:1], strict=True):
        if (y0 > point[1]) != (y1 > point[1]):
            inside ^= point[0] < x0 + (point[1] - y0) * (x1 - x0) / (y1 - y0)
    return inside


def rectangle(x0: float, y0: float, x1: float, y1: float) -> list[tuple[float, float]]:
    return [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]


CUBE = Polyhedron.from_mesh(box((0.04, 0.04, 0.04)), name="cube")
L_BLOCK = Polyhedron.from_mesh(
    prism([(0, 0), (0.06, 0), (0.06, 0.02), (0.02, 0.02), (0.02, 0.05), (0, 0.05)], [], 0.03),
    name="L-block",
)
HOLED = Polyhedron.from_mesh(
    prism(rectangle(0, 0, 0.08, 0.06), [rectangle(0.02, 0.015, 0.06, 0.045)], 0.025), name="holed"
)
SMALL = {model.name: model for model in (CUBE, L_BLOCK, HOLED)}


def pose_of(poses: Poses, row: int) -> RigidTransform:
    return RigidTransform.from_components(
        poses.translations[row], Rotation.from_matrix(poses.rotations[row])
    )


def centroid_and_turn_errors(
    model: Polyhedron, pose: RigidTransform, truth: RigidTransform
) -> tuple[float, float]:
    shift = np.linalg.norm(pose.apply(model.centroid) - truth.apply(model.centroid))
    return float(shift), float((pose.rotation.inv() * truth.rotation).magnitude())


def face_with_normal(model: Polyhedron, direction: tuple[float, float, float], nth: int = 0) -> int:
    return int(np.flatnonzero(model.normals @ direction > 0.999)[nth])


# The samples themselves


def test_the_small_objects_are_what_they_are_called() -> None:
    assert [model.face_count for model in SMALL.values()] == [6, 8, 10]
    assert [len(model.symmetries) for model in SMALL.values()] == [24, 1, 4]
    assert len(HOLED.pieces.start) > len(HOLED.hulls.start)


@pytest.mark.parametrize("name", STAND_IN_NAMES)
def test_the_checker_passes_the_truth_and_fails_a_pose_one_bound_off(name: str) -> None:
    model, rng = STAND_INS[name], np.random.default_rng(1)
    for at_bounds in (False, True):
        touches = sense_grid(model, rng)
        contacts = feel(touches, rng, 0.001, 0.1, at_bounds=at_bounds)
        assert check(model, touches.T_world_object, contacts, touches.faces).passed
        far = RigidTransform.from_translation(0.0021 * touches.normals[0]) * touches.T_world_object
        assert not check(model, far, contacts, touches.faces).within[0]
        wrong = np.full_like(touches.faces, touches.faces[0])
        assert not check(model, touches.T_world_object, contacts, wrong).passed


def test_noise_at_the_bounds_is_at_the_bounds() -> None:
    rng = np.random.default_rng(2)
    touches = sense_grid(CUBE, rng, 3, 9)
    contacts = feel(touches, rng, 0.002, 0.3, at_bounds=True)
    apart = np.linalg.norm(contacts.positions - touches.points, axis=1)
    np.testing.assert_allclose(apart, 0.002, rtol=1e-9)
    np.testing.assert_allclose(angle_between(contacts.normals, touches.normals), 0.3, atol=1e-8)


# What is true survives


@pytest.mark.parametrize("row", ROWS, ids=lambda row: f"pi:{np.pi / row[0]:.0f}-{row[1]}in")
@pytest.mark.parametrize("name", STAND_IN_NAMES)
def test_the_true_interpretation_is_never_rejected_and_gets_a_pose(
    name: str, row: tuple[float, float]
) -> None:
    model, test = STAND_INS[name], ModelTest(STAND_INS[name])
    rng = np.random.default_rng([3, STAND_IN_NAMES.index(name), ROWS.index(row)])
    proven = 0
    for case in range(36):
        touches = sense_grid(model, rng, *((3, 9) if case % 2 else (10, 20)))
        contacts = feel(touches, rng, row[1] * INCH, row[0], at_bounds=case % 3 == 0)
        poses = test.run(touches.faces[None], contacts)
        assert len(poses) == 1, f"case {case}: the truth was rejected"
        if poses.proven[0]:
            proven += 1
            assert check(model, pose_of(poses, 0), contacts, touches.faces).passed
    assert proven >= 34


@pytest.mark.parametrize("count", [1, 2, 3])
def test_very_few_contacts_keep_the_truth_too(count: int) -> None:
    rng = np.random.default_rng([4, count])
    for model in (*SMALL.values(), STAND_INS["stapler"]):
        test = ModelTest(model)
        for case in range(40):
            faces = rng.integers(model.face_count, size=count).tolist()
            touches = touch_faces(model, rng, faces)
            contacts = feel(touches, rng, 0.001, 0.3, at_bounds=case % 2 == 0)
            poses = test.run(touches.faces[None], contacts)
            assert len(poses) == 1
            if poses.proven[0]:
                assert check(model, pose_of(poses, 0), contacts, touches.faces).passed


@pytest.mark.parametrize("name", STAND_IN_NAMES)
def test_the_test_within_the_tree_and_one_without_time_keep_the_truth_too(name: str) -> None:
    model, rng = STAND_INS[name], np.random.default_rng(19)
    test, hasty = ModelTest(model), ModelTest(model, boxes=1, pool=1)
    for case in range(20):
        touches = sense_grid(model, rng, 4, 12)
        contacts = feel(touches, rng, 0.05 * INCH, np.pi / 8, at_bounds=case % 2 == 0)
        for count in range(1, len(contacts) + 1, 3):
            faces = touches.faces[None, :count]
            assert len(test.prune(faces, contacts[:count])) == 1
            assert len(hasty.prune(faces, contacts[:count])) == 1
            assert len(hasty.run(faces, contacts[:count])) == 1


def test_the_test_within_the_tree_drops_nothing_that_the_last_one_keeps() -> None:
    rng, test, tables = np.random.default_rng(20), ModelTest(L_BLOCK), PairTables.of(L_BLOCK)
    dropped = 0
    for _ in range(10):
        touches = touch_faces(L_BLOCK, rng, rng.integers(8, size=5).tolist())
        contacts = feel(touches, rng, 0.001, 0.3)
        candidates = prune(tables, contacts, constraints=Constraints(component=False)).faces
        within = {tuple(row) for row in test.prune(candidates, contacts).tolist()}
        assert within >= {tuple(row) for row in test.run(candidates, contacts).faces.tolist()}
        dropped += len(candidates) - len(within)
    assert dropped > 0


@pytest.mark.parametrize("normal_error", [np.pi, 0.9 * np.pi, np.pi / 2])
def test_a_contact_whose_normal_is_hardly_known_still_counts_by_its_position(
    normal_error: float,
) -> None:
    rng = np.random.default_rng(5)
    test = ModelTest(L_BLOCK)
    for _ in range(25):
        touches = touch_faces(L_BLOCK, rng, rng.integers(8, size=5).tolist())
        contacts = feel(touches, rng, 0.001, normal_error)
        poses = test.run(touches.faces[None], contacts)
        assert len(poses) == 1
        if poses.proven[0]:
            assert check(L_BLOCK, pose_of(poses, 0), contacts, touches.faces).passed


@pytest.mark.parametrize("edge", [0.0, 1e-9, 1e-15])
def test_normals_spread_evenly_about_a_face_at_the_edge_of_their_cone_fit_it(edge: float) -> None:
    # Their mean is the face's normal, so the best rotation uses the whole allowance for misfit.
    rng = np.random.default_rng(6)
    test = ModelTest(CUBE)
    top = face_with_normal(CUBE, (0, 0, 1))
    for count, half_angle in itertools.product((2, 3, 4, 7), (0.01, 0.3, 1.0)):
        touches = touch_faces(CUBE, rng, [top] * count)
        around = 2.0 * np.pi * np.arange(count) / count
        tilt = half_angle - edge
        in_object = np.column_stack(
            [np.sin(tilt) * np.cos(around), np.sin(tilt) * np.sin(around), [np.cos(tilt)] * count]
        )
        contacts = Contacts(
            touches.points,
            touches.T_world_object.rotation.apply(in_object),
            position_error=0.001,
            normal_error=half_angle,
        )
        assert len(test.run(touches.faces[None], contacts)) == 1


@pytest.mark.parametrize("edge", [0.0, 1e-15, -1e-15, -1e-9])
def test_an_allowance_for_misfit_that_is_used_up_exactly_breaks_nothing(edge: float) -> None:
    # As above on two faces, which leaves a single rotation; then one reading too far out.
    rng, test, half_angle = np.random.default_rng(6), ModelTest(CUBE), 0.3
    faces = [face_with_normal(CUBE, axis) for axis in ((0, 0, 1), (1, 0, 0)) for _ in range(3)]
    for _ in range(10):
        touches = touch_faces(CUBE, rng, faces)
        tilted = []
        for face in faces[::3]:
            normal, tilt = CUBE.normals[face], half_angle - edge
            across = np.roll(normal, 1)
            around = 2.0 * np.pi * np.arange(3)[:, None] / 3 + rng.random()
            tangents = np.cos(around) * across + np.sin(around) * np.cross(normal, across)
            tilted.append(np.cos(tilt) * normal + np.sin(tilt) * tangents)
        contacts = Contacts(
            touches.points,
            touches.T_world_object.rotation.apply(np.vstack(tilted)),
            position_error=0.001,
            normal_error=half_angle,
        )
        assert len(test.run(touches.faces[None], contacts)) == 1
        apart = contacts.positions.copy()
        apart[0] += 0.004 * touches.normals[0]
        apart[1] -= 0.004 * touches.normals[0]
        too_far = Contacts(apart, contacts.normals, position_error=0.001, normal_error=half_angle)
        assert len(test.run(touches.faces[None], too_far)) == 0


@pytest.mark.parametrize("scale", [1e-3, 1e3])
def test_the_size_of_an_object_does_not_matter(scale: float) -> None:
    mesh = trimesh.Trimesh(scale * HOLED.vertices, HOLED.triangles)
    model = Polyhedron.from_mesh(mesh, name="scaled")
    test, rng = ModelTest(model), np.random.default_rng(7)
    for case in range(20):
        touches = sense_grid(model, rng, 5, 12)
        contacts = feel(touches, rng, 5e-4 * scale, 0.3, at_bounds=case % 2 == 0)
        poses = test.run(touches.faces[None], contacts)
        assert len(poses) == 1
        assert poses.proven[0]
        assert check(model, pose_of(poses, 0), contacts, touches.faces).passed


# What is proven holds


@pytest.mark.parametrize("name", STAND_IN_NAMES)
def test_every_proven_pose_meets_every_bound(name: str) -> None:
    model, rng = STAND_INS[name], np.random.default_rng(8)
    tables, test = PairTables.of(model), ModelTest(model)
    checked = 0
    for case in range(6):
        touches = sense_grid(model, rng, 4, 12)
        contacts = feel(touches, rng, (0.1, 0.01)[case % 2] * INCH, np.pi / 8)
        candidates = prune(tables, contacts, budget=3000).faces
        poses = test.run(candidates, contacts)
        rows = np.flatnonzero(poses.proven)
        for row in rng.permutation(rows)[:25]:
            assert check(model, pose_of(poses, row), contacts, poses.faces[row]).passed
            checked += 1
    assert checked > 10


def test_kept_interpretations_keep_their_order_and_the_rest_is_gone() -> None:
    rng = np.random.default_rng(9)
    touches = touch_faces(L_BLOCK, rng, [0, 3, 5, 6])
    contacts = feel(touches, rng, 1e-4, 0.05)
    wrong = np.array([[0, 0, 0, 0]], np.int32)
    poses = ModelTest(L_BLOCK).run(np.vstack([wrong, touches.faces[None], wrong]), contacts)
    np.testing.assert_array_equal(poses.faces, touches.faces[None])
    assert len(poses.take(np.array([], np.intp))) == 0
    assert len(ModelTest(L_BLOCK).run(wrong, contacts)) == 0


# What is rejected is impossible: an oracle that looks for poses everywhere


class Oracle:
    """Looks for a pose that meets an interpretation's bounds, by least squares from many starts."""

    def __init__(self, model: Polyhedron, contacts: Contacts, faces: NDArray[np.integer]) -> None:
        most = max(len(corners_of(model, int(face))) for face in faces)
        # A face of fewer triangles repeats its first one.
        self.triangles = np.empty((len(faces), most, 3, 3))
        for row, face in enumerate(faces):
            corners = corners_of(model, int(face))
            self.triangles[row] = corners[0]
            self.triangles[row, : len(corners)] = corners
        self.normals = model.normals[faces]
        self.middles = np.array([corners_of(model, int(face)).mean((0, 1)) for face in faces])
        self.contacts = contacts
        self.size = model.diameter

    def excesses(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """(k, 2n) readings at poses (k, 6) as shares of their bounds, minus 1."""
        contacts = self.contacts
        turns = Rotation.from_rotvec(x[:, :3]).as_matrix()
        points = (contacts.positions - self.size * x[:, None, 3:]) @ turns
        distances = triangle_distances(points[:, :, None], self.triangles).min(-1)
        angles = angle_between(contacts.normals @ turns, self.normals)
        return (
            np.hstack([distances / contacts.position_error, angles / contacts.normal_error]) - 1.0
        )

    def violations(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """What is left to go to a hair inside the bounds, which can be reached, not just neared."""
        return np.maximum(self.excesses(x[None])[0] + 1e-4, 0.0)

    def slopes(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        nudges = 1e-7 * np.vstack([np.eye(6), -np.eye(6)])
        values = np.maximum(self.excesses(x + nudges) + 1e-4, 0.0)
        return (values[:6] - values[6:]).T / 2e-7

    def starts(self, rng: np.random.Generator, count: int) -> NDArray[np.float64]:
        """Poses near the rotation that the normals ask for, and anywhere."""
        normals = self.contacts.normals + 1e-9 * rng.normal(size=self.contacts.normals.shape)
        best = _aligned(normals, self.normals)
        found = np.empty((count, 6))
        for k in range(count):
            near = Rotation.from_rotvec(rng.normal(size=3) * self.contacts.normal_error.max())
            turn = Rotation.random(rng=rng) if k % 3 == 2 else best * near
            gaps = self.contacts.positions - turn.apply(self.middles)
            found[k] = np.r_[turn.as_rotvec(), gaps.mean(axis=0) / self.size]
        return found

    def finds_a_pose(self, rng: np.random.Generator, count: int = 24) -> bool:
        for start in self.starts(rng, count):
            result = least_squares(self.violations, start, jac=self.slopes, max_nfev=40)  # pyright: ignore[reportArgumentType]  a callable is documented
            if (self.excesses(result.x[None]) <= 0.0).all():
                return True
        return False


def _aligned(measured: NDArray[np.float64], normals: NDArray[np.float64]) -> Rotation:
    u, _, vt = np.linalg.svd(measured.T @ normals)
    return Rotation.from_matrix(u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt)


def verdicts(
    model: Polyhedron, seed: int, wanted: int
) -> list[tuple[Contacts, NDArray[np.int32], bool]]:
    """Interpretations near the line between possible and not, with whether the test keeps them."""
    rng, tables, test = np.random.default_rng(seed), PairTables.of(model), ModelTest(model)
    kept, rejected = [], []
    loose = Constraints(component=False)
    while min(len(kept), len(rejected)) < wanted:
        count = int(rng.integers(3, 6))
        touches = touch_faces(model, rng, rng.integers(model.face_count, size=count).tolist())
        contacts = feel(touches, rng, 0.0025, 0.35)
        # Pulled apart or together a little, so that even the truth may have become impossible.
        middle = contacts.positions.mean(axis=0)
        stretched = Contacts(
            middle + rng.uniform(0.85, 1.2) * (contacts.positions - middle),
            contacts.normals,
            position_error=contacts.position_error,
            normal_error=contacts.normal_error,
        )
        candidates = prune(tables, stretched, constraints=loose, budget=2000).faces
        survivors = {tuple(row) for row in test.run(candidates, stretched).faces.tolist()}
        for keeps in (False, True):
            rows = [row for row in candidates if (tuple(row.tolist()) in survivors) == keeps]
            for row in rng.permutation(len(rows))[:2]:
                (kept if keeps else rejected).append((stretched, rows[row], keeps))
    return kept[:wanted] + rejected[:wanted]


@pytest.mark.parametrize("name", SMALL)
def test_no_pose_is_found_for_what_the_test_rejects_and_poses_are_for_what_it_keeps(
    name: str,
) -> None:
    model, rng = SMALL[name], np.random.default_rng(11)
    cases = verdicts(model, seed=10, wanted=10)
    found = 0
    for contacts, faces, keeps in cases:
        possible = Oracle(model, contacts, faces).finds_a_pose(rng)
        assert keeps or not possible, f"{faces} was rejected, and a pose meets its bounds"
        found += possible
    # The oracle is no straw man: it finds nearly all that there is.
    assert found >= 8


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("name", SMALL)
def test_no_pose_is_found_for_many_that_the_test_rejects(name: str, seed: int) -> None:
    model, rng = SMALL[name], np.random.default_rng(seed)
    for contacts, faces, keeps in verdicts(model, seed=100 + seed, wanted=60):
        if not keeps:
            assert not Oracle(model, contacts, faces).finds_a_pose(rng, 40)


# The parts of the proof, where a fit has not already found the pose


def bounds_of(contacts: Contacts) -> tuple[NDArray[np.float64], ...]:
    chords = 2.0 * np.sin(0.5 * contacts.normal_error)
    return contacts.positions, contacts.normals, contacts.position_error, chords


@pytest.mark.parametrize("name", ["L-block", "holed"])
def test_a_ball_of_rotations_that_holds_the_truth_is_never_excluded(name: str) -> None:
    model, rng = SMALL[name], np.random.default_rng(21)
    kernel_model = ModelTest(model)._model
    outcomes = {FOUND: 0, EXCLUDED: 0, OPEN: 0}
    for case in range(600):
        faces = rng.integers(model.face_count, size=int(rng.integers(3, 10)))
        touches = touch_faces(model, rng, faces.tolist())
        contacts = feel(
            touches, rng, rng.choice([1e-5, 1e-3]), rng.choice([0.01, 0.3]), at_bounds=case % 2 == 0
        )
        limit = rng.uniform(0.02, 1.4)
        axis = rng.normal(size=3)
        # At the edge of the ball half of the time, where the linear picture is worst.
        angle = limit * (1.0 - 1e-9 if case % 4 < 2 else rng.random())
        away = Rotation.from_rotvec(angle * axis / np.linalg.norm(axis))
        R = (touches.T_world_object.rotation * away).as_matrix()
        x = (
            contacts.positions - rng.normal(size=3) * 0.02 - touches.T_world_object.translation
        ) @ R
        outcome = seek_in_ball(
            x,
            contacts.normals @ R,
            x.mean(axis=0),
            limit,
            faces,
            faces,
            bounds_of(contacts),
            kernel_model,
            np.empty(7),
        )
        outcomes[outcome] += 1
    assert outcomes[EXCLUDED] == 0
    assert outcomes[FOUND] > 500


def test_a_small_ball_far_from_every_pose_is_excluded() -> None:
    rng = np.random.default_rng(22)
    excluded = 0
    for _ in range(50):
        touches = touch_faces(L_BLOCK, rng, list(range(8)))
        contacts = feel(touches, rng, 5e-4, 0.1)
        away = Rotation.from_rotvec(0.5 * np.array([0.6, 0.0, 0.8]))
        R = (touches.T_world_object.rotation * away).as_matrix()
        x = (contacts.positions - touches.T_world_object.translation) @ R
        outcome = seek_in_ball(
            x,
            contacts.normals @ R,
            x.mean(axis=0),
            0.05,
            touches.faces.astype(np.int64),
            touches.faces.astype(np.int64),
            bounds_of(contacts),
            ModelTest(L_BLOCK)._model,
            np.empty(7),
        )
        excluded += outcome == EXCLUDED
    assert excluded == 50


def test_no_rotation_of_a_box_is_farther_from_its_middle_than_the_box_says() -> None:
    rng = np.random.default_rng(23)
    vectors = np.linalg.qr(rng.normal(size=(4, 4)))[0]
    tightest = np.inf
    for _ in range(400):
        middle = rng.uniform(-1.0, 1.0, 3) * rng.choice([0.3, 1.0])
        half = rng.uniform(0.0, 1.0, 3) ** 2
        radius = _box_radius(middle, half)
        inside = middle + half * np.vstack([rng.uniform(-1, 1, (60, 3)), _SIGNS])
        inside = inside[(inside**2).sum(axis=1) <= 1.0]
        if radius < 0.0:
            assert len(inside) == 0
            continue
        centre, other = np.empty((3, 3)), np.empty((3, 3))
        rotation_at(middle, vectors, centre)
        assert np.linalg.det(centre) == pytest.approx(1.0)
        for point in inside:
            rotation_at(point, vectors, other)
            angle = np.arccos(np.clip((np.trace(centre.T @ other) - 1.0) / 2.0, -1.0, 1.0))
            assert angle <= radius + 1e-6
            tightest = min(tightest, radius - angle)
    assert tightest < 0.01  # and says hardly more than it must


_SIGNS = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))


def test_the_first_box_of_rotations_holds_the_truth() -> None:
    # What the normals allow is an ellipsoid about their best fit, on its principal axes.
    rng = np.random.default_rng(24)
    values, vectors = np.empty(4), np.empty((4, 4))
    nearest = np.inf
    for case in range(300):
        faces = rng.integers(8, size=int(rng.integers(1, 8)))
        touches = touch_faces(L_BLOCK, rng, faces.tolist())
        contacts = feel(touches, rng, 1e-3, rng.choice([0.1, 0.5]), at_bounds=case % 2 == 0)
        slack = align(faces, bounds_of(contacts), ModelTest(L_BLOCK)._model, values, vectors)[0]
        truth = np.roll(touches.T_world_object.rotation.as_quat(), 1)
        v = vectors[:, :3].T @ truth
        misfit = 2.0 * ((values[3] - values[:3]) * v**2).sum()
        assert misfit <= slack + 1e-7
        nearest = min(nearest, slack - misfit)
    assert nearest < 1e-3


# What a pose is


@pytest.mark.parametrize("name", STAND_IN_NAMES)
def test_moving_the_contacts_moves_the_poses(name: str) -> None:
    model, rng = STAND_INS[name], np.random.default_rng(12)
    test, tables = ModelTest(model), PairTables.of(model)
    compared = 0
    for _ in range(8):
        touches = sense_grid(model, rng)
        contacts = feel(touches, rng, 0.02 * INCH, np.pi / 12)
        motion = random_pose(rng)
        moved = move(motion, contacts)
        candidates = prune(tables, contacts, budget=200).faces
        before, after = test.run(candidates, contacts), test.run(candidates, moved)
        np.testing.assert_array_equal(before.faces, after.faces)
        for row in range(len(before)):
            if np.linalg.eigvalsh(before.informations[row])[0] < 1.0 / 0.003**2:
                continue  # not determined: any witness will do
            expected = motion * pose_of(before, row)
            shift, turn = centroid_and_turn_errors(model, pose_of(after, row), expected)
            assert shift < 1e-6
            assert turn < 1e-5
            compared += 1
    assert compared >= 6


@pytest.mark.parametrize("model", [*SMALL.values(), *STAND_INS.values()], ids=lambda m: m.name)
def test_exact_contacts_on_all_faces_give_the_pose_back(model: Polyhedron) -> None:
    rng, test = np.random.default_rng(13), ModelTest(model)
    for _ in range(3):
        touches = touch_faces(model, rng, list(range(model.face_count)))
        poses = test.run(touches.faces[None], exact(touches, 1e-6, 1e-3))
        assert poses.proven.all()
        shift, turn = centroid_and_turn_errors(model, pose_of(poses, 0), touches.T_world_object)
        assert shift < 1e-9
        assert turn < 1e-8
        assert poses.costs[0] < 1e-6


def test_the_fit_does_not_drift_along_a_free_direction() -> None:
    # A long bar, touched on its flanks only: nothing but the faces' ends bounds the slide.
    bar = Polyhedron.from_mesh(box((0.3, 0.02, 0.015)), name="bar")
    flanks = [face for face in range(6) if abs(bar.normals[face, 0]) < 0.5]
    test, rng = ModelTest(bar), np.random.default_rng(14)
    for case in range(60):
        faces = rng.choice(flanks, size=8).tolist()
        touches = touch_faces(bar, rng, faces)
        contacts = feel(touches, rng, 0.001, np.pi / 8, at_bounds=case % 3 == 0)
        poses = test.run(touches.faces[None], contacts)
        assert poses.proven.all()
        assert check(bar, pose_of(poses, 0), contacts, touches.faces).passed


def test_the_fit_brings_a_pose_back_that_slid_off_its_faces() -> None:
    # No plane says where along the bar the contacts are; only the ends of the flanks do.
    bar = Polyhedron.from_mesh(box((0.3, 0.02, 0.015)), name="bar")
    flanks = [face for face in range(6) if abs(bar.normals[face, 0]) < 0.5]
    touches = touch_faces(bar, np.random.default_rng(25), flanks * 10)
    contacts = exact(touches, 0.001, 0.1)
    for slide in (-0.1, 0.05, 0.2):
        start = touches.T_world_object * RigidTransform.from_translation([slide, 0.0, 0.0])
        rotation, translation = start.rotation.as_matrix(), start.translation.copy()
        felt = (*bounds_of(contacts)[:3], contacts.normal_error)
        fit_pose(touches.faces, felt, ModelTest(bar)._model, 20, rotation, translation)
        end = RigidTransform.from_components(translation, Rotation.from_matrix(rotation))
        assert not check(bar, start, contacts, touches.faces).passed
        assert check(bar, end, contacts, touches.faces, tolerance=0.05).passed


def test_two_contacts_farther_apart_than_a_face_is_long_are_not_both_on_it() -> None:
    bar = Polyhedron.from_mesh(box((0.3, 0.02, 0.015)), name="bar")
    top = face_with_normal(bar, (0, 0, 1))
    faces = np.array([[top, top]], np.int32)
    for length, kept in ((0.25, 1), (0.3, 1), (0.305, 0)):
        contacts = Contacts(
            [[0, 0, 0], [length, 0, 0]], [[0, 0, 1]] * 2, position_error=0.001, normal_error=0.1
        )
        # The face's diagonal is 0.30067; both bounds add to it.
        assert ModelTest(bar).run(faces, contacts).proven.sum() == kept


@pytest.mark.parametrize(("u", "kept"), [(0.04, 0), (0.0215, 0), (0.0205, 1), (0.01, 1)])
def test_a_contact_in_the_hole_of_a_face_is_not_on_that_face(u: float, kept: int) -> None:
    top = face_with_normal(HOLED, (0, 0, 1))
    sides = [face_with_normal(HOLED, s) for s in ((1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0))]
    # Of the two faces that look along each axis, take the outer one.
    outer = []
    for face in sides:
        alike = np.flatnonzero(HOLED.normals @ HOLED.normals[face] > 0.999)
        outer.append(int(alike[np.argmax(HOLED.offsets[alike])]))
    touches = touch_faces(HOLED, np.random.default_rng(15), [*outer, *outer, top, top, top])
    points = touches.T_world_object.inv().apply(touches.points)
    points = np.vstack([points, [[u, 0.03, 0.025]]])
    faces = np.append(touches.faces, top).astype(np.int32)
    for seed in range(3):
        pose = random_pose(np.random.default_rng(seed))
        again = Touches(pose, pose.apply(points), pose.rotation.apply(HOLED.normals[faces]), faces)
        contacts = exact(again, position_error=5e-4)
        assert len(ModelTest(HOLED).run(faces[None], contacts)) == kept


def test_a_contact_in_the_notch_of_a_concave_face_is_not_on_that_face() -> None:
    top = face_with_normal(L_BLOCK, (0, 0, 1))
    hull = L_BLOCK.hulls.corners[L_BLOCK.hulls.start[top] : L_BLOCK.hulls.start[top + 1]]
    notch = np.array([0.027, 0.027, 0.03])
    ahead = np.roll(hull, -1, axis=0) - hull
    assert ((np.cross(ahead, notch - hull) @ [0, 0, 1]) > 0.0).all()  # inside the hull
    others = [face for face in range(8) if face != top]
    touches = touch_faces(L_BLOCK, np.random.default_rng(16), others * 2, RigidTransform.identity())
    faces = np.append(touches.faces, top).astype(np.int32)
    for point, kept in ((notch, 0), (np.array([0.027, 0.01, 0.03]), 1)):
        again = Touches(
            touches.T_world_object,
            np.vstack([touches.points, point]),
            L_BLOCK.normals[faces],
            faces,
        )
        assert len(ModelTest(L_BLOCK).run(faces[None], exact(again, 5e-4))) == kept


def test_the_information_is_that_of_small_motions() -> None:
    # Against the second difference of a misfit written down anew.
    rng, model = np.random.default_rng(17), L_BLOCK
    touches = touch_faces(model, rng, [0, 1, 2, 3, 4, 5, 6, 7])
    contacts = exact(touches, 1e-3, 0.2)
    poses = ModelTest(model).run(touches.faces[None], contacts)
    radius, pose = model.diameter / 2.0, touches.T_world_object

    def misfit(step: NDArray[np.float64]) -> float:
        turn = Rotation.from_rotvec(step[:3] / radius)
        shift = model.centroid + step[3:] - turn.apply(model.centroid)
        moved = pose * RigidTransform.from_components(shift, turn)
        felt = move(moved.inv(), contacts)
        normals, offsets = model.normals[touches.faces], model.offsets[touches.faces]
        heights = (normals * felt.positions).sum(1) - offsets
        tilts = ((felt.normals - normals) ** 2).sum(1)
        return float((5.0 * heights**2 / 1e-3**2 + 4.0 * tilts / 0.2**2).sum())

    step = 1e-6
    axes = step * np.eye(6)
    expected = np.array(
        [
            [
                (misfit(a + b) - misfit(a - b) - misfit(b - a) + misfit(-a - b)) / (8.0 * step**2)
                for b in axes
            ]
            for a in axes
        ]
    )
    found = poses.informations[0]
    np.testing.assert_allclose(found, expected, atol=2e-3 * np.abs(expected).max())
    np.testing.assert_array_equal(found, found.T)


# Polygons


def _convex_polygon(rng: np.random.Generator) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    count = int(rng.integers(3, 9))
    around = np.sort(rng.uniform(0.0, 2.0 * np.pi, count))
    flat = np.column_stack([rng.uniform(0.02, 2.0) * np.cos(around), np.sin(around), 0 * around])
    turn = Rotation.random(rng=rng)
    return turn.apply(flat) + rng.normal(size=3), turn.apply([0.0, 0.0, 1.0])


def test_the_nearest_point_of_a_polygon_is_that_of_its_triangles() -> None:
    rng = np.random.default_rng(18)
    seen = {INSIDE: 0, EDGE: 0, CORNER: 0}
    for case in range(3000):
        polygon, normal = _convex_polygon(rng)
        weights = rng.dirichlet(np.ones(len(polygon)))
        point = weights @ polygon + rng.normal(size=3) * rng.choice([0.0, 0.1, 1.0])
        if case % 10 == 0:
            point = polygon[rng.integers(len(polygon))]  # a corner itself
        elif case % 10 == 1:
            point = polygon[:2].mean(axis=0) + rng.normal() * normal  # above an edge
        offset = float(normal @ polygon[0])
        padded = np.vstack([rng.normal(size=(2, 3)), polygon, rng.normal(size=(1, 3))])
        nearest = np.empty(3)
        squared, height, region = nearest_in_polygon(
            point, normal, offset, padded, 2, 2 + len(polygon), nearest
        )
        seen[region] += 1
        fan = np.array([polygon[[0, k, k + 1]] for k in range(1, len(polygon) - 1)])
        expected = triangle_distances(point[None], fan).min()
        assert np.sqrt(squared) == pytest.approx(expected, abs=1e-7)
        assert height == pytest.approx(normal @ point - offset, abs=1e-12)
        assert np.linalg.norm(point - nearest) == pytest.approx(expected, abs=1e-7)
        assert triangle_distances(nearest[None], fan).min() < 1e-7
    assert min(seen.values()) > 200
