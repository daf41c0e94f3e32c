"""Markdown of a page: what isn't plain words comes out letter by letter, whatever reads it."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from textwrap import indent
from urllib.parse import quote

__all__ = ["Table", "code", "figure", "items", "literal"]

SPECIAL = re.compile(r"[\\`*_~|#$&]|<(?=\S)|\](?=[\[(:])")
"""Brackets only where a link could begin: intervals are full of them, and pages define none."""


@dataclass(frozen=True)
class Table:
    """Rows under heads, shown letter by letter; the first column is text, the others are figures.

    Its text is Markdown.
    """

    heads: Sequence[str]
    rows: Sequence[Sequence[str]]
    marked: Collection[int] = ()
    """Rows that stand out: their first cells are bold."""

    def __str__(self) -> str:
        """As Markdown."""
        ruled = ["---", *["---:"] * (len(self.heads) - 1)]
        shown = [[*map(literal, row)] for row in (self.heads, *self.rows)]
        for number in self.marked:
            shown[number + 1][0] = f"**{shown[number + 1][0]}**"
        return "\n".join(f"| {' | '.join(row)} |" for row in (shown[0], ruled, *shown[1:]))


def literal(text: str) -> str:
    """Text that Markdown shows letter by letter: a name may hold anything."""
    return SPECIAL.sub(r"\\\g<0>", text)


def items(lines: Iterable[str]) -> str:
    """Lines of Markdown as a list."""
    return "\n".join(f"- {line}" for line in lines)


def code(text: str) -> str:
    """What is shown letter by letter, line by line."""
    return indent(text, "    ")


def figure(file: str, caption: str) -> str:
    """A drawing that lies beside the page."""
    return f"![{literal(caption)}]({quote(file)})\n\n*{literal(caption)}*"
