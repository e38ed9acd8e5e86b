"""Numba decorators of the compiled kernels, and the cache folder of their machine code.

Numba detects changes of a function, but not of the functions and constants compiled into it: after
an update the old machine code would still run. So each version of the compiled sources has its own
cache folder, unless NUMBA_CACHE_DIR names one.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
from numba.extending import intrinsic as numba_intrinsic

Function = TypeVar("Function", bound=Callable[..., object])


def compiled(function: Function) -> Function:
    """Compile a function with a disk cache and without holding the interpreter lock."""
    return cast(Function, numba.njit(cache=True, nogil=True)(function))


def lean(function: Function) -> Function:
    """Compile a function that makes no arrays, without reference counting, which would take most of
    its time."""
    return cast(Function, numba.njit(cache=True, nogil=True, _nrt=False)(function))  # type: ignore[call-overload]


def inlined(function: Function) -> Function:
    """Compile a step of an inner loop into its callers, because passing an array takes seven
    arguments."""
    return cast(
        Function,
        numba.njit(cache=True, nogil=True, _nrt=False, forceinline=True)(function),  # type: ignore[call-overload]
    )


def instruction(function: Callable[..., Any]) -> Any:
    """Make a generator of LLVM code callable from compiled functions."""
    return numba_intrinsic(function)


_COMPILED = re.compile(rb"^@(numba\.njit|compiled|lean|inlined|instruction)\b", re.MULTILINE)
_IMPORTED = re.compile(rb"^from (navcore\.[\w.]+) import", re.MULTILINE)
KEPT_VERSIONS = 3
"""Number of versions whose code is kept."""


def source_version(package: Path) -> str:
    """Return a hash of the files with compiled functions and of those they import from."""
    texts = {file: file.read_bytes() for file in sorted(package.rglob("*.py"))}
    holding = [file for file, text in texts.items() if _COMPILED.search(text)]
    imported = {name.decode() for file in holding for name in _IMPORTED.findall(texts[file])}
    files = {
        *holding,
        *((package.parent / name.replace(".", "/")).with_suffix(".py") for name in imported),
    }
    return hashlib.blake2b(
        b"".join(texts.get(file, b"") for file in sorted(files)), digest_size=8
    ).hexdigest()


def set_cache_folder(package: Path) -> None:
    """Set numba's cache folder; numba chooses one itself if this one cannot be written."""
    with suppress(OSError):
        folder = package / "__pycache__" / f"compiled-{source_version(package)}"
        folder.mkdir(parents=True, exist_ok=True)
        os.utime(folder)
        numba.config.CACHE_DIR = str(folder)  # type: ignore[attr-defined]
        versions = sorted(folder.parent.glob("compiled-*"), key=lambda other: other.stat().st_mtime)
        for old in versions[:-KEPT_VERSIONS]:
            shutil.rmtree(old, ignore_errors=True)


if "NUMBA_CACHE_DIR" not in os.environ:
    set_cache_folder(Path(__file__).parent)
