"""Range tables on disk: what is read is what would be built, whatever happens to the files."""

from __future__ import annotations

import ast
import inspect
import itertools
import os
import subprocess
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from helpers.forbidding import forbid
from helpers.processes import python
from oracles.solids import SOLIDS, model

from palpate.assets import STAND_IN_NAMES
from palpate.recognizer import PairTables, Polyhedron
from palpate.recognizer.models.features import all_features
from palpate.recognizer.models.polyhedron import FacePolygons
from palpate.recognizer.tables import file_cache, table_cache
from palpate.recognizer.tables.table_cache import cached_tables, default_folder, table_key


def same_tables(one: PairTables, other: PairTables) -> bool:
    pairs = [(getattr(one, f.name), getattr(other, f.name)) for f in fields(PairTables)]
    return all(a.dtype == b.dtype and np.array_equal(a, b) for a, b in pairs)


@pytest.mark.parametrize("name", ["cube", "holed", "hull-90", "housing"])
def test_tables_read_are_those_that_were_built_and_are_built_once(name, tmp_path, monkeypatch):
    solid = model(name)
    expected = PairTables.of(solid)
    built = cached_tables(solid, tmp_path)
    forbid(monkeypatch, PairTables, "of")
    found = cached_tables(replace(solid, name="of another name"), tmp_path)
    assert same_tables(built, expected)
    assert same_tables(found, expected)
    assert len(list(tmp_path.iterdir())) == 1


def test_tables_are_read_only_whether_built_or_read(tmp_path):
    for tables in (cached_tables(model("cube"), tmp_path) for _ in range(2)):
        for field in fields(PairTables):
            array = getattr(tables, field.name)
            assert not array.flags.writeable
            assert array.flags.c_contiguous
            assert array.flags.aligned


