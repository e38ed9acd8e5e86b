"""Public data beside the checkout, which the repository does not hold."""

from __future__ import annotations

import os
from pathlib import Path

import pytest


def beside(path: Path, what: str) -> Path:
    """The path if it is there; else the test is skipped, unless continuous integration promises it."""
    if not path.exists():
        reason = f"{what} not beside this checkout: {path} is missing"
        if os.environ.get("CI") == "true":
            pytest.fail(reason)
        pytest.skip(reason)
    return path
