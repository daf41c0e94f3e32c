"""Documents as their reader has them: what in them runs, what it prints, what they name.

Each block of a document is of a kind that something checks:

- ``python`` is a program. It goes on where the ones before it under the same heading ended.
- A block without a language, after a paragraph that says "prints", is what that program prints.
- ``console`` is a command after a ``$``, and what it prints.
- ``csv``, with a name after it, is written to the end of a file of that name.
- What is indented are commands to run elsewhere.
"""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum, auto
from itertools import pairwise
from pathlib import Path

from markdown_it import MarkdownIt
from markdown_it.token import Token

from .checkout import ROOT
from .command import run_here

DOCUMENTS = (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")))
MARK = "\0"
"""Stands between what an earlier program prints and what this one does."""
TOOLS = ("palpate", "make", "python", "pip")
"""What commands begin with."""


class Kind(Enum):
    """What a block is."""

    PROGRAM = auto()
    OUTPUT = auto()
    SESSION = auto()
    FILE = auto()
    COMMANDS = auto()


@dataclass(frozen=True)
class Block:
    """A block of a document."""

    kind: Kind
    text: str
    line: int
    heading: str
    """What it stands under."""
    name: str
    """Of a file; empty if it is in none."""


@dataclass(frozen=True)
class Said:
    """What was printed, and what the document says is printed."""

    what: str
    printed: str
    promised: str


def blocks(path: Path) -> list[Block]:
    """All blocks of a document.

    Raises:
        ValueError: one is of no kind.
    """
    found, heading, before = [], "", ""
    tokens = MarkdownIt("commonmark").parse(path.read_text(encoding="utf-8"))
    for token, after in pairwise([*tokens, Token("end", "", 0)]):
        if token.type == "heading_open":
            heading = after.content
        elif token.type == "inline":
            before = token.content
        elif token.type in ("fence", "code_block"):
            line = token.map[0] + 1 if token.map else 0
            language, _, name = token.info.strip().partition(" ")
            kind = _kind(token, language, name, before)
            if kind is Kind.OUTPUT and not (found and found[-1].kind is Kind.PROGRAM):
                kind = None
            if kind is None:
                raise ValueError(f"{path.name}, line {line}: a block that nothing checks")
            found.append(Block(kind, token.content, line, heading, name))
            before = ""
        elif token.type == "html_block":
            raise ValueError(f"{path.name}: HTML, which nothing checks")
    return found


def _kind(token: Token, language: str, name: str, before: str) -> Kind | None:
    lines = token.content.splitlines()
    if token.type == "code_block":
        first_words = {line.split()[0].rsplit("/")[-1] for line in lines if line.strip()}
        return Kind.COMMANDS if first_words <= set(TOOLS) else None
    if language == "console" and lines and lines[0].startswith("$ "):
        return Kind.SESSION
    if language == "csv" and name:
        return Kind.FILE
    if not language and before == "prints":
        return Kind.OUTPUT
    return Kind.PROGRAM if language == "python" else None


def walk(path: Path, folder: Path) -> Iterator[Said]:
    """Do what a document says, from its top, in an empty folder."""
    told = blocks(path)
    for index, block in enumerate(told):
        if block.name:
            with (folder / block.name).open("a", encoding="utf-8") as file:
                file.write(block.text)
        if block.kind is Kind.SESSION:
            line, _, promised = block.text.partition("\n")
            name, *arguments = shlex.split(line.removeprefix("$ "))
            assert name == "palpate"
            ended = run_here(*arguments, cwd=folder)
            assert ended.code == 0, f"{line}: {ended.err}"
            yield Said(line, shown(ended.out), shown(promised))
        elif block.kind is Kind.PROGRAM:
            earlier = [
                one.text
                for one in told[:index]
                if one.kind is Kind.PROGRAM and one.heading == block.heading
            ]
            printed = _run("".join([*earlier, f"print({MARK!r}, end='')\n", block.text]), folder)
            following = told[index + 1 : index + 2]
            if following and following[0].kind is Kind.OUTPUT:
                what = f"the program of line {block.line}"
                yield Said(what, shown(printed.rpartition(MARK)[2]), shown(following[0].text))


def _run(program: str, folder: Path) -> str:
    call = [sys.executable, "-W", "error:::__main__", "-c", program]
    ended = subprocess.run(call, cwd=folder, capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stderr
    return ended.stdout


def shown(text: str) -> str:
    """What is printed wherever it runs.

    That is without the spaces that end lines, which nobody sees, and without the remark that a
    machine without GL makes on its picture.
    """
    text = re.sub(r" \(no GL library was found.*\)$", "", text, flags=re.MULTILINE)
    return "\n".join(line.rstrip() for line in text.rstrip().splitlines())


def spans(path: Path) -> list[tuple[str, int]]:
    """Code within the text of a document, and the number of the line or table row it is in."""
    tokens = MarkdownIt("commonmark").enable("table").parse(path.read_text(encoding="utf-8"))
    found, line = [], 0
    for token in tokens:
        line = token.map[0] + 1 if token.map else line
        for part in token.children or ():
            if part.type == "code_inline":
                found.append((part.content, line))
    return found


def links(path: Path) -> list[str]:
    """Where the links and pictures of a document lead."""
    tokens = MarkdownIt("commonmark").enable("table").parse(path.read_text(encoding="utf-8"))
    parts = [part for token in tokens for part in token.children or ()]
    return [
        str(part.attrs["href" if part.type == "link_open" else "src"])
        for part in parts
        if part.type in ("link_open", "image")
    ]


def commands(path: Path) -> list[list[str]]:
    """All commands that a document names, split into words."""
    told = [line for one in blocks(path) if one.kind is Kind.COMMANDS for line in _lines(one)]
    told += [
        one.text.split("\n")[0].removeprefix("$ ")
        for one in blocks(path)
        if one.kind is Kind.SESSION
    ]
    told += [span for span, _ in spans(path) if re.match(rf"({'|'.join(TOOLS)}) ", span)]
    split = [shlex.split(line, comments=True) for line in told]
    return [[words[0].rsplit("/")[-1], *words[1:]] for words in split]


def _lines(block: Block) -> list[str]:
    return block.text.replace("\\\n", " ").strip().splitlines()
