"""Public data beside the checkout, which the repository does not hold."""

from __future__ import annotations

import os
from pathlib import Path

import pytest


def beside(path: Path, what: str) -> Path:
    """Return the path if it exists; else skip the test, or fail it in continuous integration."""
    if not path.exists():
        reason = f"{what} not beside this checkout: {path} is missing"
        if os.environ.get("CI") == "true":
            pytest.fail(reason)
        pytest.skip(reason)
    return path
