"""docs/own-parts.md runs as it stands, in an empty folder, and prints what it says."""

from __future__ import annotations

import pytest
from helpers.checkout import ROOT
from helpers.documents import Kind, Said, blocks, walk

GUIDE = ROOT / "docs" / "own-parts.md"


@pytest.fixture(scope="module")
def walked(tmp_path_factory) -> list[Said]:
    return list(walk(GUIDE, tmp_path_factory.mktemp("walk")))


def test_every_command_and_program_prints_what_the_page_says(walked):
    promised = [one for one in blocks(GUIDE) if one.kind in (Kind.OUTPUT, Kind.SESSION)]
    assert len(walked) == len(promised) == 7
    for one in walked:
        assert one.printed == one.promised, one.what


def test_eight_touches_end_in_one_pose(walked):
    files = [one.text for one in blocks(GUIDE) if one.kind is Kind.FILE]
    assert len("".join(files).splitlines()) == 1 + 8
    (last,) = (one for one in walked if "8 contacts" in one.printed)
    assert "It is long-bracket" in last.printed