def test_a_damaged_file_is_built_anew_and_mended(tmp_path):
    solid = model("l-block")
    expected = cached_tables(solid, tmp_path)
    (path,) = tmp_path.iterdir()
    whole = path.read_bytes()
    rng = np.random.default_rng(0)
    lengths = [0, 1, 16, 17, 33, 41, 42, 100, len(whole) // 2, len(whole) - 1]
    damaged = [whole[:length] for length in lengths] + [whole + b"\0", b"\0" * len(whole)]
    for at in [*range(0, 64, 5), *rng.integers(len(whole), size=40)]:
        flipped = bytearray(whole)
        flipped[at] ^= 1 << int(rng.integers(8))
        damaged.append(bytes(flipped))
    for content in damaged:
        path.write_bytes(content)
        assert same_tables(cached_tables(solid, tmp_path), expected)
        assert path.read_bytes() == whole


def test_a_write_that_was_killed_leaves_nothing_that_is_read(tmp_path):
    killed = (
        "import os, signal, sys; from pathlib import Path; from oracles.solids import model\n"
        "from palpate.recognizer.tables.table_cache import cached_tables\n"
        "os.replace = lambda *_: os.kill(os.getpid(), signal.SIGKILL)\n"
        "cached_tables(model('cube'), Path(sys.argv[1]))\n"
    )
    assert run(killed, tmp_path).wait(timeout=60) < 0
    assert [path.suffix for path in tmp_path.iterdir()] == [".part"]
    assert same_tables(cached_tables(model("cube"), tmp_path), PairTables.of(model("cube")))
    assert sorted(path.suffix for path in tmp_path.iterdir()) == [".part", ".tables"]


def test_a_write_that_fails_leaves_no_file(tmp_path, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", full)
    file_cache._warn_of.cache_clear()
    with pytest.warns(UserWarning, match="No space left"):
        cached_tables(model("cube"), tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_two_processes_at_once_always_get_whole_tables(tmp_path):
    busy = (
        "import sys; from pathlib import Path; from oracles.solids import model\n"
        "from test_table_cache import same_tables\n"
        "from palpate.recognizer import PairTables\n"
        "from palpate.recognizer.tables.table_cache import cached_tables, table_key\n"
        "solid, folder = model('l-block'), Path(sys.argv[1])\n"
        "expected, path = PairTables.of(solid), folder / (table_key(solid) + '.tables')\n"
        "for turn in range(150):\n"
        "    assert same_tables(cached_tables(solid, folder), expected)\n"
        "    if turn % 3 == 0: path.unlink(missing_ok=True)\n"
        "    if turn % 7 == 0: path.write_bytes(b'half')\n"
    )
    workers = [run(busy, tmp_path) for _ in range(2)]
    assert [worker.wait(timeout=60) for worker in workers] == [0, 0]
    assert not list(tmp_path.glob("*.part"))


def run(code: str, folder: Path) -> subprocess.Popen[bytes]:
    """Start Python on a piece of code, which is told a folder."""
    return subprocess.Popen(python(code, str(folder), beside=__file__))


def test_a_folder_that_cannot_be_written_is_said_once_and_costs_no_more(tmp_path):
    in_the_way = tmp_path / "file"
    in_the_way.write_text("not a folder")
    file_cache._warn_of.cache_clear()
    names = ("cube", "l-block", "cube")
    with pytest.warns(UserWarning, match="can't be kept here") as told:
        found = [cached_tables(model(name), in_the_way / "tables") for name in names]
    assert len(told) == 1
    for name, tables in zip(names, found, strict=True):
        assert same_tables(tables, PairTables.of(model(name)))
        assert not tables.angle.flags.writeable


def test_the_default_folder_is_in_the_users_cache(tmp_path, monkeypatch):
    monkeypatch.setattr("platformdirs.user_cache_path", lambda *_, **__: tmp_path / "palpate")
    assert default_folder() == tmp_path / "palpate" / "tables"
    cached_tables(model("cube"))
    assert len(list((tmp_path / "palpate" / "tables").iterdir())) == 1
    forbid(monkeypatch, PairTables, "of")
    cached_tables(model("cube"))


def test_without_a_home_directory_nothing_is_kept(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("platformdirs.user_cache_path", lambda *_, **__: Path("~/.cache/palpate"))
    assert default_folder() is None
    assert same_tables(cached_tables(model("cube")), PairTables.of(model("cube")))
    assert list(tmp_path.iterdir()) == []


def test_models_of_different_shape_never_share_a_key():
    keys = [table_key(model(name)) for name in (*SOLIDS, *STAND_IN_NAMES)]
    assert len(set(keys)) == len(keys)


def test_any_change_of_a_models_arrays_changes_its_key():
    solid = model("l-block")
    keys = [table_key(solid)]
    for field in fields(solid):
        whole = getattr(solid, field.name)
        if field.name == "name":
            continue
        parts = [part.name for part in fields(whole)] if isinstance(whole, FacePolygons) else [None]
        for part in parts:
            array = np.array(whole if part is None else getattr(whole, part))
            step = np.spacing(array.flat[-1]) if array.dtype.kind == "f" else 1
            array.flat[-1] += step
            changed = array if part is None else replace(whole, **{part: array})
            keys.append(table_key(replace(solid, **{field.name: changed})))
    assert len(keys) > 12
    assert all(one != other for one, other in itertools.combinations(keys, 2))


def test_tables_over_edges_and_vertices_have_a_file_of_their_own(tmp_path):
    solid = model("cube")
    features = all_features(solid)
    faces, everything = (
        cached_tables(solid, tmp_path),
        cached_tables(solid, tmp_path, features=features),
    )
    assert len(list(tmp_path.iterdir())) == 2
    assert same_tables(faces, PairTables.of(solid))
    assert same_tables(everything, PairTables.of(solid, features))
    assert same_tables(cached_tables(solid, tmp_path, features=features), everything)


def test_tables_share_no_memory_with_the_models_own_arrays(tmp_path):
    solid = Polyhedron.from_mesh(SOLIDS["cube"]())
    for _ in range(2):
        tables = cached_tables(solid, tmp_path)
        for field in fields(PairTables):
            for own in (solid.normals, solid.hulls.corners, solid.hulls.start):
                assert not np.shares_memory(own, getattr(tables, field.name))


def test_every_module_that_tables_are_built_by_is_part_of_the_key():
    # A model's own arrays are hashed, what triples add is built from the tables each time, and how
    # kernels are compiled says nothing of what they compute.
    harmless = {"compiling", "polyhedron", "triples"}
    named = {module.__name__.rpartition(".")[2] for module in table_cache.BUILDERS}
    imported = 0
    for module in table_cache.BUILDERS:
        for node in ast.walk(ast.parse(inspect.getsource(module))):
            if isinstance(node, ast.ImportFrom) and node.level:
                paths = [node.module] if node.module else [alias.name for alias in node.names]
                names = {path.rpartition(".")[2] for path in paths}
                assert names <= named | harmless, module.__name__
                imported += 1
    assert imported > 3


def test_a_changed_way_of_building_changes_the_key(monkeypatch):
    before = table_key(model("cube"))
    table_cache._builders.cache_clear()
    monkeypatch.setattr(table_cache, "BUILDERS", table_cache.BUILDERS[:1])
    try:
        assert table_key(model("cube")) != before
    finally:
        table_cache._builders.cache_clear()
