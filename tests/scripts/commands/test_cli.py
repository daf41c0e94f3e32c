"""The command line: what it prints, and what it says of bad input."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from helpers.command import run_here
from scipy.spatial.transform import RigidTransform

from palpate.assets import mesh_path
from palpate.recognizer import Polyhedron, pose_difference


def run_apart(*arguments: str, cwd: Path, **variables: str) -> subprocess.CompletedProcess[str]:
    program = "from palpate.scripts.cli import main; main()"
    return subprocess.run(
        [sys.executable, "-c", program, *arguments],
        cwd=cwd,
        env={**os.environ, **variables},
        capture_output=True,
        text=True,
        check=False,
    )


def test_an_episode_as_json_holds_the_truth_among_its_hypotheses(tmp_path):
    told = run_apart("episode", "--object", "simple-hand", "--json", "--no-picture", cwd=tmp_path)
    assert told.returncode == 0, told.stderr
    document = json.loads(told.stdout)
    assert document["truth"]["object"] == "simple-hand"
    assert document["seed"] == 45
    assert document["unique"] is True
    assert sum(entry["weight"] for entry in document["hypotheses"]) == pytest.approx(1.0)
    hand = Polyhedron.from_mesh(mesh_path("simple-hand"))
    truth = RigidTransform.from_matrix(document["truth"]["pose"])
    found = RigidTransform.from_matrix(document["hypotheses"][0]["pose"])
    error = pose_difference(hand, found, truth)
    assert np.degrees(error.rotation) < 3.0
    assert error.translation < 0.02 * hand.diameter


def test_an_episode_tells_its_story_and_draws_it(tmp_path):
    told = run_here("episode", "--object", "simple-hand", "--picture", "end.png", cwd=tmp_path)
    assert told.code == 0, told.err
    assert "probe  1" in told.out
    assert "It is simple-hand." in told.out
    assert "error" in told.out
    assert (tmp_path / "end.png").stat().st_size > 10_000
    assert [path.name for path in tmp_path.iterdir()] == ["end.png"]


def test_an_episode_is_filmed(tmp_path):
    options = ("--object", "simple-hand", "--max-probes", "1", "--no-picture")
    # Fewer pictures are drawn without GL.
    told = run_apart("episode", *options, "--video", "a.mp4", cwd=tmp_path, MUJOCO_GL="disable")
    assert told.returncode == 0, told.stderr
    assert told.stderr == ""
    assert "video: a.mp4, " in told.stdout
    assert "drawn by NumPy" in told.stdout
    assert [path.name for path in tmp_path.iterdir()] == ["a.mp4"]
    assert (tmp_path / "a.mp4").read_bytes()[4:8] == b"ftyp"


@pytest.mark.parametrize("sensor", ["ball", "ray"])
def test_how_far_a_mesh_and_what_is_touched_of_it_differ_is_told_where_it_matters(tmp_path, sensor):
    import trimesh

    library = tmp_path / "library"
    library.mkdir()
    trimesh.creation.box((0.05, 0.06, 0.07)).export(library / "block.obj")
    outline = np.array([(0, 0), (0.06, 0), (0.06, 0.02), (0.02, 0.02), (0.02, 0.05), (0, 0.05)])
    turned = trimesh.transformations.rotation_matrix(0.5, (1, 2, 3))
    corner = extruded(outline, 0.03)
    corner.apply_transform(turned)
    corner.export(library / "corner.stl")
    options = ("--library", "library", "--sensor", sensor, "--max-probes", "1", "--no-picture")
    told = run_here("episode", *options, "--seed", "0", cwd=tmp_path)
    assert told.code == 0, told.err
    lines = [line for line in told.out.splitlines() if "from its mesh by up to" in line]
    if sensor == "ray":
        assert not lines
    else:
        (line,) = lines
        assert line.startswith("corner is touched as 2 convex parts that stray")


def extruded(outline, height):
    """An L-shaped prism, as a closed mesh."""
    import trimesh

    count = len(outline)
    ends = [np.column_stack([outline, np.full(count, z)]) for z in (0.0, height)]
    lid = np.array([(0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 5)])
    walls = [
        wall
        for i in range(count)
        for j in [(i + 1) % count]
        for wall in ((i, j, j + count), (i, j + count, i + count))
    ]
    return trimesh.Trimesh(np.concatenate(ends), [*lid[:, ::-1], *(lid + count), *walls])


def test_a_ball_finds_an_object_that_stands_on_the_plane(tmp_path):
    options = ("--object", "simple-hand", "--sensor", "ball", "--placement", "resting")
    told = run_here("episode", *options, "--no-picture", cwd=tmp_path)
    assert told.code == 0, told.err
    assert "stands on a plane" in told.out
    assert "It is simple-hand." in told.out


def test_the_many_rays_of_a_scanner_are_counted(tmp_path):
    options = ("--object", "simple-hand", "--sensor", "range", "--max-probes", "1")
    told = run_here("episode", *options, "--no-picture", cwd=tmp_path)
    assert told.code == 0, told.err
    assert "12 object, 24 plane" in told.out


@pytest.mark.parametrize(
    ("option", "value", "says"),
    [("--sensor", "foot", "ray, ball, finger"), ("--placement", "flying", "'resting'")],
)
def test_a_sensor_or_a_placement_that_there_is_not_is_one_line(tmp_path, option, value, says):
    told = run_here("episode", option, value, "--no-picture", cwd=tmp_path)
    assert told.code == 2
    assert says in told.err
    assert value in told.err
    assert len(told.err.splitlines()) == 1


def test_the_same_seed_prints_the_same_story(tmp_path):
    once, again = (run_here("episode", "--no-picture", cwd=tmp_path).out for _ in range(2))
    assert once == again
    assert once != run_here("episode", "--no-picture", "--seed", "5", cwd=tmp_path).out


def test_an_object_that_is_never_touched_is_no_mistake(tmp_path):
    import trimesh

    library = tmp_path / "library"
    library.mkdir()
    trimesh.creation.box((0.002, 0.002, 0.002)).export(library / "grain.stl")
    trimesh.creation.box((0.5, 0.5, 0.5)).export(library / "crate.stl")
    told = run_here(
        *("episode", "--library", "library", "--object", "grain", "--no-picture"),
        *("--position-error", "1e-4", "--max-probes", "2"),
        cwd=tmp_path,
    )
    assert told.code == 0, told.err
    assert "No probe touched the object" in told.out


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("episode", "--object", "spoon"), ("'spoon'", "housing", "complex-hand")),
        (("episode", "--policy", "psychic"), ("'psychic'", "random")),
        (("episode", "--library", "nowhere"), ("nowhere", "no such folder")),
        (("episode", "--library", "empty"), ("empty", "no mesh")),
        (("episode", "--library", "broken"), ("broken", "not a mesh")),
        (("episode", "--library", "open"), ("lid", "isn't closed")),
        (("episode", "--position-error", "0"), ("position error", "above zero")),
        (("episode", "--position-error", "-1"), ("position error", "above zero")),
        (("episode", "--position-error", "nan"), ("position error", "above zero")),
        (("episode", "--normal-error-deg", "0"), ("normal error", "above 0")),
        (("episode", "--max-probes", "0"), ("--max-probes",)),
        (("episode", "--seed", "x"), ("--seed", "integer")),
        (("episode", "--picture", "no/folder/x.png"), ("no/folder",)),
        (("episode", "--video", "no/folder/x.mp4"), ("no/folder",)),
        (("episode", "--video", "x.avi"), ("x.avi", ".mp4")),
        (("reproduce", "table99"), ("table99", "table2")),
        (("juggle",), ("juggle",)),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(tmp_path, arguments, words):
    import trimesh

    for folder in ("empty", "broken", "open"):
        (tmp_path / folder).mkdir()
    (tmp_path / "broken" / "thing.stl").write_bytes(b"solid nonsense, cut")
    box = trimesh.creation.box()
    trimesh.Trimesh(box.vertices, box.faces[1:], process=False).export(tmp_path / "open/lid.obj")
    told = run_here(*arguments, cwd=tmp_path)
    assert told.code == 2, told.err
    assert len(told.err.strip().splitlines()) == 1
    for word in words:
        assert word in told.err


def test_an_inverted_mesh_is_mended_and_said(tmp_path):
    import trimesh

    box = trimesh.creation.box((0.05, 0.06, 0.07))
    (tmp_path / "library").mkdir()
    inverted = trimesh.Trimesh(box.vertices, box.faces[:, ::-1], process=False)
    inverted.export(tmp_path / "library" / "block.obj")
    told = run_here(
        *("episode", "--library", "library", "--no-picture", "--max-probes", "2"), cwd=tmp_path
    )
    assert told.code == 0, told.err
    lines = told.err.strip().splitlines()
    assert lines == ["palpate: block: its winding was inverted (normals pointed inwards); mended"]


def test_a_free_object_is_pushed_and_that_is_told(tmp_path):
    options = ("--object", "stapler", "--sensor", "finger", "--placement", "resting", "--free")
    more = ("--force", "2", "--max-probes", "2", "--no-picture")
    told = run_here("episode", *options, *more, cwd=tmp_path)
    assert told.code == 0, told.err
    assert "it was pushed: " in told.out
    held = run_here("episode", "--free", "--no-picture", cwd=tmp_path)
    assert held.code == 2
    assert "a free object has to stand" in held.err
