"""Numba decorators of the compiled kernels, and the cache folder of their machine code.

Numba detects changes of a function, but not of the functions and constants compiled into it: after
an update the old machine code would still run. So each version of the compiled sources has its own
cache folder, unless NUMBA_CACHE_DIR names one. Several processes may fill it at the same time.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar, cast

import llvmlite.binding
import numba
from filelock import FileLock
from numba.core.caching import FunctionCache
from numba.core.dispatcher import Dispatcher
from numba.extending import intrinsic as numba_intrinsic

Function = TypeVar("Function", bound=Callable[..., object])


class SharedCache(FunctionCache):
    """Numba's disk cache of a function, for several processes that fill it at the same time.

    Numba reads the index of a function, names the file of the new code after the number of entries,
    and writes the index back. Of two processes that do so at once for two signatures, one loses its
    entry, and the other's entry may name the code of the wrong signature.
    """

    def save_overload(self, sig: Any, data: Any) -> None:
        """Save the code of a signature, one process at a time."""
        Path(self.cache_path).mkdir(parents=True, exist_ok=True)
        with FileLock(Path(self.cache_path) / "lock"):
            super().save_overload(sig, data)  # type: ignore[no-untyped-call]


def _cached(function: Function, **options: bool) -> Function:
    dispatcher = numba.njit(nogil=True, **options)(function)  # type: ignore[call-overload]
    if isinstance(dispatcher, Dispatcher):  # not with NUMBA_DISABLE_JIT
        cache = SharedCache(dispatcher.py_func)  # type: ignore[no-untyped-call]
        dispatcher._cache = cache  # type: ignore[attr-defined]
    return cast(Function, dispatcher)


def compiled(function: Function) -> Function:
    """Compile a function with a disk cache and without holding the interpreter lock."""
    return _cached(function)


def lean(function: Function) -> Function:
    """Compile a function that makes no arrays, without reference counting, which would take most of
    its time."""
    return _cached(function, _nrt=False)


def inlined(function: Function) -> Function:
    """Compile a step of an inner loop into its callers, because passing an array takes seven
    arguments."""
    return _cached(function, _nrt=False, forceinline=True)


def instruction(function: Callable[..., Any]) -> Any:
    """Make a generator of LLVM code callable from compiled functions."""
    return numba_intrinsic(function)


_COMPILED = re.compile(rb"^@(numba\.njit|compiled|lean|inlined|instruction)\b", re.MULTILINE)
_KERNEL = re.compile(rb"^@(numba\.njit|compiled|lean|inlined)\b", re.MULTILINE)
_IMPORTED = re.compile(rb"^from (navcore\.[\w.]+) import", re.MULTILINE)
KEPT_VERSIONS = 3
"""Number of versions whose code is kept."""
COMPLETE = "complete"
"""Name of the file that says that everything has been compiled."""


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
        folder = package / "__pycache__" / f"compiled-{source_version(package)}-{machine_version()}"
        folder.mkdir(parents=True, exist_ok=True)
        os.utime(folder)
        numba.config.CACHE_DIR = str(folder)  # type: ignore[attr-defined]
        versions = sorted(folder.parent.glob("compiled-*"), key=lambda other: other.stat().st_mtime)
        for old in versions[:-KEPT_VERSIONS]:
            shutil.rmtree(old, ignore_errors=True)


def machine_version() -> str:
    """Return a hash of what else the code depends on: the processor and the compiler."""
    features = llvmlite.binding.get_host_cpu_features().flatten()
    text = f"{numba.__version__} {llvmlite.binding.get_host_cpu_name()} {features}"
    return hashlib.blake2b(text.encode(), digest_size=4).hexdigest()


@dataclass(frozen=True, slots=True, kw_only=True)
class KernelCount:
    """How many of the compiled functions of a package have code in the cache."""

    done: int
    """Number of functions that have code."""
    all: int
    """Number of functions; some of them are compiled into others only."""


class KernelCache:
    """The cache folder of this process, and whether it holds everything that the robot needs."""

    def __init__(self, package: Path = Path(__file__).parent) -> None:
        folder = numba.config.CACHE_DIR  # type: ignore[attr-defined]
        self._folder = Path(folder) if folder else None
        self._all = sum(len(_KERNEL.findall(file.read_bytes())) for file in package.rglob("*.py"))

    @property
    def is_complete(self) -> bool:
        """Whether `complete` was called with this version; False where numba chose the folder."""
        return self._folder is not None and (self._folder / COMPLETE).exists()

    def count(self) -> KernelCount:
        """Return how far it is."""
        done = 0 if self._folder is None else sum(1 for _ in self._folder.glob("*/*.nbi"))
        return KernelCount(done=min(done, self._all), all=self._all)

    def complete(self) -> None:
        """Note that everything has been compiled."""
        with suppress(OSError):
            if self._folder is not None:
                (self._folder / COMPLETE).touch()


if "NUMBA_CACHE_DIR" not in os.environ:
    set_cache_folder(Path(__file__).parent)
