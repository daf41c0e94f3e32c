"""Collision parts on disk: worked out once, and read to the bit."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from helpers.forbidding import forbid
from oracles import solids as oracles
from oracles.convex_parts import remade, user_mesh

from palpate.envs.collision import collision
from palpate.envs.collision.collision import (
    CollisionParts,
    collision_parts,
    parts_key,
    worked_out_parts,
)
from palpate.recognizer.tables import file_cache


def same_parts(one: CollisionParts, other: CollisionParts) -> bool:
    return one.stray == other.stray and all(
        np.array_equal(a.vertices, b.vertices) and np.array_equal(a.triangles, b.triangles)
        for a, b in zip(one.parts, other.parts, strict=True)
    )


@pytest.mark.parametrize("name", ["housing", "my housing", "cube"])
def test_parts_are_worked_out_once_and_read_to_the_bit(name, tmp_path, monkeypatch):
    model = user_mesh("housing") if name == "my housing" else oracles.model(name)
    expected = worked_out_parts(model)
    built = collision_parts(model, folder=tmp_path)
    forbid(monkeypatch, collision, "worked_out_parts")
    assert same_parts(built, expected)
    assert same_parts(collision_parts(model, folder=tmp_path), expected)
    assert len(list(tmp_path.iterdir())) == 1


@pytest.mark.parametrize("damage", [b"", b"not parts", b"cut off"])
def test_a_damaged_file_is_worked_out_anew(damage, tmp_path):
    model = oracles.model("l-block")
    expected = collision_parts(model, folder=tmp_path)
    (path,) = tmp_path.iterdir()
    whole = path.read_bytes()
    path.write_bytes(whole[:-9] if damage == b"cut off" else damage)
    assert same_parts(collision_parts(model, folder=tmp_path), expected)
    assert path.read_bytes()[:16] == whole[:16]


def test_the_file_depends_on_the_shape_and_not_on_the_name():
    model = oracles.model("l-block")
    assert parts_key(replace(model, name="other")) == parts_key(model)
    assert parts_key(remade(model, 1.5 * model.vertices)) != parts_key(model)
    # A stand-in's name says which parts to try first.
    assert parts_key(oracles.model("housing")) != parts_key(user_mesh("housing"))


def test_several_at_work_on_one_folder_do_not_disturb_each_other(tmp_path):
    models = [oracles.model(name) for name in ("l-block", "holed", "bridge")] * 4
    with ThreadPoolExecutor(6) as pool:
        found = list(pool.map(lambda model: collision_parts(model, folder=tmp_path), models))
    assert all(same_parts(one, other) for one, other in zip(found[:3] * 4, found, strict=True))
    assert len(list(tmp_path.iterdir())) == 3


def test_a_folder_that_cannot_be_written_is_said_and_does_no_harm(tmp_path):
    folder = tmp_path / "a file"
    folder.write_text("in the way")
    model = oracles.model("cube")
    with pytest.warns(UserWarning, match="collision parts can't be kept here"):
        found = collision_parts(model, folder=folder)
    assert same_parts(found, worked_out_parts(model))


def test_by_default_parts_are_kept_in_the_users_cache(tmp_path, monkeypatch):
    asked = []
    monkeypatch.setattr(collision, "cache_folder", lambda name: asked.append(name) or tmp_path)
    collision_parts(oracles.model("cube"))
    assert asked == ["parts"]
    assert [path.suffix for path in tmp_path.iterdir()] == [".parts"]


def test_a_user_without_a_home_has_no_cache_and_still_gets_parts(monkeypatch):
    monkeypatch.setattr("platformdirs.user_cache_path", lambda *names, **options: Path("~/cache"))
    model = oracles.model("l-block")
    assert file_cache.cache_folder("parts") is None
    assert same_parts(collision_parts(model), worked_out_parts(model))
