"""README and guides run as they stand, print what they say, and name what there is."""

from __future__ import annotations

import re
from importlib.util import find_spec
from pathlib import Path
from pkgutil import resolve_name

import gymnasium
import numpy as np
import pytest
import typer
from helpers.checkout import ROOT
from helpers.documents import DOCUMENTS, Kind, blocks, commands, links, spans, walk
from PIL import Image

import palpate.envs
from palpate.scripts.cli import app

gymnasium.register_envs(palpate.envs)

README, GUIDE = ROOT / "README.md", ROOT / "docs" / "own-policy.md"
WALKED_ELSEWHERE = {
    "own-parts.md": "tests/scripts/commands/test_own_parts.py",
    "recipes.md": "tests/envs/test_recipes.py",
}
FOLDERS = ("assets", "docs", "envs", "policies", "recognizer", "scripts", "tests")
ANOTHER_PAINTER = 7.0
"""The same episode without GL differs by 5.4 of 255 in the mean, another rival in it by 9.2."""
each_document = pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)


@each_document
def test_something_checks_every_block(document):
    kinds = {block.kind for block in blocks(document)}
    assert kinds
    if document in (README, GUIDE):
        return
    assert (ROOT / WALKED_ELSEWHERE[document.name]).exists()
    # The test of the recipes runs programs, and looks at no output.
    assert document.name != "recipes.md" or kinds == {Kind.PROGRAM}


@pytest.mark.parametrize("document", [README, GUIDE], ids=lambda path: path.name)
def test_a_document_prints_what_it_says(document, tmp_path):
    told = list(walk(document, tmp_path))
    promised = [one for one in blocks(document) if one.kind in (Kind.OUTPUT, Kind.SESSION)]
    assert len(told) == len(promised)
    for one in told:
        assert one.printed == one.promised, one.what
    assert (document == README) == (tmp_path / "episode.png").exists()
    if document == README:
        drawn, kept = (coarse(folder / "episode.png") for folder in (tmp_path, ROOT / "docs"))
        assert np.abs(drawn - kept).mean() < ANOTHER_PAINTER


def coarse(picture: Path) -> np.ndarray:
    with Image.open(picture) as opened:
        return np.asarray(opened.convert("RGB").resize((160, 120)), float)


@each_document
def test_every_command_that_is_named_exists(document):
    group = typer.main.get_group(app)
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    for tool, *words in commands(document):
        if tool == "palpate":
            known = group
            for word in words[:1]:
                if not word.startswith("-"):
                    known = group.commands[word]
            options = {name for one in known.params for name in one.opts} | {"--help"}
            named = {word for word in words if re.match(r"--?[a-z]", word)}
            assert named <= options, words
        elif tool == "make":
            assert f"\n{words[0]}:" in makefile, words
        elif tool == "python":
            assert words[0] == "-m"
            assert find_spec(words[1]) is not None, words


@each_document
def test_every_path_that_is_named_exists(document):
    for link in links(document):
        assert re.match("https?://", link) or (document.parent / link.split("#")[0]).exists(), link
    folder, where = None, None
    for span, line in spans(document):
        if line != where:
            folder, where = None, line
        if re.fullmatch(r"palpate/\w+-v\d+", span):
            assert span in gymnasium.registry, span
        elif re.fullmatch(r"[\w.-]+(/[\w.-]+)*/?", span) and span.split("/")[0] in FOLDERS:
            assert (ROOT / span).exists(), span
            folder = ROOT / span if span.endswith("/") else (ROOT / span).parent
        elif re.fullmatch(r"\w+(\.py|/)", span) and folder is not None:
            # In the same line, what lies beside it or in it is named without its folder.
            assert (folder / span).exists(), span


@each_document
def test_every_module_that_is_named_exists(document):
    for span, _ in spans(document):
        if re.fullmatch(r"palpate(\.\w+)+", span):
            resolve_name(span)


def test_a_block_of_no_kind_is_noticed(tmp_path):
    page = tmp_path / "page.md"
    for text in (
        "```\nsome output\n```\n",
        "prints\n\n```\nwhat no program printed\n```\n",
        "```sh\npalpate episode\n```\n",
        "```console\nno prompt\n```\n",
        "```csv\n1,2\n```\n",
        "Text.\n\n    3 unexpected words\n",
        "<pre>output</pre>\n",
    ):
        page.write_text(text, encoding="utf-8")
        with pytest.raises(ValueError, match=r"page\.md.*nothing checks"):
            blocks(page)


def test_output_that_differs_is_noticed(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("```python\nprint(1)\n```\n\nprints\n\n```\n2\n```\n", encoding="utf-8")
    (told,) = walk(page, tmp_path)
    assert (told.printed, told.promised) == ("1", "2")
    page.write_text(
        "# a\n```python\nx = 1\nprint(x)\n```\n```python\nprint(x + 1)\n```\nprints\n```\n2\n```\n",
        encoding="utf-8",
    )
    (told,) = walk(page, tmp_path)
    assert told.printed == told.promised == "2"
