"""HTML pages as a reader has them."""

from __future__ import annotations

from base64 import b64decode
from html.parser import HTMLParser


class Shown(HTMLParser):
    """What a reader sees of an HTML page."""

    def __init__(self, page: str) -> None:
        """Read a page."""
        super().__init__()
        self.text, self.elements = "", set[str]()
        self.lines: list[list[str]] = []
        """Of all tables, cell by cell."""
        self.drawings: list[bytes] = []
        """SVG that stands in the page."""
        self.loaded: list[str] = []
        """Addresses of what doesn't."""
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note an element."""
        self.elements.add(tag)
        named = dict(attrs)
        if tag == "tr":
            self.lines.append([])
        elif tag in ("td", "th"):
            self.lines[-1].append("")
        source = named.get("src") or named.get("href")
        if source and source.startswith("data:image/svg+xml;base64,"):
            self.drawings.append(b64decode(source.partition(",")[2]))
        elif source:
            self.loaded.append(source)

    def handle_data(self, data: str) -> None:
        """Note words."""
        self.text += data
        if self.lines and self.lines[-1] and self.lasttag in ("td", "th", "strong"):
            self.lines[-1][-1] += data.strip("\n")
