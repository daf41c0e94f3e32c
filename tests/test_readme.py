"""The README runs as it stands and prints what it says."""

from __future__ import annotations

import re
import subprocess
import sys

import numpy as np
from helpers.checkout import ROOT

README = (ROOT / "README.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```(\w*)\n(.*?)```", README, re.DOTALL)


def run(program: str) -> str:
    told = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True, cwd=ROOT.anchor
    )
    return told.stdout


def test_the_contacts_are_recognised_as_the_readme_says():
    language, program = BLOCKS[1]
    assert language == "python"
    printed, promised = run(program), BLOCKS[2][1]
    number = r"-?\d+\.\d*"
    assert re.sub(rf"\s*{number}", " #", printed) == re.sub(rf"\s*{number}", " #", promised)
    found, said = (np.array(re.findall(number, text), float) for text in (printed, promised))
    assert np.allclose(found, said, atol=2e-3)


def test_what_else_is_known_is_told_as_the_readme_says():
    assert BLOCKS[3][0] == "python"
    assert run(BLOCKS[1][1] + BLOCKS[3][1]) == BLOCKS[2][1] + BLOCKS[4][1]


def test_the_environment_is_made_as_the_readme_says():
    language, program = BLOCKS[5]
    assert language == "python"
    assert run(program) == ""


def test_every_target_and_file_that_the_readme_names_exists():
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    targets = set(re.findall(r"make (\w+)", README)) - {"lists"}
    paths = re.findall(r"\((docs/[\w.]+)\)|`((?:envs|assets|recognizer)/[\w./]+)`", README)
    assert targets
    assert paths
    for target in targets:
        assert f"\n{target}:" in makefile, target
    for path in paths:
        assert (ROOT / (path[0] or path[1])).exists(), path
