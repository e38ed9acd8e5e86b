"""The machine code of the compiled kernels on disk, each file's under the version of its source.

Numba detects changes of a function's own file, by its time, but not of the functions and constants
compiled into it: after an update the old machine code would still run. Here the code of a file lies
in a folder that is named after the text of this file and of all that it imports, directly or not.
So a change compiles what it reaches again and nothing else, and a copy of the program, or another
version of it, uses what is there. Several processes may fill the folders at the same time.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import llvmlite.binding
import numba
from filelock import FileLock
from numba.core.caching import CompileResultCacheImpl, FunctionCache, _CacheLocator

PACKAGES = ("navcore", "sim", "app")
"""The packages that hold compiled functions; the robot needs those of the first."""
KEPT_VERSIONS = 3
"""Number of versions of a file whose code is kept."""
_COMPILED = re.compile(rb"^@(compiled|nested|finite|lean|inlined|instruction)\b", re.MULTILINE)
_KERNEL = re.compile(rb"^@(compiled|nested|finite|lean|inlined)\b", re.MULTILINE)
_IMPORTED = re.compile(rb"^\s*(?:from|import) ([\w.]+)", re.MULTILINE)


class SourceVersions:
    """The versions of files: their texts, and those of all that they import."""

    def __init__(self, top: Path, packages: tuple[str, ...] = PACKAGES) -> None:
        """`top` is the folder in which the packages lie."""
        self._top, self._packages = top, packages
        self._texts = dict[Path, bytes]()

    def text(self, file: Path) -> bytes:
        """Return the text of a file, as it was at first."""
        if file not in self._texts:
            self._texts[file] = file.read_bytes()
        return self._texts[file]

    def of(self, file: Path) -> str:
        """Return a hash of a file and of all that it reaches."""
        texts = b"\0".join(self.text(each) for each in sorted(self.reached(file)))
        return hashlib.blake2b(texts, digest_size=8).hexdigest()

    def reached(self, file: Path) -> set[Path]:
        """Return a file and all files of the packages that it imports, directly or not."""
        reached, new = {file}, [file]
        while new:
            found = self._imported(new.pop()) - reached
            reached |= found
            new += found
        return reached

    def _imported(self, file: Path) -> set[Path]:
        names = (name.decode().split(".") for name in _IMPORTED.findall(self.text(file)))
        paths = [self._top.joinpath(*parts) for parts in names if parts[0] in self._packages]
        modules = {path.with_suffix(".py") for path in paths} | {
            path / "__init__.py" for path in paths
        }
        # This file decides where the code lies, and not what it is.
        modules.discard(Path(__file__))
        return {path for path in modules if path in self._texts or path.is_file()}


@dataclass(frozen=True, slots=True, kw_only=True)
class KernelCount:
    """How many of the compiled functions of a package have code in the cache."""

    done: int
    """Number of functions that have code."""
    all: int
    """Number of functions; some of them are compiled into others only."""


class KernelCache:
    """The folders with the code of the files of some packages, and whether they hold all that the
    first of these packages needs."""

    def __init__(self, top: Path, root: Path, packages: tuple[str, ...] = PACKAGES) -> None:
        """The packages lie in `top`; the folders are made under `root` as they are needed."""
        self._root, self._top, self._packages = root / f"kernels-{machine_version()}", top, packages
        self._versions, self._folders = SourceVersions(top, packages), dict[Path, Path]()

    def folder_for(self, file: Path) -> Path | None:
        """Return the folder with the code of a file, which can be written; None where it cannot, or
        the file is not in the packages."""
        if file in self._folders:
            return self._folders[file]
        if (
            not file.is_relative_to(self._top)
            or file.parts[len(self._top.parts)] not in self._packages
        ):
            return None
        try:
            folder = self._folder(file)
            is_new = not folder.exists()
            folder.mkdir(parents=True, exist_ok=True)
            os.utime(folder)
        except OSError:
            return None
        self._folders[file] = folder
        if is_new:
            self._remove_old(folder)
        return folder

    def _folder(self, file: Path) -> Path:
        name = ".".join(file.relative_to(self._top).with_suffix("").parts)
        return self._root / f"{name}-{self._versions.of(file)}"

    @cached_property
    def _needed(self) -> list[Path]:
        """The files of the first package that hold compiled functions."""
        files = sorted((self._top / self._packages[0]).rglob("*.py"))
        return [file for file in files if _COMPILED.search(self._versions.text(file))]

    @property
    def _complete(self) -> Path:
        """The file that says that everything has been compiled."""
        names = " ".join(self._folder(file).name for file in self._needed)
        return self._root / f"complete-{hashlib.blake2b(names.encode(), digest_size=8).hexdigest()}"

    @property
    def is_complete(self) -> bool:
        """Whether `complete` was called with this version, and nothing was removed since."""
        return self._complete.exists()

    def complete(self) -> None:
        """Note that everything has been compiled."""
        with suppress(OSError):
            self._root.mkdir(parents=True, exist_ok=True)
            for old in self._root.glob("complete-*"):
                old.unlink()
            self._complete.touch()
            for old in self._root.parent.glob("compiled-*"):  # as versions before this one kept it
                shutil.rmtree(old, ignore_errors=True)

    def count(self) -> KernelCount:
        """Return how far it is."""
        texts = [self._versions.text(file) for file in self._needed]
        functions = sum(len(_KERNEL.findall(text)) for text in texts)
        done = sum(1 for file in self._needed for _ in self._folder(file).glob("*.nbi"))
        return KernelCount(done=min(done, functions), all=functions)

    def _remove_old(self, folder: Path) -> None:
        """Remove the code of old versions of a folder's file."""
        name = folder.name.rsplit("-", 1)[0]
        with suppress(OSError):
            versions = sorted(self._root.glob(f"{name}-*"), key=lambda each: each.stat().st_mtime)
            for old in versions[:-KEPT_VERSIONS]:
                for complete in self._root.glob("complete-*"):
                    complete.unlink(missing_ok=True)  # it may speak of what goes
                shutil.rmtree(old, ignore_errors=True)


