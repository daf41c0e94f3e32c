"""Calls that must not happen any more."""

from __future__ import annotations

import pytest


def forbid(monkeypatch: pytest.MonkeyPatch, owner: object, name: str) -> None:
    """Have every call of something fail from here on."""

    def complain(*_: object, **__: object) -> None:
        raise AssertionError(f"{name} was called again")

    monkeypatch.setattr(owner, name, complain)
