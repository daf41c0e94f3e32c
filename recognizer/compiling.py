"""How kernels that only borrow their arrays are compiled, and those made of vector instructions."""

from __future__ import annotations

from typing import Any

from numba import njit
from numba.core.options import DefaultOptions

# numba counts references to arrays with atomic instructions, at each tuple unpacked and each row
# passed on: more than half of a search's time. Its own sorting kernels leave the counting out with
# this option, which has no public name; a numba without it counts.
_UNCOUNTED: dict[str, Any] = {"_nrt": False} if hasattr(DefaultOptions, "_nrt") else {}

borrowing = njit(cache=True, **_UNCOUNTED)
"""Compiles a kernel that makes no array and returns none: its callers keep all that it is given."""

_VECTORISED: dict[str, Any] = {"error_model": "numpy", "fastmath": {"contract", "nnan", "nsz"}}

vectorised = njit(cache=True, **_VECTORISED, **_UNCOUNTED)
"""Compiles a borrowing kernel whose inner loops are to become vector instructions: nothing divides
by zero or makes a NaN, no sign of a zero matters, products and sums may be contracted."""
