"""What holds for all tests: they neither read nor write the engines that the user's machine
remembers, and a law has the same examples whichever tests ran before."""

from __future__ import annotations

import functools
import os
from pathlib import Path
from typing import Any

import pytest
from fastapi._compat import v2 as fastapi_fields
from hypothesis.internal.conjecture import providers
from pydantic import TypeAdapter
from pydantic._internal import _docs_extraction, _fields, _generate_schema

# Hypothesis adds constants of all imported modules to its examples, which so depend on what was
# imported before. To find them it parses sources, which fails within Playwright's greenlets.
providers._get_local_constants = lambda: providers._local_constants

# Pydantic parses the file of a dataclass for its docstrings whenever a route names the class: for
# hundreds of consoles in one process four fifths of the time to start one.
_docstrings_of = functools.cache(_docs_extraction.extract_docstrings_from_cls)
for _module in (_docs_extraction, _fields, _generate_schema):
    _module.extract_docstrings_from_cls = _docstrings_of  # type: ignore[attr-defined]

# FastAPI makes a validator for each parameter and answer of each route, 0.6 s for the routes of a
# console. Those of the next console have the same types.
_validators: dict[tuple[object, str], tuple[object, TypeAdapter[Any]]] = {}


def _validator(annotated: Any, *, config: Any = None) -> TypeAdapter[Any]:
    """Return the validator of a field; its description is kept, so that no other object gets the
    address that is in its text."""
    key = (annotated.__origin__, repr((annotated.__metadata__, config)))
    if key not in _validators:
        _validators[key] = annotated, TypeAdapter(annotated, config=config)
    return _validators[key][1]


fastapi_fields.TypeAdapter = _validator  # type: ignore[assignment,attr-defined]


@pytest.fixture(autouse=True, scope="session")
def own_cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Set the folder of the engine memory, for processes started by tests, too."""
    folder = tmp_path_factory.mktemp("cache")
    os.environ["BEWARENAV_CACHE"] = str(folder)
    return folder
