"""`palpate library`: parts that look alike, meshes that won't do, and what is said of them."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from helpers.command import run_here
from oracles.geometry import signed_distances
from oracles.solids import blocks, box, model

from palpate.recognizer import Polyhedron, Recognizer
from palpate.recognizer.advice.twins import near_twins, sample_surface, surface_distances


def stepped_block(step: float) -> trimesh.Trimesh:
    """Of 60 by 40 by 20 mm, with a step cut out of one corner."""
    filled = [[[1], [1]], [[1], [0]]]
    return blocks(filled, [0, 0.06 - step, 0.06], [0, 0.04 - step, 0.04], [0, 0.02])


def polyhedron_of(mesh: trimesh.Trimesh, name: str) -> Polyhedron:
    return Polyhedron.from_mesh(mesh, name=name)


@pytest.fixture(scope="module")
def twins():
    library = [
        polyhedron_of(box(0.06, 0.04, 0.02), "whole"),
        polyhedron_of(stepped_block(0.004), "stepped"),
        polyhedron_of(box(0.03, 0.03, 0.03), "cube"),
    ]
    found = near_twins(
        Recognizer(library),
        np.random.default_rng(0),
        position_error=1e-4,
        normal_error=0.2,
        draws=8,
    )
    return dict(zip(("whole", "stepped", "cube"), found, strict=True))


def test_a_block_and_one_with_a_small_step_are_near_twins(twins):
    (one,) = twins["stepped"]
    assert (one.part, one.other) == ("stepped", "whole")
    assert one.share > 0.5
    assert twins["cube"] == []


def test_where_they_differ_most_is_at_the_step(twins):
    """Laid over each other the step's inner walls are off by up to its depth."""
    (one,) = twins["stepped"]
    assert 0.002 < one.apart < 0.0045
    assert np.abs(one.place[:2] - (0.058, 0.038)).max() < 0.0025
    (other,) = [twin for twin in twins["whole"] if twin.other == "stepped"]
    assert 0.002 < other.apart < 0.0045


def test_points_of_a_surface_are_on_it_and_distances_are_those_of_geometry():
    solid = model("l-block")
    rng = np.random.default_rng(1)
    points, faces = sample_surface(solid, 300, rng)
    assert np.abs(signed_distances(solid, points)).max() < 1e-12
    off = ((points * solid.normals[faces]).sum(axis=1) - solid.offsets[faces]) / solid.diameter
    assert np.abs(off).max() < 1e-12
    around = points + rng.normal(size=points.shape) * 0.2 * solid.diameter
    expected = np.abs(signed_distances(solid, around))
    assert surface_distances(solid, around) == pytest.approx(expected, abs=1e-12)


def test_a_folder_is_checked_file_by_file(tmp_path):
    for name, mesh in {
        "whole": box(60.0, 40.0, 20.0),
        "again": box(60.0, 40.0, 20.0),
        "small": box(0.06, 0.04, 0.02),
    }.items():
        mesh.export(tmp_path / f"{name}.stl")
    holed = box(60.0, 40.0, 20.0)
    holed.update_faces(np.arange(len(holed.faces)) > 0)
    holed.export(tmp_path / "holed.stl")
    told = run_here("library", ".", cwd=tmp_path)
    assert told.code == 0, told.err
    lines = {line.split()[0]: line for line in told.out.splitlines() if ".stl" in line}
    assert "unusable" in lines["holed.stl"]
    assert "closed" in lines["holed.stl"]
    assert lines["whole.stl"].split()[1:4] == ["6", "74.8", "4"]
    assert "is it in m?" in lines["small.stl"]
    assert "again and whole are the same part" in told.out


def test_a_folder_that_is_none_is_one_line(tmp_path):
    for arguments, words in (
        (("nowhere",), "nowhere: no such folder"),
        ((".",), "no mesh in this folder"),
        ((".", "--units", "ell"), "units is 'ell'"),
    ):
        told = run_here("library", *arguments, cwd=tmp_path)
        assert told.code == 2
        assert words in told.err
        assert told.err.count("\n") == 1
