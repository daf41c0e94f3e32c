"""A real browser, for tests: chromium without a screen, spoken to over its DevTools pipe."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from base64 import b64decode
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from select import select
from tempfile import TemporaryDirectory
from time import monotonic, sleep

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("chrome")
PATIENCE = 60.0
"""Seconds until a browser that says nothing counts as hung."""
OPTIONS = (
    "--headless",
    "--no-sandbox",  # for tests that run as root
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-dev-shm-usage",
    "--disable-background-networking",
    "--hide-scrollbars",
    "--remote-debugging-pipe",
)
# The browser reads what it is told from number 3 and answers on number 4.
WITH_PIPES = """
import os, sys
spare = [os.dup(int(number)) for number in sys.argv[1:3]]
while min(spare) < 5:
    spare = [os.dup(number) for number in spare]
os.dup2(spare[0], 3)
os.dup2(spare[1], 4)
os.execv(sys.argv[3], sys.argv[3:])
"""


class Tab:
    """A page in the browser."""

    def __init__(self, to_browser: int, from_browser: int) -> None:
        self._to, self._from = to_browser, from_browser
        self._count, self._rest = 0, b""
        self._session: str | None = None
        self.told: list[dict] = []
        """Events that came in."""
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        attached = self.call("Target.attachToTarget", targetId=target, flatten=True)
        self._session = attached["sessionId"]
        for domain in ("Page", "Network", "Runtime", "Log"):
            self.call(f"{domain}.enable")

    def call(self, method: str, **parameters: object) -> dict:
        self._count += 1
        message = {"id": self._count, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._to, json.dumps(message).encode() + b"\0")
        while True:
            answer = self._next()
            if answer.get("id") == self._count:
                assert "error" not in answer, answer["error"]
                return answer["result"]
            self.told.append(answer)

    def open(self, url: str, width: int = 1300, height: int = 850) -> None:
        self.call(
            "Emulation.setDeviceMetricsOverride",
            width=width,
            height=height,
            deviceScaleFactor=1,
            mobile=width < 600,
        )
        self.call("Page.navigate", url=url)
        self.wait("document.readyState === 'complete' && document.body.dataset.step !== undefined")

    def ask(self, expression: str) -> object:
        """The value of an expression; a promise is waited for."""
        answer = self.call(
            "Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True
        )
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    def wait(self, condition: str) -> None:
        ends = monotonic() + PATIENCE
        while not self.ask(condition):
            assert monotonic() < ends, f"never came: {condition}"
            sleep(0.05)

    def press(self, key: str) -> None:
        text = key if len(key) == 1 else ""
        self.call("Input.dispatchKeyEvent", type="keyDown", key=key, text=text)
        self.call("Input.dispatchKeyEvent", type="keyUp", key=key)

    def screenshot(self, path: Path | None = None) -> bytes:
        png = b64decode(self.call("Page.captureScreenshot", format="png")["data"])
        if path is not None:
            path.write_bytes(png)
        return png

    def requests(self) -> list[str]:
        """What was asked for, and wasn't in the page itself."""
        asked = [
            one["params"]["request"]["url"]
            for one in self.told
            if one["method"] == "Network.requestWillBeSent"
        ]
        return [url for url in asked if not url.startswith("data:")]

    def complaints(self) -> list[str]:
        """Errors that the page or the browser told."""
        thrown = [one["params"] for one in self.told if one["method"] == "Runtime.exceptionThrown"]
        logged = [
            one["params"]["entry"]
            for one in self.told
            if one["method"] == "Log.entryAdded" and one["params"]["entry"]["level"] == "error"
        ]
        return [json.dumps(one) for one in thrown + logged]

    def _next(self) -> dict:
        while b"\0" not in self._rest:
            ready, _, _ = select([self._from], [], [], PATIENCE)
            assert ready, "the browser hangs"
            more = os.read(self._from, 1 << 20)
            assert more, "the browser has gone"
            self._rest += more
        message, _, self._rest = self._rest.partition(b"\0")
        return json.loads(message)


@contextmanager
def browser(profile: Path) -> Iterator[Tab]:
    """A browser with one empty page; it uses a folder of its own."""
    assert CHROMIUM is not None
    read_in, to_browser = os.pipe()
    from_browser, write_out = os.pipe()
    process = subprocess.Popen(
        [sys.executable, "-c", WITH_PIPES, str(read_in), str(write_out), CHROMIUM, *OPTIONS]
        + [f"--user-data-dir={profile}"],
        pass_fds=(read_in, write_out),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    os.close(read_in)
    os.close(write_out)
    try:
        yield Tab(to_browser, from_browser)
    finally:
        os.close(to_browser)
        os.close(from_browser)
        process.terminate()
        process.wait(20)


FRAMES = """
new Promise((done) => {
  const seconds = 4;
  let count = 0, first = null;
  const next = (now) => {
    first ??= now;
    count += 1;
    if (now - first > 1000 * seconds) done((count - 1) / (now - first) * 1000);
    else requestAnimationFrame(next);
  };
  requestAnimationFrame(next);
})
"""


def frame_rate(tab: Tab, url: str, width: int, height: int) -> float:
    """Pictures a second while a page plays from its start."""
    tab.open(f"{url}#step=0", width, height)
    tab.press(" ")
    return float(tab.ask(FRAMES))  # pyright: ignore[reportArgumentType]


if __name__ == "__main__":  # python tests/helpers/browser.py PAGE.html: how smoothly does it play?
    with TemporaryDirectory() as folder, browser(Path(folder)) as opened:
        for size in ((1300, 850), (390, 800)):
            rate = frame_rate(opened, Path(sys.argv[1]).resolve().as_uri(), *size)
            print(f"{size[0]} x {size[1]}: {rate:.0f} pictures a second")
