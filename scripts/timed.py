"""How long a call takes."""

from __future__ import annotations

from collections.abc import Callable
from time import process_time
from typing import ParamSpec, TypeVar

__all__ = ["timed"]

P = ParamSpec("P")
T = TypeVar("T")


def timed(call: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> tuple[T, float]:
    """What a call returns, and the seconds that the processor spends on it.

    On a quiet machine these are the clock's; on a busy one they are what is left of the truth.
    """
    started = process_time()
    found = call(*args, **kwargs)
    return found, process_time() - started
