"""Edges, vertices and symmetries of solids."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from helpers.sensing import CUBE, HOLED
from numpy.typing import NDArray
from oracles import solids as oracles
from oracles.checker import cone_of
from oracles.geometry import cone_angles, windings
from oracles.samples import direction

from palpate.recognizer import Polyhedron
from palpate.recognizer.models.features import Features, all_features, face_features
from palpate.recognizer.models.permutations import feature_permutations

Floats = NDArray[np.float64]


@pytest.mark.parametrize(
    ("name", "edges", "vertices"),
    [
        ("cube", 12, 8),
        ("tetrahedron", 6, 4),
        ("l-block", 17, 10),
        ("hull-20", 30, 12),
        ("pocketed", 16, 8),
    ],
)
def test_convex_edges_and_vertices_are_counted_and_concave_ones_are_not(
    name: str, edges: int, vertices: int
) -> None:
    model = oracles.model(name)
    features = all_features(model)
    kinds = Counter(features.kind(f) for f in range(len(features)))
    assert kinds == {"face": model.face_count, "edge": edges, "vertex": vertices}
    for f in range(model.face_count, len(features)):
        cone = cone_of(model, f, features)
        outwards = 1e-3 * model.diameter * cone.mean(axis=0)
        both = features.middles[f] + np.outer([1.0, -1.0], outwards)
        found = windings(model.vertices[model.triangles], both)
        np.testing.assert_allclose(found, [0.0, 1.0], atol=1e-6)
        assert np.arccos(cone @ features.normals[f]).max() == pytest.approx(features.half_angles[f])


def test_the_normals_of_a_cubes_vertex_are_those_of_its_three_faces() -> None:
    features = all_features(CUBE)
    for f in range(len(features)):
        cone, at = cone_of(CUBE, f, features), features.middles[f]
        faces = np.abs(CUBE.normals @ at - CUBE.offsets) < 1e-12
        assert len(cone) == faces.sum() == {"face": 1, "edge": 2, "vertex": 3}[features.kind(f)]
        assert all(
            np.abs(cone - normal).sum(axis=1).min() < 1e-12 for normal in CUBE.normals[faces]
        )


@pytest.mark.parametrize("name", ["tetrahedron", "hull-20", "hull-90"])
def test_the_cones_of_a_convex_solid_share_all_directions_among_them(name: str) -> None:
    model, rng = oracles.model(name), np.random.default_rng(20)
    features = all_features(model)
    vertices = [f for f in range(len(features)) if features.kind(f) == "vertex"]
    ways = np.array([direction(rng) for _ in range(300)])
    inside = np.array([cone_angles(ways, cone_of(model, f, features)) for f in vertices]) < 1e-9
    # A vertex is met from exactly those directions in which no other lies farther out.
    farthest = np.argmax(features.middles[vertices] @ ways.T, axis=0)
    np.testing.assert_array_equal(inside, np.arange(len(vertices))[:, None] == farthest)


@pytest.mark.parametrize(
    ("name", "size"), [("cube", 24), ("prism", 12), ("tetrahedron", 12), ("holed", 4)]
)
def test_symmetries_take_features_to_features(name: str, size: int) -> None:
    model = Polyhedron.from_mesh(oracles.prism(6, 0.7)) if name == "prism" else oracles.model(name)
    if name == "holed":
        model = HOLED
    for features in (face_features(model), all_features(model)):
        images, missed = feature_permutations(model, features)
        assert missed < 1e-9
        assert images.shape == (size, len(features))
        assert len(np.unique(images, axis=0)) == size
        np.testing.assert_array_equal(images[0], np.arange(len(features)))
        for turn, image in zip(model.symmetries, images, strict=True):
            np.testing.assert_array_equal(np.sort(image), np.arange(len(features)))
            for f, g in enumerate(image):
                assert features.kind(f) == features.kind(g)
                for corners in (corners_at(features, f) - model.centroid,):
                    moved = corners @ turn.T + model.centroid
                    apart = np.linalg.norm(moved[:, None] - corners_at(features, g), axis=2)
                    assert apart.min(axis=1).max() < 1e-9
                cones = cone_of(model, f, features) @ turn.T, cone_of(model, g, features)
                assert np.linalg.norm(cones[0][:, None] - cones[1], axis=2).min(axis=1).max() < 1e-9


def corners_at(features: Features, f: int) -> Floats:
    return features.corners[features.start[f] : features.start[f + 1]]
