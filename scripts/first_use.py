"""What is said at once where a command will have to wait for palpate to compile itself.

The recogniser says it too, but only once a second of imports is over and a kernel is needed.
"""

from __future__ import annotations

import os
import sys
from importlib.util import find_spec, module_from_spec, spec_from_file_location
from pathlib import Path

TOLD = "PALPATE_TOLD"
"""Set in the environment where it has been said."""


def tell_first_use() -> None:
    """Say on stderr that kernels will be compiled, if they will be."""
    package = find_spec("palpate.recognizer")
    if package is None or package.origin is None or TOLD in os.environ:
        return
    # By its file: as a member of its package it would bring in all of the recogniser.
    place = Path(package.origin).with_name("kernel_store.py")
    spec = spec_from_file_location("palpate_kernel_store", place)
    if spec is None or spec.loader is None:
        return
    store = module_from_spec(spec)
    spec.loader.exec_module(store)
    if not store.is_prepared():
        print(store.announcement(), file=sys.stderr, flush=True)
        os.environ[TOLD] = "1"
