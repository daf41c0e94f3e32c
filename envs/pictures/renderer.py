"""Who paints pictures: MuJoCo in a process of its own, or NumPy where no GL library works.

A missing or broken GL library may kill the process that tries it, so none is tried in this one.
"""

from __future__ import annotations

import ctypes.util
import os
import subprocess
import sys
import weakref
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .picture_scene import PictureScene
from .software import paint
from .view import Stage

__all__ = ["Renderer"]

GL_SECONDS = 20.0
"""A process that has not answered by then is given up: with software GL it needs about two."""
PARTING_SECONDS = 2.0
"""So long a process that isn't needed any more may take to end by itself."""

Size = tuple[int, int]


class Renderer:
    """Paints scene after scene. The process that paints them starts with the first.

    Close it when done, or use it in a ``with`` statement. It may be pickled; a copy starts a
    process of its own.
    """

    def __init__(self) -> None:
        self._untried = _gl_environments()
        self._process: _GlProcess | None = None
        self.name = "MuJoCo"
        """Who painted last: "MuJoCo" or "NumPy"."""

    def draw(self, scene: PictureScene, stage: Stage, size: Size) -> NDArray[np.uint8]:
        """The picture without captions, ``(height, width, 3)``; ``size`` is (width, height)."""
        while self._process or self._untried:
            try:
                if self._process is None:
                    self._process = _GlProcess(self._untried.pop(0))
                return self._process.draw(scene, stage, size)
            except (OSError, EOFError):
                self._end_process()
        self.name = "NumPy"
        return paint(scene, stage, size)

    def close(self) -> None:
        """End the process; a later `draw` starts another."""
        if self._process is not None:
            self._end_process()
            self._untried = _gl_environments()

    def _end_process(self) -> None:
        if self._process is not None:
            self._process.end()
        self._process = None

    def __enter__(self) -> Renderer:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __getstate__(self) -> dict[str, Any]:
        """A copy starts afresh."""
        return Renderer().__dict__


class _GlProcess:
    """MuJoCo's renderer in a process, and the line to it.

    Every call may raise OSError or EOFError: the process has died or hangs.
    """

    def __init__(self, environment: dict[str, str]) -> None:
        self._line, far_end = Pipe()
        # -P: the folder that the user happens to stand in must not hide a module.
        command = [sys.executable, "-P", "-m", "palpate.envs.pictures.gl", str(far_end.fileno())]
        with far_end:
            process = subprocess.Popen(
                command,
                env=environment,
                pass_fds=[far_end.fileno()],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
            )
        self.end = weakref.finalize(self, _part, self._line, process)
        self._await_answer()
        self._line.recv()  # it is ready, so it will not leave a large scene lying in the line

    def draw(self, scene: PictureScene, stage: Stage, size: Size) -> NDArray[np.uint8]:
        self._line.send((scene, stage, size))
        self._await_answer()
        pixels = np.frombuffer(self._line.recv_bytes(), np.uint8)
        return pixels.reshape(size[1], size[0], 3)

    def _await_answer(self) -> None:
        if not self._line.poll(GL_SECONDS):
            self.end()
            raise TimeoutError(f"the renderer has not answered in {GL_SECONDS:g} s")


def _part(line: Connection, process: subprocess.Popen[bytes]) -> None:
    """Hang up, which ends a process that works; kill one that doesn't."""
    line.close()
    try:
        process.wait(PARTING_SECONDS)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def _gl_environments() -> list[dict[str, str]]:
    """The environments to try MuJoCo's renderer in, best first."""
    if os.environ.get("MUJOCO_GL") or sys.platform != "linux":
        return [dict(os.environ)]
    names = [("egl", "EGL"), ("osmesa", "OSMesa")]
    found = [name for name, library in names if ctypes.util.find_library(library)]
    if os.environ.get("DISPLAY"):
        found.append("glfw")
    return [{**os.environ, "MUJOCO_GL": name} for name in found]
