"""What warming up compiles is all that people wait for, once."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from helpers import late_compilation


def test_nothing_is_compiled_after_warming_up():
    # A process of its own: other tests give kernels arrays of all kinds.
    script = Path(late_compilation.__file__)
    run = subprocess.run(
        [sys.executable, script],
        capture_output=True,
        text=True,
        check=False,
        cwd=script.parent,
        env={**os.environ, "PYTHONPATH": str(script.parent.parent)},
    )
    assert run.returncode == 0, run.stderr
    assert run.stdout.strip() == ""
