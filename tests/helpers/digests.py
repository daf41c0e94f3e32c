"""All the numbers in a value, to compare values to the bit."""

from __future__ import annotations

import numpy as np


def bytes_of(value: object) -> bytes:
    """Of dataclasses, dictionaries, tuples, lists, strings, arrays and numbers, in their order."""
    if isinstance(value, tuple | list):
        return b"".join(bytes_of(item) for item in value)
    if isinstance(value, dict):
        return b"".join(bytes_of(item) for item in value.values())
    if isinstance(value, str):
        return value.encode()
    if hasattr(value, "__dict__"):
        return bytes_of(vars(value))
    return np.asarray(value).tobytes()
