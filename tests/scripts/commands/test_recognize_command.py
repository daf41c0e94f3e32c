"""`palpate recognize`: a folder of parts in millimetres and a file of touches, and no more."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
from helpers.command import run_here
from oracles.solids import model, random_pose, surface_points
from scipy.spatial.transform import RigidTransform

from palpate.assets import mesh_path
from palpate.recognizer import Contacts, Recognizer, SupportPlane, diagnose, pose_difference
from palpate.recognizer.advice.diagnosis import too_far_apart

PARTS = ("housing", "simple-hand")


@pytest.fixture(scope="module")
def parts(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("parts")
    for name in PARTS:
        mesh = trimesh.load_mesh(mesh_path(name))
        mesh.apply_scale(1000.0)
        mesh.export(folder / f"{name}.stl")
    return folder


def touches(count: int = 9, seed: int = 3) -> tuple[RigidTransform, np.ndarray, np.ndarray]:
    """Of the housing at some pose: positions in millimetres, normals."""
    rng = np.random.default_rng(seed)
    solid = model("housing")
    pose = random_pose(rng, 0.3)
    points, faces = surface_points(solid, count, rng)
    off = rng.uniform(-0.05, 0.05, (count, 3))
    return pose, 1000.0 * pose.apply(points) + off, pose.rotation.apply(solid.normals[faces])


def write(path: Path, positions: np.ndarray, normals: np.ndarray | None = None) -> Path:
    names = ["x", "y", "z"] + (["nx", "ny", "nz"] if normals is not None else [])
    columns = positions if normals is None else np.hstack([positions, normals])
    np.savetxt(path, columns, delimiter=",", header=",".join(names), comments="", fmt="%.6f")
    return path


def recognised(parts: Path, path: Path, *options: str) -> str:
    told = run_here("recognize", path.name, "--library", str(parts), *options, cwd=path.parent)
    assert told.code == 0, told.err
    return told.out


def test_a_part_in_millimetres_is_recognised_with_one_command(parts, tmp_path):
    truth, positions, normals = touches()
    path = write(tmp_path / "felt.csv", positions, normals)
    assert "It is housing" in recognised(parts, path)
    document = json.loads(recognised(parts, path, "--json"))
    assert document["verdict"] == "unique"
    (best,) = document["hypotheses"]
    assert best["object"] == "housing"
    matrix = np.array(best["pose"])
    assert matrix[:3, 3].tolist() == best["position"]
    matrix[:3, 3] *= 1e-3
    error = pose_difference(model("housing"), RigidTransform.from_matrix(matrix), truth)
    assert error.translation < 3e-4
    assert error.rotation < 0.01


def test_few_touches_are_said_to_leave_it_open(parts, tmp_path):
    _, positions, normals = touches()
    path = write(tmp_path / "felt.csv", positions[:2], normals[:2])
    told = recognised(parts, path)
    assert "Underdetermined" in told
    assert "open" in told
    assert "more (--json lists all)" in told


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda p, n: (p / 25.4, n), "in inches, not millimetres"),
        (lambda p, n: (25.4 * p, n), "in millimetres, not inches"),
        (lambda p, n: (1e-3 * p, n), "in metres, not millimetres"),
        (lambda p, n: (p, -n), "the normals point inwards"),
        (lambda p, n: (p + np.where(np.arange(9) == 4, 20.0, 0.0)[:, None], n), "contact 5 is on"),
    ],
)
def test_what_is_probably_wrong_with_touches_that_fit_nothing_is_found(change, words):
    _, positions, normals = touches()
    positions, normals = change(positions, normals)
    contacts = Contacts(1e-3 * positions, normals, position_error=1e-4, normal_error=0.2)
    recognizer = Recognizer([model(name) for name in PARTS])
    assert recognizer.recognize(contacts).empty
    finding = diagnose(recognizer, contacts)[0]
    assert words in finding.explanation
    assert finding.belief.hypotheses[0].object_name == "housing"


def test_and_it_is_told(parts, tmp_path):
    _, positions, normals = touches()
    told = recognised(parts, write(tmp_path / "felt.csv", positions, -normals))
    assert "Not in this library" in told
    assert "Perhaps the normals point inwards" in told
    assert "then housing fits" in told


def test_bad_input_is_one_line_that_names_file_and_row(parts, tmp_path):
    (tmp_path / "bad.csv").write_text("x,y,z\n1,2,3\n4,five,6\n")
    (tmp_path / "good.csv").write_text("x,y,z\n1,2,3\n")
    for name, options, words in (
        ("bad.csv", ("--library", str(parts)), "bad.csv, line 3: y is 'five'"),
        ("good.csv", ("--library", "nowhere"), "nowhere: no such folder"),
        ("good.csv", ("--library", str(parts), "--units", "yards"), "units is 'yards'"),
    ):
        told = run_here("recognize", name, *options, cwd=tmp_path)
        assert told.code == 2
        assert told.err.count("\n") == 1
        assert words in told.err


def test_a_plane_that_is_not_where_it_was_said_to_be_is_found_out():
    _, positions, normals = touches()
    contacts = Contacts(1e-3 * positions, normals, position_error=1e-4, normal_error=0.2)
    recognizer = Recognizer([model(name) for name in PARTS])
    support = SupportPlane(height=1.0, error=1e-4)
    assert recognizer.recognize(contacts, support=support).empty
    (finding,) = diagnose(recognizer, contacts, support=support)
    assert "plane" in finding.explanation
    assert finding.belief.hypotheses[0].object_name == "housing"
    assert diagnose(recognizer, contacts[:3]) == []


def test_contacts_farther_apart_than_any_part_are_counted_in_parts():
    recognizer = Recognizer([model(name) for name in PARTS])
    size = max(one.diameter for one in recognizer.models)
    points = np.array([[0.0, 0.0, 0.0], [3.0 * size, 0.0, 0.0]])
    assert too_far_apart(recognizer, Contacts(points, position_error=1e-9)) == pytest.approx(3.0)
    assert too_far_apart(recognizer, Contacts(0.3 * points, position_error=1e-9)) is None
    assert too_far_apart(recognizer, Contacts(points[:1], position_error=1e-9)) is None
