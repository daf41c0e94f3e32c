"""What developers measure with: soundness, soak and benchmarks. Not in the wheel."""

import sys
from pathlib import Path

# The lab judges by the tests' oracles (`from oracles.geometry import ...`), so that there is one of
# each. It runs from a checkout alone, where the tests lie beside it; here, because every way into
# the lab, spawned workers' too, imports this package first. At the end, to come before nothing.
_TESTS = str(Path(__file__).resolve().parents[2] / "tests")
if _TESTS not in sys.path:
    sys.path.append(_TESTS)
