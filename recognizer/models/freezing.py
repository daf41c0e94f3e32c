"""Arrays of values that nobody changes."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Number = TypeVar("Number", bound=np.generic)


def frozen(array: NDArray[Number]) -> NDArray[Number]:
    """The same array, read-only."""
    array.setflags(write=False)
    return array


def freeze(owner: object) -> None:
    """Make every array of a value read-only, also one that has just been unpickled."""
    for value in vars(owner).values():
        if isinstance(value, np.ndarray):
            value.setflags(write=False)
