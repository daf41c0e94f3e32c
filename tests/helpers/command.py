"""The command line within the tests' own process, which spares a second of imports each time."""

from __future__ import annotations

import contextlib
import io
import sys
import warnings
from dataclasses import dataclass
from pathlib import Path
from unittest import mock

from palpate.scripts.cli import main


@dataclass(frozen=True)
class Told:
    """What a command said."""

    code: int
    out: str
    err: str


def run_here(*arguments: str, cwd: Path) -> Told:
    """`palpate ARGUMENTS` in a folder; warnings are told as they are on the command line."""
    out, err, code = io.StringIO(), io.StringIO(), None
    with (
        contextlib.chdir(cwd),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
        warnings.catch_warnings(),
        mock.patch.object(sys, "argv", ["palpate", *arguments]),
    ):
        warnings.simplefilter("default")
        try:
            main()
        except SystemExit as left:
            code = left.code or 0
    assert isinstance(code, int)
    return Told(code, out.getvalue(), err.getvalue())
