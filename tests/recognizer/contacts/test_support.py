"""The support plane: which faces a solid can stand on, and what standing says of one."""

from __future__ import annotations

from dataclasses import FrozenInstanceError
from itertools import combinations
from typing import Any

import numpy as np
import pytest
from helpers.sensing import CUBE, SMALL, feel, solid, touch_faces
from numpy.typing import NDArray
from oracles import solids as oracles
from oracles.geometry import angle_between
from scipy.spatial import ConvexHull
from scipy.spatial.transform import RigidTransform, Rotation

from palpate.recognizer import Contacts, Polyhedron, SupportPlane
from palpate.recognizer.contacts.support import (
    FOOTING,
    StableFace,
    hull_corners,
    stable_faces,
)
from palpate.recognizer.models.features import face_features, with_squares

Floats = NDArray[np.float64]

OTHERS = ("l-block", "bridge", "tetrahedron", "hull-20", "housing", "stapler", "simple-hand")


# Faces to stand on


def standing_corners(model: Polyhedron, tilt: float = 1e-4) -> list[NDArray[np.intp]]:
    """The vertices of each face of the convex hull that a solid can stand on.

    All planes through three vertices that have all others on one side are faces. The solid can
    stand on one if every small tilt raises its centroid, to rounding.
    """
    points = model.vertices - model.centroid
    slack = 1e-6 * model.diameter
    found: dict[frozenset[int], NDArray[np.intp]] = {}
    triples = np.array(list(combinations(range(len(points)), 3)))
    for part in np.array_split(triples, -(-len(triples) // 20_000)):
        normals = np.cross(
            points[part[:, 1]] - points[part[:, 0]], points[part[:, 2]] - points[part[:, 0]]
        )
        lengths = np.linalg.norm(normals, axis=1)
        thick = lengths > 1e-4 * model.diameter**2
        normals = normals[thick] / lengths[thick, None]
        heights = normals @ points.T
        heights -= (normals * points[part[thick, 0]]).sum(axis=1)[:, None]
        for sign in (1.0, -1.0):
            for row in np.flatnonzero((sign * heights < slack).all(axis=1)):
                members = np.flatnonzero(np.abs(heights[row]) < slack)
                if frozenset(members.tolist()) in found:
                    continue
                # Which way is down, a little off the face's normal: all around it.
                helper = np.eye(3)[np.abs(normals[row]).argmin()]
                one = np.cross(normals[row], helper)
                one /= np.linalg.norm(one)
                other = np.cross(normals[row], one)
                around = np.linspace(0.0, 2.0 * np.pi, 720, endpoint=False)[:, None]
                lean = np.cos(around) * one + np.sin(around) * other
                down = sign * normals[row] + tilt * lean
                down /= np.linalg.norm(down, axis=1, keepdims=True)
                above = (points @ (sign * normals[row])).max()
                # To second order in the tilt, standing over an edge loses half its square.
                if ((points @ down.T).max(axis=0) > above * (1.0 - tilt**2)).all():
                    found[frozenset(members.tolist())] = members
    return list(found.values())


@pytest.mark.parametrize("name", [*SMALL, *OTHERS])
def test_a_solid_stands_on_those_faces_where_every_small_tilt_raises_its_centroid(
    name: str,
) -> None:
    model = solid(name)
    faces = stable_faces(model)
    assert faces

    def corners(points: Floats) -> tuple[tuple[float, ...], ...]:
        return tuple(sorted(map(tuple, (points / model.diameter).round(5).tolist())))

    expected = set()
    for members in standing_corners(model):
        points = model.vertices[members]
        middle = points.mean(axis=0)
        flat = np.linalg.svd(points - middle)[2][:2]
        outline = ConvexHull((points - middle) @ flat.T).vertices
        expected.add(corners(points[outline]))
    assert {corners(face.corners) for face in faces} == expected


@pytest.mark.parametrize("name", [*SMALL, *OTHERS])
def test_a_face_to_stand_on_has_its_plane_outline_and_width(name: str) -> None:
    model = solid(name)
    faces = stable_faces(model)
    assert faces
    for face in faces:
        assert np.linalg.norm(face.normal) == pytest.approx(1.0)
        heights = model.vertices @ face.normal - face.offset
        assert heights.max() <= 1e-12
        assert np.abs(face.corners @ face.normal - face.offset).max() < 1e-5 * model.diameter
        axis = np.eye(3)[np.abs(face.normal).argmin()]
        one = np.cross(face.normal, axis)
        one /= np.linalg.norm(one)
        around = np.linspace(0.0, np.pi, 2000)[:, None]
        aside = np.cos(around) * one + np.sin(around) * np.cross(face.normal, one)
        least = float(np.ptp(face.corners @ aside.T, axis=0).min())
        # Never wider than it is, by the little that corners may be off the plane less.
        assert face.width <= least
        assert face.width > 0.99 * least - 1e-5 * model.diameter


def sheared(shift: float) -> Polyhedron:
    """A block whose top is shifted: its centroid is half as far over the edge of its base."""
    mesh = oracles.box(0.02, 0.02, 0.04)
    mesh.vertices = mesh.vertices + np.outer(mesh.vertices[:, 2] / 0.04 * shift, [1.0, 0.0, 0.0])
    return Polyhedron.from_mesh(mesh, name="sheared")


@pytest.mark.parametrize(("shift", "stands"), [(0.0, True), (0.0199, True), (0.0201, False)])
def test_a_block_sheared_too_far_falls_over(shift: float, stands: bool) -> None:
    normals = np.array([face.normal for face in stable_faces(sheared(shift))])
    assert (normals[:, 2] < -0.999).any() == stands


def test_a_block_on_the_verge_of_falling_over_may_still_stand() -> None:
    normals = np.array([face.normal for face in stable_faces(sheared(0.02))])
    assert (normals[:, 2] < -0.999).any()


def test_a_cube_stands_on_all_its_sides_and_a_bridge_on_both_feet_at_once() -> None:
    assert len(stable_faces(CUBE)) == 6
    widths = sorted(face.width for face in stable_faces(CUBE))
    np.testing.assert_allclose(widths, 0.04, rtol=1e-5)
    bridge = oracles.model("bridge")
    low = [face for face in stable_faces(bridge) if face.normal[2] < -0.999]
    assert len(low) == 1
    np.testing.assert_allclose(np.ptp(low[0].corners, axis=0), [3.5, 1.0, 0.0], atol=1e-12)


def test_the_corners_of_a_hull_are_those_no_other_vertices_make_up() -> None:
    block = SMALL["L-block"]
    corners = hull_corners(block)
    assert len(corners) == 10
    assert not (np.abs(corners - [0.02, 0.02, 0.0]).max(axis=1) < 1e-12).any()


# What standing says


def tilted(
    face: StableFace, error: float, rng: np.random.Generator, *, at_bounds: bool
) -> tuple[RigidTransform, SupportPlane]:
    """A pose with all corners of a face within the bound of a plane, and that plane."""
    up = rng.normal(size=3)
    up /= np.linalg.norm(up)
    flat = np.linalg.svd(face.corners - face.corners.mean(axis=0))[2][:2]
    angle = rng.uniform(0.0, 2.0 * np.pi)
    aside = np.cos(angle) * flat[0] + np.sin(angle) * flat[1]
    if at_bounds and rng.random() < 0.5:
        # Over its least width, where it tilts most.
        around = np.linspace(0.0, np.pi, 500)[:, None]
        every = np.cos(around) * flat[0] + np.sin(around) * flat[1]
        aside = every[np.ptp(face.corners @ every.T, axis=0).argmin()]
    share = 1.0 - 1e-9 if at_bounds else rng.random()
    turn = np.arcsin(2.0 * error * share / np.ptp(face.corners @ aside))
    down = np.cos(turn) * face.normal + np.sin(turn) * aside
    rotation = Rotation.from_rotvec(rng.uniform(0.0, 2.0 * np.pi) * up)
    rotation = rotation * Rotation.align_vectors(-up[None], down[None])[0]
    pose = RigidTransform.from_components(rng.uniform(-0.5, 0.5, 3), rotation)
    heights = pose.apply(face.corners) @ up
    spare = 2.0 * error - np.ptp(heights)
    height = 0.5 * (heights.min() + heights.max()) + rng.uniform(-0.5, 0.5) * spare
    normal = (float(up[0]), float(up[1]), float(up[2]))
    support = SupportPlane(height=float(height), error=error, normal=normal, resting=True)
    assert np.abs(heights - height).max() <= error * (1.0 + 1e-9)
    return pose, support


@pytest.mark.parametrize("outliers", [0, 2])
@pytest.mark.parametrize("name", [*SMALL, "housing", "hull-20"])
def test_standing_is_a_contact_whose_bounds_hold(name: str, outliers: int) -> None:
    model = solid(name)
    features, faces = face_features(model), stable_faces(model)
    normals = np.array([face.normal for face in faces])
    heights = np.array([face.offset for face in faces]) - normals @ model.centroid
    middles = model.centroid + heights[:, None] * normals
    squares = with_squares(features, normals, middles, FOOTING * model.diameter)
    rng = np.random.default_rng(4)
    tightest = 0.0
    for case in range(200):
        which = int(rng.integers(len(faces)))
        face = faces[which]
        error = 0.24 * face.width * 10.0 ** rng.uniform(-3.0, 0.0)
        pose, support = tilted(face, error, rng, at_bounds=case % 3 == 0)
        touches = touch_faces(model, rng, rng.integers(model.face_count, size=5).tolist(), pose)
        position_error = model.diameter * 10.0 ** rng.uniform(-4.0, 0.0)
        contacts = feel(touches, rng, position_error, 0.2, at_bounds=case % 3 == 0)
        if outliers:
            strays = contacts.positions.copy()
            strays[:outliers] += 50.0 * model.diameter * rng.normal(size=(outliers, 3))
            contacts = Contacts(
                strays, contacts.normals, position_error=position_error, normal_error=0.2
            )
        touch = support.touch(face, model.diameter, contacts, outliers)
        assert touch is not None
        foot = pose.inv().apply(touch.positions[0].copy())
        normal = pose.rotation.inv().apply(touch.normals[0].copy())
        assert abs((touch.positions[0] @ support.up) - support.height) < 1e-9
        turned = float(angle_between(normal, face.normal))
        assert turned <= touch.normal_error[0] + 1e-9
        tightest = max(tightest, turned / float(touch.normal_error[0]))
        # From the square that stands for the face's plane.
        away = abs(foot @ face.normal - face.offset)
        feature = model.face_count + which
        square = squares.corners[squares.start[feature] : squares.start[feature + 1]]
        np.testing.assert_allclose(square @ face.normal, face.offset, atol=1e-9 * model.diameter)
        for one, other in zip(square, np.roll(square, -1, axis=0), strict=True):
            inwards = np.cross(face.normal, other - one)
            assert (foot - one) @ inwards > 0.0
        assert away <= touch.position_error[0]
    assert tightest > 0.9


def test_standing_says_nothing_where_bounds_are_too_wide() -> None:
    face = stable_faces(CUBE)[0]
    contacts = feel(
        touch_faces(CUBE, np.random.default_rng(5), [0, 1, 2]), np.random.default_rng(6), 1e-3, 0.2
    )
    tight = SupportPlane(error=1e-3, resting=True)
    assert tight.touch(face, CUBE.diameter, contacts, 1) is not None
    assert tight.touch(face, CUBE.diameter, contacts, 2) is None
    wide = SupportPlane(error=0.011, resting=True)
    assert wide.touch(face, CUBE.diameter, contacts, 0) is None
    vague = Contacts(contacts.positions, position_error=1.0)
    assert tight.touch(face, CUBE.diameter, vague, 0) is None


@pytest.mark.parametrize("name", [*SMALL, "tetrahedron"])
def test_squares_go_behind_the_features_and_leave_these_as_they_are(name: str) -> None:
    model = solid(name)
    features = face_features(model)
    rng = np.random.default_rng(7)
    normals = rng.normal(size=(3, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    middles = rng.normal(size=(3, 3))
    more = with_squares(features, normals, middles, 2.0)
    count = len(features)
    assert len(more) == count + 3
    assert (more.face_count, more.edge_count) == (features.face_count, features.edge_count)

    def polygons(of, feature: int) -> list[Floats]:
        rows = [feature, *range(of.first[feature], of.first[feature + 1])]
        return [of.corners[of.start[row] : of.start[row + 1]] for row in rows]

    for feature in range(count):
        for one, other in zip(polygons(features, feature), polygons(more, feature), strict=True):
            np.testing.assert_array_equal(one, other)
        np.testing.assert_array_equal(features.normals[feature], more.normals[feature])
    for k in range(3):
        hull, piece = polygons(more, count + k)
        np.testing.assert_array_equal(hull, piece)
        np.testing.assert_allclose(hull.mean(axis=0), middles[k], atol=1e-12)
        sides = np.roll(hull, -1, axis=0) - hull
        np.testing.assert_allclose(np.linalg.norm(sides, axis=1), 4.0)
        np.testing.assert_allclose((sides * np.roll(sides, 1, axis=0)).sum(axis=1), 0, atol=1e-12)
        # Counter-clockwise about the normal, as every polygon.
        turn = np.cross(sides[0], sides[1])
        np.testing.assert_allclose(turn / np.linalg.norm(turn), normals[k], atol=1e-12)
        np.testing.assert_array_equal(more.normals[count + k], normals[k])
        assert more.offsets[count + k] == pytest.approx(normals[k] @ middles[k])
        start = more.cone_start[count + k]
        assert more.cone_start[count + k + 1] == start + 1
        np.testing.assert_array_equal(more.cone_normals[start], normals[k])


# Errors at the door


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"height": np.nan}, r"height is nan; it must be finite"),
        ({"height": np.inf}, r"height is inf; it must be finite"),
        ({"error": 0.0}, r"error is 0.0; it must be above zero"),
        ({"error": -1e-3}, r"error is -0.001; it must be above zero"),
        ({"error": np.nan}, r"error is nan; it must be above zero"),
        ({"error": np.inf}, r"error is inf; it must be"),
        (
            {"normal": (0.0, 0.0, 2.0)},
            r"normal is \(0.0, 0.0, 2.0\); .* three numbers, of length 1",
        ),
        ({"normal": (0.0, 0.0, 0.0)}, r"normal is \(0.0, 0.0, 0.0\); .* length 1"),
        ({"normal": (0.0, 1.0)}, r"normal is \(0.0, 1.0\); .* three numbers"),
        ({"normal": (1.0, 0.0, 0.0, 0.0)}, r"normal is \(1.0, 0.0, 0.0, 0.0\); .* three numbers"),
        ({"normal": (np.nan, 0.0, 1.0)}, r"normal is \(nan, 0.0, 1.0\); .* three numbers"),
    ],
)
def test_what_cannot_be_a_support_is_refused_with_a_reason(change: dict, message: str) -> None:
    values: dict[str, Any] = {"error": 1e-3} | change
    with pytest.raises(ValueError, match=message):
        SupportPlane(**values)


def test_a_normal_rounded_as_text_is_made_unit() -> None:
    support = SupportPlane(error=1e-3, normal=(0.5773, 0.5774, 0.5774))
    assert abs(np.linalg.norm(support.up) - 1.0) < 1e-15


def test_a_support_can_not_be_changed() -> None:
    with pytest.raises(FrozenInstanceError):
        setattr(SupportPlane(error=1e-3), "height", 1.0)  # noqa: B010  pyright knows it too
