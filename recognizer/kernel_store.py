"""Where compiled kernels are kept, and when they are stale.

numba stamps the compiled code of a kernel with the text of its own file only, though the code of
all kernels that it calls is linked into it. Here one stamp covers every kernel of palpate.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
from contextlib import suppress
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
"""The folder in which the recogniser lies beside all else that has kernels."""
PREPARED = "prepared"
"""Name of the file that says that everything was compiled, and for what."""


def packages() -> tuple[str, ...]:
    """The folders with kernels: each has a module that warms them up, the recogniser's first."""
    found = sorted(path.parent.name for path in ROOT.glob("*/warm_up.py"))
    return tuple(sorted(found, key=lambda name: name != "recognizer"))


@cache
def stamp() -> str:
    """A hash of the text of all kernels and of how they are compiled."""
    files = [path for name in packages() for path in (ROOT / name).rglob("*_kernels.py")]
    files += [ROOT / "recognizer" / name for name in ("compiling.py", "linking.py")]
    digest = hashlib.sha256()
    for path in sorted(files):
        digest.update(str(path.relative_to(ROOT)).encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()


@cache
def kernel_folder() -> Path | None:
    """Where compiled kernels are kept; None if they can be kept nowhere.

    Beside the source where that can be written or has been prepared, as an image's builder does
    for its users; else in the user's cache; else, without a home, in a folder of the user's own
    among the temporary ones. ``NUMBA_CACHE_DIR`` is respected where it is set.
    """
    beside = ROOT / "recognizer" / "__pycache__" / "kernels" / stamp()[:16]
    own = hashlib.sha256(str(ROOT).encode()).hexdigest()[:12]
    given = os.environ.get("NUMBA_CACHE_DIR")
    if given:
        places = [Path(given) / f"palpate-{own}" / stamp()[:16]]
    elif _read(beside / PREPARED) == mark():
        return beside
    else:
        places = [beside, *(place / stamp()[:16] for place in _of_the_user(own))]
    return next((place for place in places if _writable(place)), None)


def is_outdated() -> bool:
    """Whether kernels have been changed since this process first looked at them."""
    return stamp.__wrapped__() != stamp()


def is_prepared() -> bool:
    """Whether all kernels have been compiled for this processor, as they are now."""
    folder = kernel_folder()
    return folder is not None and _read(folder / PREPARED) == mark()


def announcement() -> str:
    """What is said before kernels are compiled."""
    return (
        "palpate: first use: compiling its kernels, once, for about two minutes, into"
        f" {kernel_folder()} (`palpate prepare` does it beforehand)"
    )


@cache
def mark() -> str:
    """What the kernels of this version are compiled for."""
    from importlib.metadata import version

    from llvmlite import binding

    processor = f"{binding.get_host_cpu_name()} {binding.get_host_cpu_features().flatten()}"
    return f"{stamp()} numba {version('numba')} {hashlib.sha256(processor.encode()).hexdigest()}\n"


def _of_the_user(own: str) -> list[Path]:
    from platformdirs import user_cache_path

    places = [user_cache_path("palpate", appauthor=False) / f"kernels-{own}"]
    if hasattr(os, "getuid"):
        # Nobody else may have made it: what lies in it is loaded as code.
        temporary = Path(tempfile.gettempdir()) / f"palpate-{os.getuid()}"
        with suppress(OSError):
            temporary.mkdir(mode=0o700, exist_ok=True)
            state = temporary.lstat()
            if state.st_uid == os.getuid() and state.st_mode & 0o077 == 0:
                places.append(temporary / f"kernels-{own}")
    return [place for place in places if place.is_absolute()]


def _read(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except OSError:
        return ""


def _writable(folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False
