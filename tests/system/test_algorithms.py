"""The defaults that the page of algorithms shows are those of the code."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from navcore.config.navigator import NavigatorConfig
from navcore.config.perception.perception import DEFAULT_PERCEPTION
from navcore.config.safety import DEFAULT_SAFETY

PAGE = Path(__file__).parents[2] / "navcore" / "ALGORITHMS.md"
DEFAULT = re.compile(r"`([a-z][\w.]*) = ([^`]+)`")
PARTS = {"perception": DEFAULT_PERCEPTION, "safety": DEFAULT_SAFETY}


def default_of(key: str) -> Any:
    """The default value of a key path of the configuration."""
    first, _, rest = key.partition(".")
    value: Any = PARTS.get(first, NavigatorConfig())
    for name in (rest if first in PARTS else key).split("."):
        value = getattr(value, name)
    return value


def test_every_default_on_the_page_is_that_of_the_code() -> None:
    shown = DEFAULT.findall(PAGE.read_text(encoding="utf-8"))
    assert len(shown) > 30
    for key, value in shown:
        assert str(default_of(key)) == value, key
