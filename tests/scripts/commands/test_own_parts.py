"""docs/own-parts.md runs as it stands, in an empty folder, and prints what it says."""

from __future__ import annotations

import re
import subprocess
import sys

import numpy as np
import pytest
from helpers.checkout import ROOT
from helpers.command import run_here

TEXT = (ROOT / "docs" / "own-parts.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```(\w*)\n(.*?)^```$", TEXT, re.DOTALL | re.MULTILINE)
NUMBER = r"-?\d+(?:\.\d+)?"


def same_text(printed: str, promised: str) -> bool:
    """The same words, and the same numbers but for rounding."""
    words, told = (re.sub(rf"\s*{NUMBER}|\s+", " #", text).split() for text in (printed, promised))
    found, said = (np.array(re.findall(NUMBER, text), float) for text in (printed, promised))
    return (
        words == told and len(found) == len(said) and np.allclose(found, said, rtol=1e-3, atol=0.02)
    )


@pytest.fixture(scope="module")
def walked(tmp_path_factory) -> list[tuple[str, str, str]]:
    """What each command or program was, what it printed, and what the page says that it prints."""
    folder = tmp_path_factory.mktemp("walk")
    said = []
    for number, (language, text) in enumerate(BLOCKS):
        if language == "csv":
            with (folder / "touches.csv").open("a", encoding="utf-8") as file:
                file.write(text)
        elif language == "console":
            line, promised = text.split("\n", 1)
            name, *arguments = line.removeprefix("$ ").split()
            assert name == "palpate"
            told = run_here(*arguments, cwd=folder)
            assert told.code == 0, told.err
            said.append((line, told.out, promised))
        elif language == "python":
            call = [sys.executable, "-W", "error:::__main__", "-c", text]
            ended = subprocess.run(call, cwd=folder, capture_output=True, text=True, check=False)
            assert ended.returncode == 0, ended.stderr
            after = BLOCKS[number + 1]
            said.append(("python", ended.stdout, "" if after[0] else after[1]))
    return said


def test_every_command_and_program_prints_what_the_page_says(walked):
    assert len(walked) == 8
    for line, printed, promised in walked:
        assert same_text(printed, promised), f"{line}:\n{printed}"


def test_eight_touches_end_in_one_pose(walked):
    lines = "".join(text for language, text in BLOCKS if language == "csv").splitlines()
    assert len(lines) == 1 + 8
    assert any(
        "8 contacts" in printed and "It is long-bracket" in printed for _, printed, _ in walked
    )


def test_other_numbers_and_other_words_would_be_noticed():
    assert same_text("It is housing  1.00 -2.5", "It is housing 1.01  -2.5")
    assert not same_text("It is housing 1.00", "It is housing 1.10")
    assert not same_text("It is housing 1.00", "It is stapler 1.00")
    assert not same_text("It is housing", "It is housing 1.00")
