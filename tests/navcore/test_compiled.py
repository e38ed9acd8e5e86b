"""Compiled code is cached by the version of its source."""

from __future__ import annotations

import shutil
from pathlib import Path

import numba
import pytest

import navcore
from navcore.compiled import set_cache_folder, source_version

SOURCE = Path(navcore.__file__).parent


def edited(package: Path, file: str) -> str:
    """Return the version after a comment was added to a file."""
    with (package / file).open("a", encoding="utf-8") as text:
        text.write("\n# one more word\n")
    return source_version(package)


def test_a_change_to_what_is_compiled_or_goes_into_it_makes_another_version(
    tmp_path: Path,
) -> None:
    package = tmp_path / "navcore"
    shutil.copytree(SOURCE, package, ignore=shutil.ignore_patterns("__pycache__", "*.safetensors"))
    first = source_version(package)
    assert (
        edited(package, "navigator.py") == first
    )  # holds nothing that is compiled, and nothing compiled reads it
    files = (
        "planning/search/jump_point_search.py",
        "planning/search/open_list.py",
        "grid/bitplane.py",
        "control/motion_primitives.py",
        "mission/beware_list.py",
    )
    assert len({first, *(edited(package, file) for file in files)}) == 1 + len(files)


def test_the_code_of_a_fewsource_versions_is_kept_and_no_more(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kernel = tmp_path / "kernel.py"
    for number in range(5):
        kernel.write_text(f"@compiled\ndef f():\n    return {number}\n", encoding="utf-8")
        monkeypatch.setattr(numba.config, "CACHE_DIR", "")
        set_cache_folder(tmp_path)
    kept = list((tmp_path / "__pycache__").iterdir())
    assert len(kept) == 3
    assert (tmp_path / "__pycache__" / f"compiled-{source_version(tmp_path)}") in kept


def test_numba_chooses_its_own_folder_where_nothing_can_be_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(numba.config, "CACHE_DIR", "")
    (tmp_path / "__pycache__").write_text("no folder", encoding="utf-8")
    set_cache_folder(tmp_path)
    assert numba.config.CACHE_DIR == ""  # type: ignore[attr-defined]
