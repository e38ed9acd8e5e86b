"""Numba decorators of the compiled kernels, and the folder that their machine code is cached in.

Numba notices that a function has changed, but not that a function or constant which is compiled
into it has: after an update the old machine code would run on. So each version of the compiled
sources has a cache folder of its own, unless NUMBA_CACHE_DIR names one.
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
    """Compile, keep the result on disk, let other threads run meanwhile."""
    return cast(Function, numba.njit(cache=True, nogil=True)(function))


def lean(function: Function) -> Function:
    """The same for functions that make no arrays: they need not count references, which would take
    most of their time."""
    return cast(Function, numba.njit(cache=True, nogil=True, _nrt=False)(function))  # type: ignore[call-overload]


def inlined(function: Function) -> Function:
    """The same for steps of an inner loop: compiled into their callers, since an array costs seven
    arguments to hand on."""
    return cast(
        Function,
        numba.njit(cache=True, nogil=True, _nrt=False, forceinline=True)(function),  # type: ignore[call-overload]
    )


def instruction(function: Callable[..., Any]) -> Any:
    """Make a function that writes machine-independent code callable from compiled ones."""
    return numba_intrinsic(function)


_COMPILED = re.compile(rb"^@(numba\.njit|compiled|lean|inlined|instruction)\b", re.MULTILINE)
_IMPORTED = re.compile(rb"^from (navcore\.[\w.]+) import", re.MULTILINE)
_KEPT = 3
"""So many versions' code is kept."""


def _version(package: Path) -> str:
    """Of the files that hold compiled functions, and of those that they import from."""
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


def _keep_compiled_code(package: Path) -> None:
    """Say where numba is to keep it; where nothing can be written numba finds a place by itself."""
    with suppress(OSError):
        folder = package / "__pycache__" / f"compiled-{_version(package)}"
        folder.mkdir(parents=True, exist_ok=True)
        os.utime(folder)
        numba.config.CACHE_DIR = str(folder)  # type: ignore[attr-defined]
        versions = sorted(folder.parent.glob("compiled-*"), key=lambda other: other.stat().st_mtime)
        for old in versions[:-_KEPT]:
            shutil.rmtree(old, ignore_errors=True)


if "NUMBA_CACHE_DIR" not in os.environ:
    _keep_compiled_code(Path(__file__).parent)
