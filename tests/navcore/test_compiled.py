"""Compiled code is cached by the version of its source."""

from __future__ import annotations

import shutil
import threading
from pathlib import Path
from typing import Any

import numba
import pytest
from numba.core.caching import FunctionCache

import navcore
from navcore.compiled import KernelCache, SharedCache, set_cache_folder, source_version

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
    assert any(folder.name.startswith(f"compiled-{source_version(tmp_path)}-") for folder in kept)


def test_numba_chooses_its_own_folder_where_nothing_can_be_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(numba.config, "CACHE_DIR", "")
    (tmp_path / "__pycache__").write_text("no folder", encoding="utf-8")
    set_cache_folder(tmp_path)
    assert numba.config.CACHE_DIR == ""  # type: ignore[attr-defined]


def doubled(number: Any) -> Any:
    return number + number


def kept_of_two_writers(kind: Any) -> int:
    """Return for how many signatures a function's cache has the right code after two writers have
    read its index at the same time, if they can."""
    kernel = numba.njit(doubled)
    kernel(1), kernel(1.0)
    signatures = [result.signature for result in kernel.overloads.values()]
    results = list(kernel.overloads.values())
    first, second = kind(doubled), kind(doubled)
    has_read, other_is_done = threading.Event(), threading.Event()
    save_index = first._cache_file._save_index

    def save_late(overloads: Any) -> None:
        has_read.set()
        other_is_done.wait(0.3)
        save_index(overloads)

    first._cache_file._save_index = save_late
    writer = threading.Thread(target=first.save_overload, args=(signatures[0], results[0]))
    writer.start()
    assert has_read.wait(30.0)
    second.save_overload(signatures[1], results[1])
    other_is_done.set()
    writer.join()
    loaded = [kind(doubled).load_overload(one, kernel.targetctx) for one in signatures]
    return sum(
        found is not None and found.signature == one
        for found, one in zip(loaded, signatures, strict=True)
    )


def test_two_processes_that_compile_one_function_at_a_time_lose_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path / "locked"))
    assert kept_of_two_writers(SharedCache) == 2
    # The control: numba's own cache.
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path / "unlocked"))
    assert kept_of_two_writers(FunctionCache) < 2


def test_the_cache_knows_how_many_kernels_it_has_and_whether_these_are_all(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package, folder = tmp_path / "package", tmp_path / "cache"
    (folder / "room").mkdir(parents=True)
    package.mkdir()
    source = "@compiled\ndef f(): ...\n@lean\ndef g(): ...\n@instruction\ndef h(): ...\n"
    (package / "kernels.py").write_text(source, encoding="utf-8")
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(folder))
    cache = KernelCache(package)
    (folder / "room" / "kernels.f-1.py311.nbi").touch()
    assert (cache.count().done, cache.count().all) == (1, 2)
    assert not cache.is_complete
    cache.complete()
    assert KernelCache(package).is_complete
    monkeypatch.setattr(numba.config, "CACHE_DIR", "")
    assert not KernelCache(package).is_complete, "a folder that numba chose is not known"
