"""No test reads or writes the engines that the user's machine remembers."""

from __future__ import annotations

import os
from pathlib import Path

import pytest


@pytest.fixture(autouse=True, scope="session")
def own_cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Set the folder of the engine memory, for processes started by tests, too."""
    folder = tmp_path_factory.mktemp("cache")
    os.environ["BEWARENAV_CACHE"] = str(folder)
    return folder
