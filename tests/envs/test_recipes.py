"""Every program in docs/recipes.md runs as it stands."""

from __future__ import annotations

import os
import re
import subprocess
import sys

import pytest
from helpers.checkout import ROOT

TEXT = (ROOT / "docs" / "recipes.md").read_text(encoding="utf-8")
RECIPES = {
    section.split("\n")[0]: re.findall(r"```python\n(.*?)```", section, re.DOTALL)
    for section in TEXT.split("\n## ")[1:]
}
NEEDS = {"minari": "minari", "h5py": "minari", "stable_baselines3": "stable_baselines3"}
"""Modules that are not installed with palpate, and what needs them where it is imported."""


def test_every_recipe_has_a_program():
    assert len(RECIPES) == 5
    assert all(len(programs) == 1 for programs in RECIPES.values())


@pytest.mark.parametrize("title", RECIPES)
def test_a_recipe_runs_as_it_stands(title, tmp_path):
    (program,) = RECIPES[title]
    for module, imported in NEEDS.items():
        if re.search(rf"^(import|from) {imported}\b", program, re.M):
            pytest.importorskip(module)
    file = tmp_path / "recipe.py"
    file.write_text(program, encoding="utf-8")
    told = subprocess.run(
        [sys.executable, "-W", "error:::__main__", file],
        cwd=tmp_path,
        env={**os.environ, "MINARI_DATASETS_PATH": str(tmp_path / "minari")},
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert told.returncode == 0, told.stderr
    assert "UserWarning" not in told.stderr, told.stderr


def test_the_ids_told_are_those_there_are():
    from palpate import envs

    told = set(re.findall(r"^\| `(palpate/\S+)`", TEXT, re.M))
    assert told == {envs.ENV_ID, envs.REST_ENV_ID, envs.FINGER_ENV_ID, envs.PLANAR_ENV_ID}
