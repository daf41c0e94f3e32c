"""A story as one HTML file that needs nothing else: no server, no network, no viewer installed.

three.js draws; its modules, as they are published, stand in the file as data addresses, with their
licence. A content security policy in the file's head forbids the browser to load anything else.
"""

from __future__ import annotations

import json
from importlib import resources
from pathlib import Path
from string import Template
from urllib.parse import quote

from ..whole_file import write_whole
from .story import Story

__all__ = ["check_page_path", "page", "story_json", "write_page"]

SCRIPTS = ("story.js", "scene.js", "panel.js", "page.js")
"""Of the page, in the order in which they build on each other."""
MODULES = {
    "three": "three.module.min.js",
    "three/core": "three.core.min.js",
    "three/addons/controls/OrbitControls.js": "OrbitControls.js",
}
"""What the page and three.js import, and where among the assets it is; see assets/SOURCES.md."""
CORE = "./three.core.min.js"
"""How a module imports its other half; a data address has no neighbours, so a name is put there."""
PLAIN = "".join(set(map(chr, range(ord(" "), 127))) - set('%#"\\<'))
"""What may stand in a data address in JSON in HTML as it is."""
POLICY = (
    "default-src 'none'; script-src 'unsafe-inline' data:; style-src 'unsafe-inline'; img-src data:"
)
"""Nothing is loaded, not even from the same place; scripts and styles are the file's own."""
LIVE_POLICY = f"{POLICY}; connect-src 'self'"


def page(document: str, *, live: bool = False) -> str:
    """The page of a story.

    Args:
        document: what is told, as `story_json` gives it.
        live: whether a server will tell of changes, see `live_page`.
    """
    return Template(_asset("page.html")).substitute(
        policy=LIVE_POLICY if live else POLICY,
        live="yes" if live else "no",
        style=_asset("page.css"),
        story=document,
        licence=_asset("three-LICENSE.txt"),
        modules=json.dumps({"imports": {name: _address(file) for name, file in MODULES.items()}}),
        script="\n".join(_asset(name) for name in SCRIPTS),
    )


def story_json(story: Story) -> str:
    """A story's document, fit to stand in a page: no name in it can end the script it is in."""
    text = json.dumps(story.document(), separators=(",", ":"), allow_nan=False)
    return text.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")


def check_page_path(path: Path) -> None:
    """Refuse a path where no page can be written.

    Raises:
        ValueError: it doesn't end in .html, or its folder isn't there.
    """
    if path.suffix.lower() not in (".html", ".htm"):
        raise ValueError(f"{path}: a page's name ends in .html")
    if not path.parent.is_dir():
        raise ValueError(f"{path}: there is no folder {path.parent}")


def write_page(story: Story, path: Path) -> int:
    """Write the page of a story; the file appears whole or not at all.

    Returns:
        Its size, bytes.

    Raises:
        ValueError: a path where no page can be written.
    """
    check_page_path(path)
    content = page(story_json(story)).encode()
    write_whole(path, content)
    return len(content)


def _address(file: str) -> str:
    """A module as an address that holds it."""
    text = _asset(file).replace(f'"{CORE}"', '"three/core"')
    return f"data:text/javascript;charset=utf-8,{quote(text, safe=PLAIN)}"


def _asset(name: str) -> str:
    return (resources.files("palpate.assets") / "page" / name).read_text(encoding="utf-8")
