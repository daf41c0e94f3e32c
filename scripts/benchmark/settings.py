"""What a benchmark's folder says it holds, so that no other is played into it."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

from ..whole_file import write_whole
from .config import BenchmarkConfig, versions

__all__ = ["read_settings", "settle"]

SETTINGS_FILE = "config.json"


def settle(config: BenchmarkConfig, folder: Path) -> None:
    """Write down what the folder holds; if it already says, hold it to that.

    Raises:
        ValueError: it is another benchmark's.
    """
    path = folder / SETTINGS_FILE
    wanted = json.loads(json.dumps(asdict(config) | {"versions": json.loads(versions())}))
    if not path.exists():
        text = json.dumps(wanted | {"command": config.command(folder)}, indent=1)
        write_whole(path, (text + "\n").encode())
        return
    begun = read_settings(folder)
    for name, value in wanted.items():
        if begun.get(name) != value:
            raise ValueError(
                f"{folder} holds a benchmark whose {name} {_verb(name)} {_said(begun.get(name))},"
                f" not {_said(value)}: go on with that, or give another --out"
            )


def read_settings(folder: Path) -> dict[str, Any]:
    """What a benchmark's folder says it holds.

    Raises:
        ValueError: it isn't one.
    """
    path = folder / SETTINGS_FILE
    if not path.is_file():
        raise ValueError(f"{folder}: not the folder of a benchmark, it has no {SETTINGS_FILE}")
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except ValueError as wrong:
        raise ValueError(f"{path}: not JSON ({wrong})") from wrong


def _said(value: object) -> str:
    if isinstance(value, dict):
        return ", ".join(f"{key} {each}" for key, each in value.items())
    return " ".join(map(str, value)) if isinstance(value, list) else str(value)


def _verb(name: str) -> str:
    return "are" if name.endswith("s") else "is"
