"""A page that changes as its story does, on this machine alone.

A standard-library server on the loopback: ``/`` is the page, ``/story.json`` the story as it is,
``/events`` tells the page, as server-sent events, when to ask for it again.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Condition, Thread

from .page import page, story_json
from .story import Story

__all__ = ["HOST", "LivePage", "serve"]

HOST = "127.0.0.1"
"""The loopback: nobody on the network reaches it."""
SILENCE = 10.0
"""Seconds after which a page that has nothing to be told is told so: thus it is seen to be gone."""


@dataclass(eq=False)
class LivePage:
    """A story that is being told, and those who wait for more of it."""

    document: str
    """The story, as `story_json` gives it."""
    version: int = 0
    ended: bool = False
    _changed: Condition = field(default_factory=Condition)

    @classmethod
    def of(cls, story: Story) -> LivePage:
        """A page that shows this story at first."""
        return cls(story_json(story))

    def tell(self, story: Story) -> None:
        """Have all pages show this story."""
        document = story_json(story)
        with self._changed:
            self.document = document
            self.version += 1
            self._changed.notify_all()

    def end(self) -> None:
        """Let go of all who wait."""
        with self._changed:
            self.ended = True
            self._changed.notify_all()

    def after(self, version: int, timeout: float) -> int:
        """The version, as soon as it is another than this or the time is up, seconds."""
        with self._changed:
            self._changed.wait_for(lambda: self.ended or self.version != version, timeout)
            return self.version


@contextmanager
def serve(live: LivePage, port: int = 0) -> Iterator[str]:
    """Serve a page while the body runs; gives its address.

    Args:
        live: what is shown.
        port: where; 0 for any that is free.

    Raises:
        ValueError: the port is taken.
    """
    try:
        server = _Server((HOST, port), type("Handler", (_Handler,), {"live": live}))
    except OSError as error:
        raise ValueError(
            f"port {port}: {error.strerror}; --port 0 takes any that is free"
        ) from None
    thread = Thread(target=server.serve_forever, args=(0.1,), daemon=True)
    thread.start()
    try:
        yield f"http://{HOST}:{server.server_address[1]}/"
    finally:
        live.end()
        server.shutdown()
        thread.join()
        server.server_close()


class _Server(ThreadingHTTPServer):
    daemon_threads = True
    block_on_close = False  # an answer under way may wait for a browser


class _Handler(BaseHTTPRequestHandler):
    live: LivePage

    def do_GET(self) -> None:
        port = self.connection.getsockname()[1]
        # A name of somebody else's that leads here is how a foreign page would read this one.
        if self.headers.get("Host") not in (f"{HOST}:{port}", f"localhost:{port}"):
            self.send_error(403)
        elif self.path == "/":
            self._send("text/html; charset=utf-8", page(self.live.document, live=True))
        elif self.path == "/story.json":
            self._send("application/json", self.live.document)
        elif self.path == "/events":
            self._events()
        else:
            self.send_error(404)

    def _send(self, kind: str, text: str) -> None:
        content = text.encode()
        self.send_response(200)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(content)))
        self.send_header("Cache-Control", "no-store")
        self.end_headers()
        self.wfile.write(content)

    def _events(self) -> None:
        """Tell of each change until the page is closed or all is over."""
        live = self.live
        self.send_response(200)
        self.send_header("Content-Type", "text/event-stream")
        self.send_header("Cache-Control", "no-store")
        self.end_headers()
        told = -1  # the page may be older than the story
        try:
            while not live.ended:
                version = live.after(told, SILENCE)
                line = ": still here" if version == told else f"data: {version}"
                self.wfile.write(f"{line}\n\n".encode())
                self.wfile.flush()
                told = version
        except (BrokenPipeError, ConnectionResetError):
            pass  # the page was closed

    def log_message(self, format: str, *args: object) -> None:
        """Say nothing: the terminal is for the story."""
