"""A page on disk: Markdown with figures beside it, and one HTML file that needs nothing else."""

from __future__ import annotations

from base64 import b64encode
from html import escape
from pathlib import Path
from urllib.parse import unquote

from markdown_it import MarkdownIt

from ..whole_file import write_whole

__all__ = ["html", "write_page"]

STYLE = """
:root { color-scheme: light; }
body { font: 16px/1.5 system-ui, sans-serif; color: #1a1a1a; background: #fff;
       max-width: 80rem; margin: 2rem auto; padding: 0 1.25rem; }
p, li { max-width: 46rem; }
p:has(img) { max-width: none; margin: 1em 0 0; }
h1, h2, h3 { line-height: 1.2; margin: 2em 0 .5em; }
h1 { margin-top: 0; }
table { display: block; overflow-x: auto; border-collapse: collapse; font-size: .86rem;
        font-variant-numeric: tabular-nums; margin: .5em 0 1em; }
th, td { padding: .3em .7em; border-bottom: 1px solid #ddd; white-space: nowrap; }
th { border-bottom: 2px solid #888; vertical-align: bottom; white-space: normal; }
th:first-child { text-align: left; }
tr:has(strong) td { background: #eaf3fb; }
img { max-width: 100%; }
p > em:only-child { font-size: .9rem; font-style: normal; color: #444; }
pre { background: #f5f5f5; padding: .8em 1em; white-space: pre-wrap; overflow-wrap: anywhere; }
"""


def write_page(page: Path, text: str, title: str) -> None:
    """Write a page as Markdown and as HTML.

    Args:
        page: the files' path without ending; the figures are in its folder.
        text: Markdown.
        title: of the browser's tab.
    """
    for ending, content in (("md", text), ("html", html(text, title, page.parent))):
        write_whole(page.with_name(f"{page.name}.{ending}"), content.encode())


def html(text: str, title: str, folder: Path) -> str:
    """Markdown as an HTML page, figures and style in it.

    Args:
        text: Markdown; HTML in it is shown as it stands.
        title: of the browser's tab.
        folder: where its figures are, all SVG.
    """
    reader = MarkdownIt("commonmark", {"html": False}).enable("table")
    tokens = reader.parse(text)
    for image in (part for token in tokens for part in token.children or ()):
        if image.type == "image":
            drawing = (folder / unquote(str(image.attrs["src"]))).read_bytes()
            image.attrs["src"] = f"data:image/svg+xml;base64,{b64encode(drawing).decode()}"
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>{STYLE}</style>\n</head>\n"
        f"<body>\n{reader.renderer.render(tokens, reader.options, {})}</body>\n</html>\n"
    )
