"""A report's page: blocks of content, as Markdown and as one HTML file that needs nothing else."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from html import escape

STYLE = """
:root { color-scheme: light; }
body { font: 16px/1.5 system-ui, sans-serif; color: #1a1a1a; background: #fff;
       max-width: 80rem; margin: 2rem auto; padding: 0 1.25rem; }
p, li { max-width: 46rem; }
h1, h2, h3 { line-height: 1.2; margin: 2em 0 .5em; }
h1 { margin-top: 0; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-size: .86rem; font-variant-numeric: tabular-nums;
        margin: .5em 0 1em; }
th, td { padding: .3em .7em; border-bottom: 1px solid #ddd; text-align: right;
         white-space: nowrap; }
th { border-bottom: 2px solid #888; vertical-align: bottom; white-space: normal; }
th:first-child, td:first-child { text-align: left; }
tr.best td { background: #eaf3fb; font-weight: 600; }
tr.marked td { background: #fdf1e3; }
figure { margin: 1em 0 2em; }
figure svg { max-width: 100%; height: auto; }
figcaption { font-size: .9rem; color: #444; max-width: 46rem; }
pre { background: #f5f5f5; padding: .8em 1em; white-space: pre-wrap; overflow-wrap: anywhere; }
"""


@dataclass(frozen=True)
class Heading:
    """A title."""

    text: str
    level: int = 2


@dataclass(frozen=True)
class Paragraph:
    """Running text."""

    text: str
    lead: str = ""
    """Bold words before it, if it has any."""


@dataclass(frozen=True)
class Items:
    """A list of lines."""

    items: Sequence[str]


@dataclass(frozen=True)
class Code:
    """What is shown letter by letter."""

    text: str


@dataclass(frozen=True)
class Table:
    """Rows under heads; the first column is text, the others are figures."""

    heads: Sequence[str]
    rows: Sequence[Sequence[str]]
    best: int | None = None
    """The row that stands out, if one does."""
    marked: Collection[int] = ()
    """Rows to be looked at twice."""


@dataclass(frozen=True)
class Figure:
    """A drawing."""

    name: str
    """Of its file, without ending."""
    svg: str
    caption: str


Block = Heading | Paragraph | Items | Code | Table | Figure


def markdown(blocks: Sequence[Block], prefix: str) -> str:
    """The page as Markdown.

    Args:
        blocks: its content.
        prefix: what the names of its figures' files start with.
    """
    return "\n\n".join(_markdown(block, prefix) for block in blocks) + "\n"


def html(blocks: Sequence[Block], title: str) -> str:
    """The page as HTML, figures and style in it."""
    body = "\n".join(_html(block) for block in blocks)
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>{STYLE}</style>\n</head>\n"
        f"<body>\n{body}\n</body>\n</html>\n"
    )


def _markdown(block: Block, prefix: str) -> str:
    match block:
        case Heading(text, level):
            return f"{'#' * level} {text}"
        case Paragraph(text, lead):
            return f"**{lead}** {text}".rstrip() if lead else text
        case Items(items):
            return "\n".join(f"- {item}" for item in items)
        case Code(text):
            return "\n".join(f"    {line}" for line in text.splitlines())
        case Table(heads, rows, best, marked):
            ruled = ["---", *["---:"] * (len(heads) - 1)]
            shown = [
                [f"**{row[0]}**" if number == best or number in marked else row[0], *row[1:]]
                for number, row in enumerate(rows)
            ]
            return "\n".join(f"| {' | '.join(row)} |" for row in [list(heads), ruled, *shown])
        case Figure(name, _, caption):
            return f"![{caption}]({prefix}{name}.svg)\n\n*{caption}*"


def _html(block: Block) -> str:
    match block:
        case Heading(text, level):
            return f"<h{level}>{escape(text)}</h{level}>"
        case Paragraph(text, lead):
            bold = f"<strong>{escape(lead)}</strong> " if lead else ""
            return f"<p>{bold}{escape(text)}</p>"
        case Items(items):
            return "<ul>" + "".join(f"<li>{escape(item)}</li>" for item in items) + "</ul>"
        case Code(text):
            return f"<pre>{escape(text)}</pre>"
        case Table(heads, rows, best, marked):
            lines = ["<tr>" + "".join(f"<th>{escape(head)}</th>" for head in heads) + "</tr>"]
            for number, row in enumerate(rows):
                kind = "best" if number == best else "marked" if number in marked else ""
                mark = f' class="{kind}"' if kind else ""
                cells = "".join(f"<td>{escape(cell)}</td>" for cell in row)
                lines.append(f"<tr{mark}>{cells}</tr>")
            return '<div class="wide"><table>\n' + "\n".join(lines) + "\n</table></div>"
        case Figure(_, svg, caption):
            drawing = svg[svg.index("<svg") :]
            return f"<figure>{drawing}<figcaption>{escape(caption)}</figcaption></figure>"
