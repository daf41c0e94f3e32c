"""Compiling all kernels beforehand, in processes of their own, and saying so.

It happens once: when the first kernel is needed, or before, by `palpate prepare`. The processes
that compile can be ended at any moment, as the one that waits for them can't while it compiles;
whatever was finished is kept.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from importlib import import_module
from itertools import zip_longest
from pathlib import Path

from .kernel_store import (
    PREPARED,
    announcement,
    is_outdated,
    is_prepared,
    kernel_folder,
    mark,
    packages,
)

WORKERS = 2
"""Processes. More would compile what others need too."""
COMPILES_HERE = "PALPATE_COMPILES_HERE"
"""Set in the environment of these processes, which are not to start others."""
TOLD = "PALPATE_TOLD"
"""Set in the environment by a command that has said it already."""
KERNELS = 360
"""About as many are there, for the progress that is shown."""
STEPS = 4
"""Lines of progress where they can't be written over each other."""


def prepare() -> bool:
    """Compile all kernels, if that hasn't been done, with progress on stderr.

    Safe with other processes at it: one compiles, the others wait. Ctrl-C ends it at once and
    keeps what was finished.

    Returns:
        Whether there was anything to do; False too where nothing can be kept, or where kernels
        were changed since this process started, which others would compile as they are now.

    Raises:
        RuntimeError: a process that compiles failed.
    """
    folder = kernel_folder()
    if folder is None or is_prepared() or is_outdated():
        return False
    if TOLD not in os.environ:
        print(announcement(), file=sys.stderr, flush=True)
    with _alone(folder):
        if is_prepared():
            return True
        for stale in folder.parent.iterdir():
            if stale.is_dir() and stale != folder:
                shutil.rmtree(stale, ignore_errors=True)
        _compile()
        part = folder / f"{PREPARED}.{os.getpid()}"
        part.write_text(mark(), encoding="utf-8")
        part.replace(folder / PREPARED)
    return True


@contextmanager
def _alone(folder: Path) -> Iterator[None]:
    """Hold a lock that one process at a time has; where there are no locks, don't."""
    try:
        import fcntl
    except ImportError:
        yield
        return
    with open(folder.parent / "lock", "a") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield


def _compile() -> None:
    environment = {
        **os.environ,
        COMPILES_HERE: "1",
        "PYTHONPATH": os.pathsep.join(path for path in sys.path if path),
    }
    reading, writing = os.pipe()
    with (
        tempfile.TemporaryFile("w+") as errors,
        tempfile.TemporaryDirectory() as claims,
        open(reading, encoding="utf-8") as lines,
    ):
        code = f"from palpate.recognizer import preparing; preparing.compile_parts({claims!r})"
        workers = [
            subprocess.Popen(
                [sys.executable, "-P", "-c", code],
                env=environment,
                stdin=subprocess.DEVNULL,
                stdout=writing,
                stderr=errors,
            )
            for _ in range(WORKERS)
        ]
        os.close(writing)
        try:
            _show_progress(lines)
            codes = [worker.wait() for worker in workers]
        finally:
            for worker in workers:
                worker.kill()
                worker.wait()
        if any(codes):
            errors.seek(0)
            raise RuntimeError(f"kernels can't be compiled: {errors.read().strip()}")


def _show_progress(lines: Iterable[str]) -> None:
    """Count the kernels that processes say they have compiled."""
    over = sys.stderr.isatty()
    for done, _ in enumerate(lines, 1):
        share = min(done / KERNELS, 1.0)
        if over:
            print(f"\rpalpate: compiling, {share:4.0%}", end="", file=sys.stderr, flush=True)
        elif done % (KERNELS // STEPS) == 0:
            print(f"palpate: compiling, {share:.0%}", file=sys.stderr, flush=True)
    if over:
        print("\rpalpate: compiled.      ", file=sys.stderr, flush=True)


def tell_compiled(name: str) -> None:
    """Say that a kernel is compiled, to the process that waits, if one does."""
    if COMPILES_HERE in os.environ:
        print(name, flush=True)


def compile_parts(claims: str) -> None:
    """Compile parts that no other process has claimed, until none is left.

    Args:
        claims: a folder in which claims are made.
    """
    parts = [import_module(f"palpate.{name}.warm_up").PARTS for name in packages()]
    # The first of each package, then the second: the longest ones begin together.
    for number, part in enumerate(part for row in zip_longest(*parts) for part in row if part):
        try:
            Path(claims, str(number)).touch(exist_ok=False)
        except FileExistsError:
            continue
        part()
