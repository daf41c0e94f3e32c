"""Small files kept between runs: whole or not there, and safe with other processes at work."""

from __future__ import annotations

import hashlib
import os
import tempfile
import warnings
from contextlib import suppress
from functools import cache
from pathlib import Path

CHECKSUM_BYTES = 16


def cache_folder(name: str) -> Path | None:
    """A folder of the user's cache; None if the user has no such place."""
    from platformdirs import user_cache_path

    folder = user_cache_path("palpate", appauthor=False) / name
    # Without a home directory the path comes back with its tilde, relative to wherever we are.
    return folder if folder.is_absolute() else None


def read_kept(path: Path) -> memoryview | None:
    """What `keep` wrote; None if there is no such file, or it isn't whole."""
    try:
        content = path.read_bytes()
    except OSError:
        return None
    body = memoryview(content)[CHECKSUM_BYTES:]
    return body if content[:CHECKSUM_BYTES] == _checksum(body) else None


def keep(path: Path, body: bytes, what: str) -> None:
    """Write under a name of its own, then rename: no reader ever sees half a file.

    Args:
        path: of the file; a folder that can't be written is said once, as a warning.
        body: what to write, behind a checksum of `CHECKSUM_BYTES`.
        what: what it is, for the warning: "range tables".
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=path.stem, suffix=".part")
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(_checksum(body) + body)
            os.replace(temporary, path)
        except BaseException:
            with suppress(OSError):
                os.unlink(temporary)
            raise
    except OSError as error:
        _warn_of(str(path.parent), what, error.strerror or type(error).__name__)


def _checksum(body: bytes | memoryview) -> bytes:
    return hashlib.blake2b(body, digest_size=CHECKSUM_BYTES).digest()


@cache
def _warn_of(folder: str, what: str, reason: str) -> None:
    """Warn once a process and folder, however many files there are."""
    warnings.warn(
        f"{folder}: {what} can't be kept here ({reason}), so they are worked out each time",
        UserWarning,
        stacklevel=4,
    )
