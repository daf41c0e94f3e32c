"""Random libraries: closed solids of fit sizes, the same for a seed, twins near but not equal."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
import typer
from oracles.solids import hull_of

from palpate.recognizer import Polyhedron, load_folder
from palpate.scripts.lab.random_library import (
    FEWEST_FACES,
    LARGEST,
    MOST_FACES,
    SMALLEST,
    TWIN_EVERY,
    large_solids,
    main,
    random_library,
    write_library,
)
from palpate.scripts.lab.random_solids import FAMILIES, cell_solid, convex_solid


def library(count: int, seed: int = 0) -> tuple[Polyhedron, ...]:
    return random_library(count, np.random.default_rng(seed))


def test_solids_are_closed_and_of_fit_sizes():
    models = library(60)
    assert len({model.name for model in models}) == 60
    faces = [model.face_count for model in models]
    assert FEWEST_FACES <= min(faces) < 10 < 30 < max(faces) <= MOST_FACES
    twins_grow = 1.1
    for model in models:
        mesh = trimesh.Trimesh(model.vertices, model.triangles)
        assert mesh.is_volume
        assert SMALLEST / twins_grow < model.diameter < LARGEST * twins_grow
    convex = [trimesh.Trimesh(m.vertices, m.triangles).is_convex for m in models]
    assert 5 < sum(not is_convex for is_convex in convex) < 40


def test_a_shorter_library_is_the_beginning_of_a_longer_one_and_seeds_matter():
    long, short, other = library(12), library(7), library(7, seed=1)
    for one, same in zip(short, long, strict=False):
        assert np.array_equal(one.vertices, same.vertices)
        assert np.array_equal(one.triangles, same.triangles)
    assert not np.array_equal(short[0].vertices, other[0].vertices)


def test_every_fifth_solid_is_near_an_earlier_one_and_not_the_same():
    models = library(20)
    for index in range(TWIN_EVERY - 1, 20, TWIN_EVERY):
        twin = models[index]
        apart = [
            np.abs(twin.vertices - m.vertices).max() / m.diameter
            for m in models[:index]
            if np.array_equal(twin.triangles, m.triangles)
        ]
        assert any(0.001 < distance < 0.06 for distance in apart)


@pytest.mark.parametrize("family", FAMILIES)
def test_most_solids_of_a_family_are_closed(family):
    rng = np.random.default_rng(3)
    closed = [trimesh.Trimesh(*family(rng)).is_volume for _ in range(20)]
    assert sum(closed) >= 10


def test_planes_give_the_hull_that_their_corners_have():
    rng = np.random.default_rng(4)
    normals = np.concatenate([np.eye(3), -np.eye(3), rng.normal(size=(6, 3))])
    offsets = rng.uniform(0.8, 1.2, 12) * np.linalg.norm(normals, axis=1)
    vertices, triangles = convex_solid(normals, offsets)
    mesh = trimesh.Trimesh(vertices, triangles)
    assert mesh.is_volume
    assert mesh.volume == pytest.approx(hull_of(vertices).volume, rel=1e-12)
    assert (vertices @ normals.T <= offsets + 1e-12).all()


def test_cells_make_a_solid_of_their_volume():
    cells = np.ones((3, 2, 2), bool)
    cells[0, 1, :] = cells[2, 0, 1] = False
    rng = np.random.default_rng(5)
    lines = [np.cumsum(rng.uniform(0.4, 1.2, size + 1)) for size in cells.shape]
    mesh = trimesh.Trimesh(*cell_solid(cells, lines))
    x, y, z = (np.diff(axis) for axis in lines)
    assert mesh.is_volume
    assert mesh.volume == pytest.approx((x[:, None, None] * y[:, None] * z)[cells].sum())


def test_large_solids_have_about_500_faces_and_no_symmetry():
    hull, block = large_solids(np.random.default_rng(0))
    assert hull.face_count == 500
    assert 480 <= block.face_count <= 520
    for model in (hull, block):
        assert len(model.symmetries) == 1
        assert trimesh.Trimesh(model.vertices, model.triangles).is_volume
    assert trimesh.Trimesh(hull.vertices, hull.triangles).is_convex
    assert not trimesh.Trimesh(block.vertices, block.triangles).is_convex


def test_files_hold_the_very_same_solids(tmp_path):
    models = library(6)
    write_library(models, tmp_path / "library")
    for model, read in zip(models, load_folder(tmp_path / "library"), strict=True):
        assert model.name == read.name
        assert np.array_equal(np.unique(model.vertices, axis=0), np.unique(read.vertices, axis=0))
        assert model.face_count == read.face_count


def test_a_folder_with_something_in_it_is_left_alone(tmp_path):
    (tmp_path / "part.stl").write_text("mine")
    with pytest.raises(typer.BadParameter, match="not empty"):
        main(tmp_path, 2, 0)
    assert [path.name for path in tmp_path.iterdir()] == ["part.stl"]
