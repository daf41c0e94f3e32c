"""`palpate suggest`, and what the commands about your own parts say of bad input."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
import trimesh
from helpers.command import Told, run_here
from helpers.forbidding import forbid
from helpers.processes import loaded_by
from oracles.solids import box, first_hit, mesh_of, model, random_hull, surface_points
from scipy.spatial.transform import RigidTransform, Rotation

from palpate.policies.ranking import FORMULAS
from palpate.recognizer import Contacts, Polyhedron, Recognizer, diagnose
from palpate.recognizer.advice.twins import same_parts
from palpate.recognizer.tables.ranges import PairTables

NAMES = ("l-block", "tetrahedron", "holed")
SIZE = 30.0
"""Millimetres that a unit of the test solids stands for."""
POSE = RigidTransform.from_components(
    [0.2, -0.1, 0.05], Rotation.from_euler("xyz", [0.4, -0.3, 1.1])
)
HEADER = "x,y,z,nx,ny,nz"


def millimetres(name: str, scale: float = SIZE) -> trimesh.Trimesh:
    return mesh_of(model(name), scale)


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """Three parts in millimetres, and touches of the first of them: nine, and the first three."""
    path = tmp_path_factory.mktemp("own")
    (path / "parts").mkdir()
    for name in NAMES:
        millimetres(name).export(path / "parts" / f"{name}.stl")
    for count in (9, 3):
        write(path / f"felt{count}.csv", touch_table()[:count])
    return path


def touch_table() -> np.ndarray:
    """(9, 6) touches of the l-block at `POSE`, one on each face and one more: mm, and normals."""
    rng, solid = np.random.default_rng(0), model("l-block")
    points, faces = surface_points(solid, 200, rng)
    rows = [*np.unique(faces, return_index=True)[1], 5]
    positions = 1e3 * POSE.apply(1e-3 * SIZE * points[rows]) + rng.uniform(-0.05, 0.05, (9, 3))
    table = np.hstack([positions, POSE.rotation.apply(solid.normals[faces[rows]])])
    return table[rng.permutation(9)]


def write(path: Path, table: np.ndarray, header: str = HEADER) -> None:
    np.savetxt(path, table, delimiter=",", header=header, comments="", fmt="%.5f")


def suggested(folder: Path, *options: str) -> dict:
    told = run_here("suggest", *options, "--library", "parts", "--json", cwd=folder)
    assert told.code == 0, told.err
    return json.loads(told.out)


def test_the_best_touches_are_ranked_with_what_each_rival_predicts(folder):
    told = run_here("suggest", "felt3.csv", "--library", "parts", "--count", "2", cwd=folder)
    assert told.code == 0, told.err
    assert "3 contacts, 3 parts in the library." in told.out
    assert "Touches that tell most (mm):" in told.out
    first, second = told.out.index("\n1  from ("), told.out.index("\n2  from (")
    assert first < second
    table = told.out[first:second]
    assert "likely to rule out" in table
    assert "l-block" in table
    assert "met after" in table
    assert "as x,y,z (and nx,ny,nz), with the start as sx,sy,sz" in told.out


def test_the_document_is_in_the_units_of_the_files_and_agrees_with_rays(folder):
    """Of nine touches one pose is left: what is predicted is what a ray cast at the truth meets."""
    document = suggested(folder, "felt9.csv")
    assert (document["verdict"], document["units"]) == ("unique", "mm")
    triangles = 1e3 * POSE.apply(1e-3 * millimetres("l-block").vertices)[model("l-block").triangles]
    assert len(document["suggestions"]) == 3
    for one in document["suggestions"]:
        start, direction = np.array(one["start"]), np.array(one["direction"])
        depth, triangle = first_hit(triangles, start, direction)
        (report,) = one["reports"]
        assert report["touches"]
        assert report["chance"] == pytest.approx(1.0)
        # By its own account of how well nine touches tell the pose.
        near = 4.0 * report["deviation"]
        assert 0.0 < near < 2.0
        assert report["after"][0] == pytest.approx(depth, abs=near)
        assert np.array(report["point"]) == pytest.approx(start + depth * direction, abs=near)
        face = model("l-block").triangle_faces[triangle]
        normal = POSE.rotation.apply(model("l-block").normals[face].copy())
        assert np.array(report["normal"]) @ normal > 0.9999
        (rival,) = report["rivals"]
        assert rival["object"] == "l-block"


def test_once_it_is_unique_that_is_said(folder):
    told = run_here("suggest", "felt9.csv", "--library", "parts", cwd=folder)
    assert "It is l-block" in told.out
    assert "Nothing is left to tell apart. What fixes its pose best" in told.out
    assert "rule out" not in told.out


def test_region_and_directions_are_kept_to(folder):
    low, high = [150.0, -200.0, 0.0], [300.0, 0.0, 130.0]
    region = ",".join(str(number) for pair in zip(low, high, strict=True) for number in pair)
    document = suggested(
        folder, "felt3.csv", "--region", region, "--directions", "-z,+X", "--count", "6"
    )
    found = document["suggestions"]
    assert len(found) > 1
    for one in found:
        assert one["direction"] in ([1.0, 0.0, 0.0], [0.0, 0.0, -1.0])
        for end in (one["start"], one["end"]):
            assert (np.array(end) >= np.array(low) - 1e-6).all()
            assert (np.array(end) <= np.array(high) + 1e-6).all()


def test_a_region_that_nothing_can_be_touched_in_is_told(folder):
    told = run_here(
        *("suggest", "felt9.csv", "--library", "parts"),
        *("--region", "-900,-800,-900,-800,-900,-800"),
        cwd=folder,
    )
    assert told.code == 0
    assert "No straight touch there tells anything: a wider --region" in told.out


def test_before_the_first_contact_it_says_where_to_look(folder):
    told = run_here(
        *("suggest", "--library", "parts", "--region", "0,100,0,100,0,50", "--count", "2"),
        cwd=folder,
    )
    assert told.code == 0, told.err
    assert "Nothing was touched yet." in told.out
    assert "1  from (50.00 50.00 50.00) along -z, at most 50.00" in told.out
    (folder / "missed.csv").write_text("sx,sy,sz,ex,ey,ez\n50,50,50,50,50,0\n")
    missed = suggested(folder, "missed.csv", "--region", "0,100,0,100,0,50", "--count", "1")
    assert missed["verdict"] == "nothing touched yet"
    assert missed["suggestions"][0]["purpose"] == "find the part"
    assert missed["suggestions"][0]["start"] != [50.0, 50.0, 50.0]


def test_the_help_names_every_policy(folder):
    told = run_here("suggest", "--help", cwd=folder)
    words = told.out.replace("│", " ").replace(",", " ").replace(".", " ").split()
    assert set(FORMULAS) <= set(words)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (
            ("felt3.csv", "--policy", "psychic"),
            "policy is 'psychic'; it must be one of information",
        ),
        (("felt3.csv", "--region", "1,2,3"), "--region is '1,2,3'; it must be six numbers"),
        (("felt3.csv", "--region", "0,1,5,5,0,1"), "Y0 must be below Y1"),
        (("felt3.csv", "--directions", "+x,up"), "'up' isn't one of +x, -x, +y"),
        (("felt3.csv", "--count", "0"), "--count"),
        (("felt3.csv", "--position-error", "0"), "--position-error is 0; it must be above zero"),
        (("felt3.csv", "--normal-error-deg", "200"), "--normal-error-deg is 200"),
        ((), "nothing was touched yet, so nobody knows where the part is"),
    ],
)
def test_a_bad_option_is_one_line(folder, options, words):
    told = run_here("suggest", *options, "--library", "parts", cwd=folder)
    one_line(told, words)


def one_line(told: Told, words: str) -> None:
    assert told.code == 2
    assert told.out == ""
    assert told.err.count("\n") == 1
    assert told.err.startswith("palpate: ")
    assert words in told.err


GOOD = "x,y,z,nx,ny,nz\n1,2,3,0,0,1\n"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("y,z,nx,ny,nz\n2,3,0,0,1\n", "bad.csv: there is a column y but none for x"),
        (GOOD + "4,five,6,0,0,1\n", "bad.csv, line 3: y is 'five', which is no number"),
        ("", "bad.csv: the file is empty; its first line must name the columns"),
        (
            "x,y,z\n1,5,2,5,3,5\n",
            "line 2: 6 values under 3 columns; decimal commas need semicolons",
        ),
        ("1,2,3\n4,5,6\n", "bad.csv: the first line must name the columns"),
    ],
)
@pytest.mark.parametrize("command", ["recognize", "suggest"])
def test_a_bad_file_is_one_line_that_names_file_and_row(folder, tmp_path, command, text, words):
    (tmp_path / "bad.csv").write_text(text)
    library = str(folder / "parts")
    one_line(run_here(command, "bad.csv", "--library", library, cwd=tmp_path), words)


def test_windows_line_ends_semicolons_and_decimal_commas_are_taken(folder, tmp_path):
    text = (folder / "felt9.csv").read_text()
    windows = text.replace(",", ";").replace(".", ",").replace("\n", "\r\n")
    (tmp_path / "windows.csv").write_bytes(windows.encode())
    (tmp_path / "blanks.csv").write_text(text.replace(",", "  "))
    plain = run_here("recognize", str(folder / "felt9.csv"), "--library", "parts", cwd=folder)
    assert "It is l-block" in plain.out
    for name in ("windows.csv", "blanks.csv"):
        path = str(tmp_path / name)
        assert run_here("recognize", path, "--library", "parts", cwd=folder).out == plain.out


@pytest.mark.parametrize("command", ["recognize", "suggest"])
@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda t: t * [1, 1, 1, -1, -1, -1], "Perhaps the normals point inwards"),
        (lambda t: t * [25.4, 25.4, 25.4, 1, 1, 1], "the contacts are 25.4 times too large"),
        (lambda t: t / [25.4, 25.4, 25.4, 1, 1, 1], "the contacts are 25.4 times too small"),
        (
            lambda t: t + np.where(np.arange(9) == 6, 15.0, 0.0)[:, None] * [1, 1, 1, 0, 0, 0],
            "contact 7 is on something else: the others fit without it (then l-block fits, line 8",
        ),
    ],
)
def test_a_mistake_in_all_of_a_file_is_recognised_and_said(
    folder, tmp_path, command, change, words
):
    write(tmp_path / "felt.csv", change(touch_table()))
    told = run_here(command, "felt.csv", "--library", str(folder / "parts"), cwd=tmp_path)
    assert told.code == 0
    assert "Not in this library" in told.out
    assert words in told.out
    assert "l-block fits" in told.out


@pytest.mark.parametrize("scale", [25.4, 1 / 25.4])
def test_a_part_of_the_wrong_size_is_said(folder, tmp_path, scale):
    shutil.copytree(folder / "parts", tmp_path / "parts")
    millimetres("l-block", scale * SIZE).export(tmp_path / "parts" / "l-block.stl")
    told = run_here("recognize", str(folder / "felt9.csv"), "--library", "parts", cwd=tmp_path)
    size = "too small" if scale > 1 else "too large"
    assert f"25.4 times {size}: they are in" in told.out
    assert "or the library is not (then l-block fits)" in told.out


def test_a_mesh_with_holes_is_named_with_how_to_mend_it(folder, tmp_path):
    shutil.copytree(folder / "parts", tmp_path / "parts")
    whole = millimetres("holed")
    leaky = trimesh.Trimesh(whole.vertices, whole.faces[2:], process=False)
    leaky.export(tmp_path / "parts" / "holed.stl")
    for command in ("recognize", "suggest"):
        path = str(folder / "felt9.csv")
        told = run_here(command, path, "--library", "parts", cwd=tmp_path)
        one_line(told, "parts/holed.stl: the mesh isn't closed")
        assert "it has holes; 'fill holes'" in told.err
    told = run_here("recognize", path, "--library", "parts/holed.stl", cwd=tmp_path)
    one_line(told, "parts/holed.stl is a file; give the folder that it is in: parts")


def test_two_files_of_one_part_are_said_to_be_that(folder, tmp_path):
    shutil.copytree(folder / "parts", tmp_path / "parts")
    again = millimetres("l-block")
    again.apply_transform(trimesh.transformations.rotation_matrix(1.0, [1, 2, 3], [4, 5, 6]))
    again.export(tmp_path / "parts" / "copy.stl")
    for command in ("recognize", "suggest"):
        path = str(folder / "felt9.csv")
        told = run_here(command, path, "--library", "parts", cwd=tmp_path)
        assert told.code == 0, told.err
        assert "copy and l-block are the same part, in two files: remove one of them." in told.out


def test_a_mirror_image_and_a_part_of_another_size_are_other_parts():
    solid = model("l-block")
    others = {
        "mirrored": solid.vertices * [1, 1, -1] + [0, 0, 1e-9],
        "skewed": solid.vertices + 0.01 * solid.vertices[:, [1, 2, 0]],
        "larger": 1.001 * solid.vertices,
    }
    chiral = Polyhedron.from_mesh(skew_box(1), name="left")
    parts = [
        Polyhedron.from_mesh(
            trimesh.Trimesh(v, solid.triangles[:, :: -1 if n == "mirrored" else 1], process=False),
            name=n,
        )
        for n, v in others.items()
    ]
    # An l-block has a plane of symmetry, so that its mirror image is the same part.
    assert same_parts([solid, *parts]) == [("l-block", "mirrored")]
    assert same_parts([chiral, Polyhedron.from_mesh(skew_box(-1), name="right")]) == []
    assert same_parts([model("cube"), Polyhedron.from_mesh(box(1, 1, 1), name="other")]) != []


def skew_box(hand: int) -> trimesh.Trimesh:
    """A solid without a plane of symmetry, or its mirror image."""
    corners = np.array([[0, 0, 0], [3, 0, 0], [0, 2, 0], [0, 0, 1], [1.3, 0.4, -0.7]], float)
    return trimesh.convex.convex_hull(corners * [1, 1, hand])


def test_a_file_without_normals_is_warned_of(folder, tmp_path):
    write(tmp_path / "bare.csv", touch_table()[:1, :3], "x,y,z")
    told = run_here("recognize", "bare.csv", "--library", str(folder / "parts"), cwd=tmp_path)
    assert told.code == 0
    assert "bare.csv: no normals in it (nx,ny,nz), so this takes more touches" in told.err
    assert told.err.count("\n") == 1


def test_twenty_parts_are_weighed_and_their_tables_built_once(folder, tmp_path, monkeypatch):
    shutil.copytree(folder / "parts", tmp_path / "parts")
    for seed in range(17):
        hull = random_hull(12, seed)
        hull.apply_scale(SIZE)
        hull.export(tmp_path / "parts" / f"hull-{seed}.stl")
    command = ("suggest", str(folder / "felt9.csv"), "--library", "parts")
    first = run_here(*command, cwd=tmp_path)
    assert first.code == 0, first.err
    assert "9 contacts, 20 parts" in first.out

    forbid(monkeypatch, PairTables, "of")
    assert run_here(*command, cwd=tmp_path) == first


def test_suggest_loads_no_simulator():
    heavy = {"mujoco", "gymnasium", "matplotlib", "av"}
    assert not heavy & loaded_by("import palpate.policies.session")


def test_a_finding_about_one_contact_tells_which():
    table = touch_table()
    table[2, :3] += 15.0
    contacts = Contacts(1e-3 * table[:, :3], table[:, 3:], position_error=1e-4, normal_error=0.2)
    part = Polyhedron.from_mesh(millimetres("l-block"), name="l-block", scale=1e-3)
    assert [one.contact for one in diagnose(Recognizer([part]), contacts)] == [2]
