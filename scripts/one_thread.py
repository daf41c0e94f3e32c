"""One thread for numerical libraries: what runs beside others, or is timed, needs no more."""

from __future__ import annotations

import os

__all__ = ["keep_to_one_thread"]


def keep_to_one_thread() -> None:
    """Keep numerical libraries to one thread; numba's kernels here have no other.

    They read it once: this comes before their import. Processes started later keep to it too.
    """
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ[name] = "1"
