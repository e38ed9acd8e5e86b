"""Compiled code is kept by the version of its source."""

from __future__ import annotations

import ast
import shutil
import threading
from pathlib import Path
from typing import Any

import numba
import pytest
from numba.core.caching import FunctionCache

import navcore
from navcore.kernel_cache import (
    CACHE,
    KEPT_VERSIONS,
    KernelCache,
    SharedCache,
    SourceVersions,
    root_folder,
)

SOURCE = Path(navcore.__file__).parent


@pytest.fixture
def top(tmp_path: Path) -> Path:
    """A folder with a copy of the package."""
    shutil.copytree(
        SOURCE,
        tmp_path / "top" / "navcore",
        ignore=shutil.ignore_patterns("__pycache__", "*.safetensors"),
    )
    return tmp_path / "top"


def folder(top: Path, file: str) -> Path:
    """The folder that a new process would use for the code of a file."""
    found = KernelCache(top, top / "cache").folder_for(top / "navcore" / file)
    assert found is not None
    return found


def edited(top: Path, file: str) -> None:
    with (top / "navcore" / file).open("a", encoding="utf-8") as text:
        text.write("\n# one more word\n")


@pytest.mark.parametrize(
    ("changed", "again", "kept"),
    [
        ("navigator.py", (), ("planning/search/jump_point_search.py", "grid/bitplane.py")),
        (
            "planning/search/open_list.py",
            ("planning/search/open_list.py", "planning/search/jump_point_search.py"),
            ("grid/bitplane.py", "control/motion_primitives.py"),
        ),
        # Imported by what it imports, and by no kernel itself.
        ("mission/zone_shapes.py", ("planning/escape.py",), ("grid/bitplane.py",)),
        ("toml_config.py", ("perception/ground.py",), ("control/collision/footprint_distance.py",)),
    ],
)
def test_a_change_compiles_again_what_it_reaches_and_nothing_else(
    top: Path, changed: str, again: tuple[str, ...], kept: tuple[str, ...]
) -> None:
    before = {file: folder(top, file) for file in (*again, *kept)}
    edited(top, changed)
    for file, version in before.items():
        assert (folder(top, file) == version) == (file in kept), file


def test_a_copy_of_the_program_uses_the_same_code(top: Path, tmp_path: Path) -> None:
    copy = tmp_path / "elsewhere"
    shutil.copytree(top, copy)
    kernel = "grid/bitplane.py"
    (copy / "navcore" / kernel).touch()
    assert folder(copy, kernel).name == folder(top, kernel).name


def test_the_code_of_a_few_versions_is_kept_and_no_more(top: Path) -> None:
    other = folder(top, "grid/runs.py")
    for _ in range(5):
        newest = folder(top, "grid/bitplane.py")
        edited(top, "grid/bitplane.py")
    kept = set(newest.parent.glob("navcore.grid.bitplane-*"))
    assert len(kept) == KEPT_VERSIONS and newest in kept
    assert other.exists()


def test_functions_of_other_programs_are_no_business_of_this_cache(
    top: Path, tmp_path: Path
) -> None:
    assert KernelCache(top, tmp_path / "cache").folder_for(Path(numba.__file__)) is None


def test_where_nothing_can_be_written_the_folder_of_the_user_is_used(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "user"))
    assert root_folder(tmp_path) == tmp_path / "__pycache__"
    (tmp_path / "__pycache__").rmdir()
    (tmp_path / "__pycache__").write_text("no folder", encoding="utf-8")
    assert root_folder(tmp_path) == tmp_path / "user" / "bewarenav"
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "given"))
    assert root_folder(tmp_path) == tmp_path / "given"


def test_functions_are_compiled_without_a_cache_where_none_can_be_written(
    top: Path, tmp_path: Path
) -> None:
    (tmp_path / "file").write_text("no folder", encoding="utf-8")
    cache = KernelCache(top, tmp_path / "file")
    assert cache.folder_for(top / "navcore" / "grid" / "bitplane.py") is None
    cache.complete()
    assert not cache.is_complete


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


def test_the_kernels_of_the_package_lie_in_its_cache() -> None:
    from navcore.grid import flood_fill

    cache = flood_fill.flood._cache  # type: ignore[attr-defined]
    assert Path(cache.cache_path) == CACHE.folder_for(Path(flood_fill.__file__))


def test_the_cache_knows_how_many_kernels_it_has_and_whether_these_are_all(tmp_path: Path) -> None:
    package = tmp_path / "navcore"
    package.mkdir()
    source = "@compiled\ndef f(): ...\n@lean\ndef g(): ...\n@instruction\ndef h(): ...\n"
    (package / "kernels.py").write_text(source, encoding="utf-8")
    cache = KernelCache(tmp_path, tmp_path / "cache")
    folder = cache.folder_for(package / "kernels.py")
    assert folder is not None
    (folder / "kernels.f-1.py311.nbi").touch()
    assert (cache.count().done, cache.count().all) == (1, 2)
    assert not cache.is_complete
    cache.complete()
    assert KernelCache(tmp_path, tmp_path / "cache").is_complete
    (package / "kernels.py").write_text(source + "# more\n", encoding="utf-8")
    assert not KernelCache(tmp_path, tmp_path / "cache").is_complete


def test_a_cache_from_which_code_was_removed_is_not_complete(top: Path) -> None:
    KernelCache(top, top / "cache").complete()
    first = (top / "navcore" / "grid" / "bitplane.py").read_text(encoding="utf-8")
    for _ in range(KEPT_VERSIONS + 1):
        folder(top, "grid/bitplane.py")
        edited(top, "grid/bitplane.py")
    (top / "navcore" / "grid" / "bitplane.py").write_text(first, encoding="utf-8")
    assert not KernelCache(top, top / "cache").is_complete


def test_what_kernels_reach_imports_no_module_as_a_name_of_its_package() -> None:
    """Such imports are not followed: a change there would not compile the kernels again."""
    versions = SourceVersions(SOURCE.parent)
    kernels = [file for file in SOURCE.rglob("*.py") if b"@compiled" in versions.text(file)]
    reached = {one for file in kernels for one in versions.reached(file)}
    assert len(reached) > len(kernels) > 40
    for file in reached:
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("navcore"):
                package = SOURCE.parent.joinpath(*str(node.module).split("."))
                names = [one.name for one in node.names]
                assert not any((package / f"{name}.py").exists() for name in names), file