def machine_version() -> str:
    """Return a hash of what else the code depends on: the processor and the compiler."""
    features = llvmlite.binding.get_host_cpu_features().flatten()
    text = f"{numba.__version__} {llvmlite.binding.get_host_cpu_name()} {features}"
    return hashlib.blake2b(text.encode(), digest_size=4).hexdigest()


def root_folder(package: Path) -> Path:
    """Return where the code is kept: in `NUMBA_CACHE_DIR`, beside the compiled files of a package,
    or, where nothing can be written there, in the user's cache folder."""
    given = os.environ.get("NUMBA_CACHE_DIR")
    if given:
        return Path(given)
    beside = package / "__pycache__"
    with suppress(OSError):
        beside.mkdir(exist_ok=True)
        if os.access(beside, os.W_OK):
            return beside
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "bewarenav"


_HERE = Path(__file__).parent
CACHE = KernelCache(_HERE.parent, root_folder(_HERE))
"""The code of this program."""


class _SourceLocator(_CacheLocator):
    """Tells numba where the code of a function lies."""

    def __init__(self, folder: Path, line: int) -> None:
        self._folder, self._line = folder, line

    def get_cache_path(self) -> str:
        return str(self._folder)

    def get_source_stamp(self) -> str:
        return ""  # the folder's name tells the version

    def get_disambiguator(self) -> str:
        return str(self._line)

    def ensure_cache_path(self) -> None:
        self._folder.mkdir(parents=True, exist_ok=True)

    @classmethod
    def from_function(cls, py_func: Callable[..., object], py_file: str) -> _SourceLocator | None:
        folder = CACHE.folder_for(Path(py_file))
        return None if folder is None else cls(folder, py_func.__code__.co_firstlineno)


class _SharedCacheImpl(CompileResultCacheImpl):
    _locator_classes = (_SourceLocator, *CompileResultCacheImpl._locator_classes)  # type: ignore[assignment]


class SharedCache(FunctionCache):
    """Numba's disk cache of a function, for several processes that fill it at the same time.

    Numba reads the index of a function, names the file of the new code after the number of entries,
    and writes the index back. Of two processes that do so at once for two signatures, one loses its
    entry, and the other's entry may name the code of the wrong signature.
    """

    _impl_class = _SharedCacheImpl

    def save_overload(self, sig: Any, data: Any) -> None:
        """Save the code of a signature, one process at a time."""
        Path(self.cache_path).mkdir(parents=True, exist_ok=True)
        with FileLock(Path(self.cache_path) / "lock"):
            super().save_overload(sig, data)  # type: ignore[no-untyped-call]
