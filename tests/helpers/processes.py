"""Python in a process of its own, with the tests' modules at hand."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from helpers.checkout import TESTS

HEAVY = frozenset({"numpy", "scipy", "mujoco", "numba", "trimesh", "gymnasium"})
"""What a command that only tells its options has no time to load."""


def python(code: str, *arguments: str, beside: str | None = None) -> list[str]:
    """The command that runs code; it may import helpers, oracles and what lies beside a file."""
    folders = [str(TESTS)] if beside is None else [str(TESTS), str(Path(beside).parent)]
    return [sys.executable, "-c", f"import sys; sys.path[:0] = {folders!r}\n{code}", *arguments]


def printed_by(code: str, *, beside: str | None = None) -> str:
    """What code prints; it has to end well."""
    ended = subprocess.run(
        python(code, beside=beside), capture_output=True, text=True, check=False, timeout=120
    )
    assert ended.returncode == 0, ended.stderr
    return ended.stdout


def loaded_by(statement: str) -> frozenset[str]:
    """The packages, by their top names, that are loaded once a statement has run."""
    tops = "{name.partition('.')[0] for name in sys.modules}"
    return frozenset(printed_by(f"{statement}\nprint(*{tops})").split())
