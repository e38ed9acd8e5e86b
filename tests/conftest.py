"""What holds for all tests: they neither read nor write the engines that the user's machine
remembers, and a law has the same examples whichever tests ran before."""

from __future__ import annotations

import functools
import os
from pathlib import Path

import pytest
from hypothesis.internal.conjecture import providers
from pydantic._internal import _docs_extraction, _fields, _generate_schema

# Hypothesis adds constants of all imported modules to its examples, which so depend on what was
# imported before. To find them it parses sources, which fails within Playwright's greenlets.
providers._get_local_constants = lambda: providers._local_constants

# Pydantic parses the file of a dataclass for its docstrings whenever a route names the class: for
# hundreds of consoles in one process four fifths of the time to start one.
_docstrings_of = functools.cache(_docs_extraction.extract_docstrings_from_cls)
for _module in (_docs_extraction, _fields, _generate_schema):
    _module.extract_docstrings_from_cls = _docstrings_of  # type: ignore[attr-defined]


@pytest.fixture(autouse=True, scope="session")
def own_cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Set the folder of the engine memory, for processes started by tests, too."""
    folder = tmp_path_factory.mktemp("cache")
    os.environ["BEWARENAV_CACHE"] = str(folder)
    return folder
