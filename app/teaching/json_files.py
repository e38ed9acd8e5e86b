"""Dataclasses as JSON files that `from_table` reads."""

from __future__ import annotations

import dataclasses
import json
from typing import Any


def json_of(value: Any) -> bytes:
    """Return a dataclass as JSON; fields that are None are left out."""
    return json.dumps(_without_none(dataclasses.asdict(value))).encode()


def _without_none(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without_none(inner) for key, inner in value.items() if inner is not None}
    if isinstance(value, list | tuple):
        return [_without_none(inner) for inner in value]
    return value
